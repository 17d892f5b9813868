"""The driver of a base that runs ROS 2.

Decides: when velocities are sent, which pose counts, and when the base has lost its place.  Must
not know: how messages are laid out, and how keys are named.
"""

from __future__ import annotations

import math
import threading
import time

from protocol.zenoh_transport import ZenohTransport
from robot_agent.driver import Driver, Pose
from robot_agent.loop import PERIOD_NS
from robot_agent.ros2 import messages
from robot_agent.ros2.arc import Arc
from robot_agent.ros2.frames import Frames, compose, inverse, moved
from robot_agent.ros2.topics import TWIST, TWIST_STAMPED, Topics


class RosBase(Driver):
    """A base that obeys a Twist and tells its pose, reached through Zenoh.

    `connect`: the endpoint of the bridge, or of the router of rmw_zenoh.  `topics`: Bridge or
    RmwZenoh.  `pose`: the topic of the pose, of messages of `pose_kind`, one of messages.KINDS; for
    tf it is the pose of `frames[1]` in `frames[0]`.  `command`: the topic of the Twist, which is a
    TwistStamped if `stamped`.  `turn_rate` [rad/s]: how fast it may turn on the spot.  A pose older
    than `lost_s` [s] does not count any more.

    Odometry begins anywhere, so its poses count from where the robot is placed.  All others are
    poses on the scenario's floor.
    """

    def __init__(
        self,
        connect: str,
        topics: Topics,
        *,
        pose: str = "odom",
        pose_kind: str = messages.ODOMETRY,
        frames: tuple[str, str] = ("map", "base_link"),
        command: str = "cmd_vel",
        stamped: bool = False,
        turn_rate: float = 1.0,
        lost_s: float = 0.3,
    ) -> None:
        if pose_kind not in messages.KINDS:
            raise ValueError(f"pose_kind is one of {', '.join(messages.KINDS)}, not {pose_kind!r}")
        self._topics, self._kind, self._names = topics, pose_kind, frames
        self._twist = TWIST_STAMPED if stamped else TWIST
        self._command = topics.key(command, self._twist)
        self._lost_ns = round(lost_s * 1e9)
        self._arc, self._frames = Arc(turn_rate), Frames()
        self._gate = threading.Lock()
        self._told: tuple[Pose, int] | None = None
        self._placed: Pose | None = None
        self._origin: Pose | None = None if pose_kind == messages.ODOMETRY else (0.0, 0.0, 0.0)
        self._velocities, self._sent_ns = (0.0, 0.0), 0
        self._link = ZenohTransport.connect(connect, whom="bridge or router of ROS 2")
        self._over = threading.Event()
        for topic in ("tf", "tf_static") if pose_kind == messages.TF else (pose,):
            self._link.subscribe(topics.key(topic, pose_kind), self._hear)
        self._watch = threading.Thread(target=self._keep, daemon=True)
        self._watch.start()

    def step(self, now_ns: int) -> None:
        """Do nothing: the base moves by itself."""

    def pose(self) -> Pose | None:
        """Return the pose told last, moved on by what the base was told since then."""
        with self._gate:
            if self._told is None or self._origin is None:
                return None
            pose, heard_ns = self._told
            age_ns = time.monotonic_ns() - heard_ns
            if age_ns > self._lost_ns:
                return None
            return moved(compose(self._origin, pose), *self._velocities, age_ns / 1e9)

    def place(self, x: float, y: float, heading: float) -> None:
        """Let odometry count from this pose; other poses are right as they are."""
        with self._gate:
            if self._kind == messages.ODOMETRY:
                self._placed = (x, y, heading)
                self._take_origin()

    def drive(self, speed_mps: float, curvature_radpm: float, distance_m: float) -> None:
        """Send velocities along the arc, now and until its end."""
        with self._gate:
            self._arc.drive(time.monotonic_ns(), speed_mps, curvature_radpm, distance_m)
            self._send()

    def turn(self, angle_rad: float) -> None:
        """Send a rate of turn."""
        with self._gate:
            self._arc.turn(time.monotonic_ns(), angle_rad)
            self._send()

    def stop(self) -> None:
        """Send velocities of 0."""
        self.drive(0.0, 0.0, 0.0)

    def close(self) -> None:
        """Stop the base and close the link."""
        self._over.set()
        self._watch.join()
        self.stop()
        self._link.close()

    def _keep(self) -> None:
        """Send what the last command asks for by now, also when the loop hangs."""
        while not self._over.wait(PERIOD_NS / 1e9):
            with self._gate:
                if time.monotonic_ns() - self._sent_ns >= PERIOD_NS:
                    self._send()

    def _send(self) -> None:
        self._sent_ns = time.monotonic_ns()
        self._velocities = self._arc.velocities(self._sent_ns)
        payload = messages.twist(self._twist, *self._velocities, time.time_ns())
        self._link.put(self._command, payload, self._topics.attachment())

    def _hear(self, _key: str, payload: bytes, _sent_ns: int | None) -> None:
        now_ns = time.monotonic_ns()
        try:
            if self._kind == messages.TF:
                for parent, child, pose in messages.transforms_in(payload):
                    self._frames.hear(parent, child, pose, now_ns)
                told = self._frames.pose(*self._names)
            else:
                told = messages.pose_in(self._kind, payload), now_ns
        except ValueError:
            return  # It is as good as lost: without a pose the robot stops.
        if told is None or not all(map(math.isfinite, told[0])):
            return
        with self._gate:
            self._told = told
            self._take_origin()

    def _take_origin(self) -> None:
        if self._placed is not None and self._told is not None:
            self._origin = compose(self._placed, inverse(self._told[0]))
            self._placed = None
