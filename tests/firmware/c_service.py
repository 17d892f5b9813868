"""A robot of the virtual world whose program is the C agent: a thin pipe around the host program.

It stands where RobotService stands.  The core hears bytes and measured places, and what it answers
moves the body and goes on the link; nothing of the Python agent takes part.
"""

from __future__ import annotations

import math
import subprocess
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

from protocol import keys
from protocol.codec import decode
from protocol.curve import Curve
from protocol.messages import Plan
from protocol.plan_parts import unpack_plan
from robot_agent.driver import Driver
from robot_agent.service import Robot
from tests.firmware.streams import Tick, read_answers


class CService:
    """One robot and its process; `agent` has the attributes that the world looks at."""

    def __init__(
        self,
        core: Path,
        robot: Robot,
        transport,
        driver: Driver,
        fleet: str,
        *,
        boot: int,
        clock: Callable[[], int],
        period_ns: int,
    ) -> None:
        self.robot, self._transport, self._driver, self._fleet = robot, transport, driver, fleet
        self._clock = clock
        self.quiet_until_ns = 0  # Every tick is the C agent's.
        self.inbox = SimpleNamespace(waits=False)
        follower = SimpleNamespace(s=0.0)
        self.agent = SimpleNamespace(
            phase=0, ride=SimpleNamespace(follower=follower), clock=SimpleNamespace(good=0)
        )
        self._starts: dict[int, tuple[float, float, float]] = {}
        self._epoch = 0
        self._waiting: list[tuple[str, bytes, int]] = []
        self._process = subprocess.Popen(
            [core], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
        )
        sizes = (robot.radius, robot.max_speed, robot.max_accel, robot.max_speed)
        numbers = " ".join(size.hex() for size in sizes)
        self._tell(f"robot {robot.id} {numbers} {boot} {period_ns}")
        for key in (keys.command(fleet), keys.plan(fleet, robot.id), keys.clock(fleet, robot.id)):
            transport.subscribe(key, self._enqueue)
        transport.declare_alive(keys.alive(fleet, robot.id))

    def tick(self, now_ns: int) -> bool:
        """Hear, measure, decide, drive and speak, as firmware/examples/loop.c does."""
        for kind, payload, heard_ns in self._waiting:
            self._tell(f"{kind} {heard_ns if kind == 'clock' else now_ns} {payload.hex()}")
        self._waiting.clear()
        driver = self._driver
        driver.step(now_ns)
        pose = driver.pose()
        if pose is None and self._epoch in self._starts:
            pose = self._starts[self._epoch]
            driver.place(*pose)
        x, y, heading = pose or (math.nan, 0.0, 0.0)
        told = self._ask(f"tick {now_ns} {x.hex()} {y.hex()} {heading.hex()}")
        if told.turn:
            driver.turn(told.turn)
        else:
            driver.drive(told.speed, told.curvature, told.distance)
        for kind, payload in told.sent:
            self._transport.put(getattr(keys, kind)(self._fleet, self.robot.id), payload)
        self.agent.phase, self._epoch = told.phase, told.epoch
        self.agent.ride.follower.s = told.place
        return not told.leaves

    def rest(self, _now_ns: int) -> bool:
        """Return that every tick has to be a whole one."""
        return False

    def rescue(self, _error: Exception, now_ns: int) -> None:
        """Report that the base failed."""
        self._tell(f"failed {now_ns}")

    def end(self) -> None:
        """End the process; it must not have stopped on undefined behaviour."""
        self._process.communicate()
        assert self._process.returncode == 0

    def _enqueue(self, key: str, payload: bytes, _sent_ns: int | None) -> None:
        kind = key.split("/")[2]
        self._waiting.append((kind, payload, self._clock()))
        plan = decode(kind, payload) if kind == "plan" else None
        if isinstance(plan, Plan) and plan.revision == 0:
            curve = Curve(*unpack_plan(plan).path)
            curve.place(0.0)
            self._starts[plan.epoch] = (curve.x, curve.y, math.atan2(curve.dy, curve.dx))

    def _tell(self, line: str) -> None:
        self._process.stdin.write(line + "\n")

    def _ask(self, line: str) -> Tick:
        self._tell(line)
        text = ""
        while not text.rpartition("\n")[0].rpartition("\n")[2].startswith("tick"):
            more = self._process.stdout.readline()
            assert more, "the C agent stopped"
            text += more
        return read_answers(text)[0]


class CRobots:
    """In place of World._service: robots of these names (all when empty) run the C agent."""

    def __init__(self, core: Path, names: tuple[str, ...] = ()) -> None:
        self.core, self.names = core, names
        self.services: list[CService] = []

    def wrap(self, usual):
        """Return a method for World that starts the C agent or the usual one."""

        def service(world, name, radius, body, boot, clock):
            if self.names and name not in self.names:
                return usual(world, name, radius, body, boot, clock)
            session = world._network.session(name)
            options = {"boot": boot, "clock": clock, "period_ns": world._period_ns}
            robot = Robot(name, radius)
            one = CService(self.core, robot, session, body, world.fleet.name, **options)
            self.services.append(one)
            return one

        return service

    def end(self) -> None:
        """End all processes."""
        for one in self.services:
            one.end()
