"""Finds from a robot's reports where it left its plan for good; used by page, export and info.

Decides three cases.  Usually a robot is assumed to have braked at the constant rate of its plan,
and to have come to rest where it reported.  If that braking would have taken much longer than the
time from its first report of braking to its rest, it is assumed to have stopped at once, at the
time at which its plan has it at that place.  If it was not heard again, it is assumed to stand
still from the time at which it was last heard.  Must not know: logs, pictures.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from protocol.messages import Report
from protocol.phases import BRAKING, DONE, FROZEN, IDLE, MOVING
from protocol.timeline import Timeline
from protocol.timing import SECOND

_HALVINGS: Final = 60

_SUDDEN: Final = 0.5
"""A robot that comes to rest within this share of its braking time was stopped at once."""


class Broken(NamedTuple):
    """The plan time `brake` [s] at which a robot left its plan, and the rate of its braking.

    `rate` is in m/s^2; 0 means that the robot stopped at once.
    """

    brake: float
    rate: float


class Words:
    """What one robot reported in one epoch; times [ns] are on the listener's clock.

    `phase`: its last phase.  `rest`: the arc length [m] where it first reported that it rests.
    `stopping_ns`: since when it has reported that it brakes or rests.  `stopped_ns`: since when it
    has reported that it rests.
    """

    def __init__(self) -> None:
        self.phase = IDLE
        self.rest: float | None = None
        self.last_ns: int | None = None
        self.stopping_ns: int | None = None
        self.stopped_ns: int | None = None

    def take_phase(self, phase: int, now_ns: int) -> bool:
        """Record a phase; return whether the robot has begun to stop."""
        fresh = self.stopping_ns is None and phase in (BRAKING, FROZEN)
        self.phase, self.last_ns = phase, now_ns
        if phase == MOVING:  # it moves again, on new times
            self.stopping_ns = self.stopped_ns = None
        if fresh:
            self.stopping_ns = now_ns
        if phase == FROZEN and self.stopped_ns is None:
            self.stopped_ns = now_ns
        return fresh

    def broken(
        self, line: Timeline, rate: float, start_ns: int, frozen_ns: int | None
    ) -> Broken | None:
        """Return where the robot left its plan; None if it did not.

        rate: its deceleration [m/s^2]; start_ns: the plan's time zero; frozen_ns: when the fleet
        was commanded to stop, None if it was not.
        """
        if self.rest is not None:
            brake = brakes_at(line, self.rest, rate)
            if brake < math.inf and self._was_stopped(line.v_at(brake), rate):
                return Broken(brakes_at(line, self.rest, 0.0), 0.0)
            return Broken(brake, rate) if brake < math.inf else None
        if frozen_ns is None or self.phase == DONE:
            return None
        if self.stopping_ns is not None:
            return Broken(max((self.stopping_ns - start_ns) / SECOND, 0.0), rate)
        last_ns = frozen_ns if self.last_ns is None else min(self.last_ns, frozen_ns)
        return Broken(max((last_ns - start_ns) / SECOND, 0.0), 0.0)

    def _was_stopped(self, speed: float, rate: float) -> bool:
        if self.stopping_ns is None or self.stopped_ns is None:
            return False
        return self.stopped_ns > self.stopping_ns and (
            (self.stopped_ns - self.stopping_ns) / SECOND * rate < _SUDDEN * speed
        )


class Said:
    """What all robots reported, by epoch and robot."""

    def __init__(self) -> None:
        self._words: dict[tuple[int, str], Words] = {}
        self._last_ns: dict[str, int] = {}

    def take(self, report: Report, robot: str, now_ns: int) -> bool:
        """Record a report; return whether the robot began to stop or first stated its rest."""
        self._last_ns[robot] = now_ns
        fresh = self.of(report.epoch, robot).take_phase(report.phase, now_ns)
        if report.rest is None:
            return fresh
        words = self.of(report.rest.epoch, robot)
        fresh = fresh or words.rest is None
        words.rest = report.rest.s_m if words.rest is None else words.rest
        return fresh

    def of(self, epoch: int, robot: str) -> Words:
        """Return what a robot reported in an epoch."""
        return self._words.setdefault((epoch, robot), Words())

    def who(self, epoch: int) -> set[str]:
        """Return the robots that reported in an epoch, which shows that they have its plan."""
        found = {name for number, name in self._words if number == epoch}
        return {name for name in found if self._words[epoch, name].last_ns is not None}

    def last_ns(self, robot: str) -> int | None:
        """Return when a robot was last heard, in any epoch; None if never."""
        return self._last_ns.get(robot)

    def done(self) -> set[str]:
        """Return the robots that have arrived in some epoch."""
        return {robot for (_, robot), words in self._words.items() if words.phase == DONE}


def brakes_at(line: Timeline, s: float, rate: float) -> float:
    """Return when [s] a robot that rests at arc length s [m] began to brake; inf if it did not.

    rate: its deceleration [m/s^2]; 0 means that it stops at once.
    """

    def rests(t: float) -> float:
        return line.s_at(t) + (line.v_at(t) ** 2 / (2.0 * rate) if rate > 0.0 else 0.0)

    low, high = 0.0, line.finish
    if rests(high) <= s:
        return math.inf
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if rests(middle) >= s else (middle, high)
    return high
