"""A simulated base: a unicycle with the interface of a Driver.

Decides: where the body truly is.  Must not know: plans, phases, messages; other bodies.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable

from robot_agent.driver import Driver, Pose

TURN_RATE = 2.0
"""How quickly a body turns on the spot [rad/s]."""

_MOST_SIGMAS = math.sqrt(2.0 * 53.0 * math.log(2.0))
"""A random error is at most so many standard deviations: random numbers have 53 bits."""

_BITS_PER_POSE = 128
"""How many random bits the two numbers in `pose` take from the generator."""

SLEW_SHARE = 1.25
"""How much harder the motors can accelerate than plans ask them to."""


class SimulatedBody(Driver):
    """A unicycle on a plane; arcs are integrated exactly.

    `max_accel` [m/s^2]: the plan's limit; with inf the speed changes at once.  `wheel_gain`: metres
    rolled per metre commanded, a constant error of the wheels.  `noise` [m]: standard deviation of
    the measured position, whose random errors follow from `seed`; the attributes x, y and heading
    are the true pose.  `clock`: returns the time [ns] by which the body moves; without it the
    robot's own time is used.  The body stops at once at the end of a commanded distance, and when
    the watchdog expires.
    """

    def __init__(
        self,
        max_accel: float = math.inf,
        *,
        wheel_gain: float = 1.0,
        noise: float = 0.0,
        seed: int = 0,
        clock: Callable[[], int] | None = None,
    ) -> None:
        self.x = self.y = self.heading = math.nan
        self.speed = 0.0
        self._accel = max_accel * SLEW_SHARE
        self._gain = wheel_gain
        self._noise = noise
        dice = random.Random(seed)
        self._chance, self._bits = dice.random, dice.getrandbits
        self._clock = clock
        self._now_ns: int | None = None
        self._powered_ns = 0
        self._wanted = 0.0
        self._curvature = 0.0
        self._room = self._turn = 0.0

    def place(self, x: float, y: float, heading: float) -> None:
        """Put the body at a pose, at rest."""
        self.x, self.y, self.heading = x, y, heading
        self.stop()

    def true_pose(self) -> Pose | None:
        """Return the body's pose without noise."""
        x = self.x
        return None if math.isnan(x) else (x, self.y, self.heading)

    @property
    def most_noise(self) -> float:
        """The greatest error [m] that a measured position can have."""
        return self._noise * _MOST_SIGMAS

    def skip_poses(self, count: int) -> None:
        """Take in that `pose` was not called so many times; later random errors stay the same."""
        if self._noise and self.x == self.x:
            self._bits(_BITS_PER_POSE * count)

    def pose(self) -> Pose | None:
        """Return the measured pose."""
        x, noise = self.x, self._noise
        if x != x:
            return None
        if not noise:
            return x, self.y, self.heading
        turn = math.tau * self._chance()  # Two normal errors at once, as Box and Muller do.
        size = math.sqrt(-2.0 * math.log(1.0 - self._chance()))
        there = x + math.cos(turn) * size * noise, self.y + math.sin(turn) * size * noise
        return (*there, self.heading)

    def drive(self, speed_mps: float, curvature_radpm: float, distance_m: float) -> None:
        """Drive as commanded; the command is valid for WATCHDOG_NS from the last `step`."""
        self._wanted = 0.0 if speed_mps < 0.0 else speed_mps
        self._curvature = curvature_radpm
        self._room = 0.0 if distance_m < 0.0 else distance_m
        self._turn = 0.0
        self._powered_ns = self.WATCHDOG_NS

    def turn(self, angle_rad: float) -> None:
        """Turn as commanded; a body that still rolls stops first."""
        self.drive(0.0, 0.0, 0.0)
        self._turn = angle_rad

    def stop(self) -> None:
        """Rest at once."""
        self._wanted = self._room = self.speed = self._turn = 0.0

    def step(self, now_ns: int) -> None:
        """Integrate the motion from the last step until now; earlier times are ignored."""
        if self._clock is not None:
            now_ns = self._clock()
        before = now_ns if self._now_ns is None else self._now_ns
        passed = now_ns - before if now_ns > before else 0
        self._now_ns = before + passed
        driven = passed if passed < self._powered_ns else self._powered_ns
        self._powered_ns -= driven
        if not (self._wanted or self.speed or self._turn):
            return
        ordered = self._ramp(driven / 1e9)
        if ordered >= self._room:
            ordered = self._room
            self.speed = 0.0
        if passed > driven:
            self.speed = 0.0
        self._room -= ordered
        if ordered > 0.0:
            self._roll(ordered * self._gain)
        if self._turn and not self.speed:
            most = TURN_RATE * driven / 1e9
            angle = min(max(self._turn, -most), most)
            self._turn -= angle
            self.heading = math.remainder(self.heading + angle, math.tau)

    def _ramp(self, seconds: float) -> float:
        """Change speed towards the commanded one; return the distance [m] travelled meanwhile."""
        speed, end = self.speed, self._wanted
        if speed == end:
            return end * seconds
        change = end - speed
        ramp = abs(change) / self._accel
        if ramp > seconds:
            ramp, end = seconds, speed + math.copysign(seconds * self._accel, change)
        self.speed = end
        return 0.5 * (speed + end) * ramp + end * (seconds - ramp)

    def _roll(self, way: float) -> None:
        """Move along an arc of the commanded curvature."""
        if math.isnan(self.x) or way <= 0.0:
            return
        turn = 0.5 * way * self._curvature
        chord = way if abs(turn) < 1e-9 else way * math.sin(turn) / turn
        self.x += chord * math.cos(self.heading + turn)
        self.y += chord * math.sin(self.heading + turn)
        self.heading = math.remainder(self.heading + 2.0 * turn, math.tau)
