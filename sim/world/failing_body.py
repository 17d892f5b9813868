"""A simulated base that fails on demand.

Decides: how slow, stalled and slipping wheels and dead electronics look to a robot's program.  Must
not know: when a fault is due, or who causes it.
"""

from __future__ import annotations

import math
from typing import Final

from robot_agent.driver import DriverError, Pose
from sim.world.body import SimulatedBody

SKID_TIME: Final = 0.2
"""For how long [s] a body slides."""


class FailingBody(SimulatedBody):
    """A SimulatedBody that can be made to slow down, stall, slide or fail altogether."""

    _stalled = _failing = False
    _slide_left = _slide_speed = _slide_heading = 0.0

    def slow(self, share: float) -> None:
        """Roll only this share of the commanded distance from now on."""
        self._gain *= share

    def stall(self, stalled: bool) -> None:
        """Stand still whatever is commanded; if not `stalled`, obey commands again."""
        self._stalled = stalled
        if stalled:
            self.stop()

    def skid(self, metres: float) -> None:
        """Slide `metres` to the body's present left within SKID_TIME, whatever the wheels do."""
        self._slide_left, self._slide_speed = metres, abs(metres) / SKID_TIME
        self._slide_heading = self.heading

    def fail(self) -> None:
        """Make the next call of `pose`, and no later one, raise DriverError."""
        self._failing = True

    def pose(self) -> Pose | None:
        """Return the measured pose; DriverError when a failure is due."""
        if self._failing:
            self._failing = False
            raise DriverError("the base does not answer")
        return SimulatedBody.pose(self)

    def is_at_rest(self) -> bool:
        """Return whether the body stays where it is and works, as long as it is not driven."""
        driven = self._powered_ns and (self._wanted or self._turn)
        moves = self.speed or driven or self._slide_left
        return not (moves or self._failing)

    def turn(self, angle_rad: float) -> None:
        """Turn as commanded, unless stalled."""
        super().turn(0.0 if self._stalled else angle_rad)

    def drive(self, speed_mps: float, curvature_radpm: float, distance_m: float) -> None:
        """Drive as commanded, unless stalled."""
        if self._stalled:
            speed_mps = 0.0
        SimulatedBody.drive(self, speed_mps, curvature_radpm, distance_m)

    def step(self, now_ns: int) -> None:
        """Let time pass, sliding if that is due."""
        before = self._now_ns
        SimulatedBody.step(self, now_ns)
        if self._slide_left:
            passed_ns = 0 if before is None or self._now_ns is None else self._now_ns - before
            way = min(abs(self._slide_left), self._slide_speed * passed_ns / 1e9)
            way = math.copysign(way, self._slide_left)
            self._slide_left -= way
            self.x -= way * math.sin(self._slide_heading)
            self.y += way * math.cos(self._slide_heading)
