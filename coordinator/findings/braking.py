"""Finds from a robot's reports how it drove its plan; used by page, export and info.

Decides where a robot left its plan for good, in three cases.  Usually a robot is assumed to have
braked at the constant rate of its plan, and to have come to rest where it reported.  If that
braking would have taken much longer than the time from its first report of braking to its rest, it
is assumed to have stopped at once, at the time at which its plan has it at that place.  If it was
not heard again, it is assumed to stand still from the time at which it was last heard.  Must not
know: logs, pictures.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from coordinator.findings.progress import Knot, Progress
from protocol.messages import Command, Report
from protocol.phases import BRAKING, DONE, FROZEN, IDLE, MOVING
from protocol.timeline import Timeline
from protocol.timing import LATE_STEP_MS, MILLISECOND, SECOND

_HALVINGS: Final = 60

SILENT: Final = SECOND
"""A robot on its way that was not heard for this long [ns] is shown at rest."""

_SOON: Final = 0.3
"""A robot reports so soon [s] that it has begun a course."""

_SUDDEN: Final = 0.5
"""A robot that comes to rest within this share of its braking time was stopped at once."""


class Driving(NamedTuple):
    """How a robot drove its plan: its progress, and from which plan time on it braked to rest.

    `brake` is in s, infinite for a robot that did not leave its plan.  `rate` is the rate of its
    braking in m/s^2; 0 means that the robot stopped at once.
    """

    progress: Progress
    brake: float = math.inf
    rate: float = 0.0


class Words:
    """What one robot reported of one course; times [ns] are on the listener's clock.

    `phase`: its last phase.  `rest`: the arc length [m] where it first reported that it rests.
    `stopping_ns`: since when it has reported that it brakes or rests.  `stopped_ns`: since when it
    has reported that it rests.  `progress`: how far in its plan it has come.  `first`: the
    time of the plan, and the plan time that it had passed [s], of its first report that states one.
    """

    def __init__(self) -> None:
        self.phase = IDLE
        self.rest: float | None = None
        self.last_ns: int | None = None
        self.stopping_ns: int | None = None
        self.stopped_ns: int | None = None
        self.progress = Progress()
        self.first: Knot | None = None

    def take(self, report: Report, now_ns: int, paused: float = 0.0, granted: float = 0.0) -> bool:
        """Record phase and progress; return whether the robot has begun to stop, or to move again.

        `paused`: for how long [s] the plan's time had stood when the robot made the report.
        `granted`: the plan time [s] up to which it might drive when that stood last.  A robot that
        drove on unheard may be there, and waits for the plan's time: it does not report how early
        it is.
        """
        phase = report.phase
        if report.stamp_ms is not None:
            t, late = report.stamp_ms / 1000.0, report.late * LATE_STEP_MS / 1000.0
            self.progress.take(t + paused, late + paused, 0.0 if report.late else granted)
            self.first = self.first or (t + paused, t - late)
        again = phase == MOVING and self.stopping_ns is not None
        fresh = self.stopping_ns is None and phase in (BRAKING, FROZEN)
        self.phase, self.last_ns = phase, now_ns
        if phase == MOVING:  # it moves again, on new times
            self.stopping_ns = self.stopped_ns = self.rest = None
        if fresh:
            self.stopping_ns = now_ns
        if phase == FROZEN and self.stopped_ns is None:
            self.stopped_ns = now_ns
        return fresh or again

    def driving(self, line: Timeline, rate: float, start_ns: int, frozen_ns: int | None) -> Driving:
        """Return how the robot drove its plan, and where it left it.

        rate: its deceleration [m/s^2]; start_ns: the plan's time zero; frozen_ns: when the fleet
        was commanded to stop, None if it was not.
        """
        progress = self.progress

        def passed_at(at_ns: int) -> float:
            return float(progress.at(np.array([max((at_ns - start_ns) / SECOND, 0.0)]))[0])

        if self.rest is not None:
            brake = brakes_at(line, self.rest, rate)
            if brake == math.inf:
                return Driving(progress)
            passed = brakes_at(line, self.rest, 0.0)
            if progress.is_late and self.stopped_ns is not None:
                rests = (self.stopped_ns - start_ns) / SECOND
                return Driving(progress.stops(rests, passed), passed)
            if self._was_stopped(line.v_at(brake), rate):
                return Driving(progress, passed)
            return Driving(progress, brake, rate)
        if frozen_ns is None or self.phase == DONE:
            return Driving(progress)
        if self.stopping_ns is not None:
            return Driving(progress, passed_at(self.stopping_ns), rate)
        last_ns = frozen_ns if self.last_ns is None else min(self.last_ns, frozen_ns)
        return Driving(progress, passed_at(last_ns))

    def since(self, line: Timeline, begin: float) -> float | None:
        """Return since when [s] the robot drives a further course; None if it does not.

        A robot that had left the course's beginning when it was heard first is taken to have begun
        on time.
        """
        if self.last_ns is None:
            return None
        if self.first is None or self.first[1] > max(begin, line.t0[0]) + _SOON:
            return begin
        return max(self.first[0], begin)

    def silent_since(self, now_ns: int) -> int | None:
        """Return when a robot on its way was last heard, if that is too long ago; else None."""
        drives = self.phase in (MOVING, BRAKING)
        silent = drives and self.last_ns is not None and now_ns - self.last_ns > SILENT
        return self.last_ns if silent else None

    def _was_stopped(self, speed: float, rate: float) -> bool:
        if self.stopping_ns is None or self.stopped_ns is None:
            return False
        return self.stopped_ns > self.stopping_ns and (
            (self.stopped_ns - self.stopping_ns) / SECOND * rate < _SUDDEN * speed
        )


class Said:
    """What all robots reported, by epoch, robot, and the revision of the course that it drove."""

    def __init__(self) -> None:
        self._words: dict[tuple[int, str, int], Words] = {}
        self._newest: dict[tuple[int, str], int] = {}
        """By epoch and robot: the newest course that it drove."""

        self._last_ns: dict[str, int] = {}
        self._starts: dict[int, list[tuple[int, float]]] = {}
        """By epoch: the times zero, and the plan time up to which robots might drive before."""

        self._granted: dict[int, float] = {}

    def begin(self, command: Command, lag_ns: int = 0) -> None:
        """Record the time zero that a GO states; it is put off while plan time stands.

        `lag_ns`: how much later the listener's clock is than the coordinator's.
        """
        epoch, start_ns = command.epoch, command.start_ns + lag_ns
        starts, granted = self._starts.setdefault(epoch, []), self._granted.get(epoch, 0.0)
        if not starts or start_ns != starts[-1][0]:
            starts.append((start_ns, granted))
        now_ms = (command.said_ns - command.start_ns) // MILLISECOND
        self._granted[epoch] = max(granted, (now_ms + command.headroom_ms) / 1000.0)

    def take(self, report: Report, robot: str, now_ns: int) -> bool:
        """Record a report; return whether the robot drives, or stands, otherwise than before."""
        self._last_ns[robot] = now_ns
        newest = self._newest.get((report.epoch, robot), -1)
        self._newest[report.epoch, robot] = max(newest, report.revision)
        driving = self.of(report.epoch, robot, report.revision)
        fresh = driving.take(report, now_ns, *self._paused(report, now_ns))
        fresh |= report.revision > max(newest, 0)
        if report.rest is None:
            return fresh
        words = self.of(report.rest.epoch, robot, report.rest.revision)
        fresh = fresh or words.rest is None
        words.rest = report.rest.s_m if words.rest is None else words.rest
        return fresh

    def _paused(self, report: Report, now_ns: int) -> tuple[float, float]:
        """Return for how long [s] plan time had stood, and what was granted until it did.

        It is told by the start that a robot's stamp fits best: a robot states the time by the
        newest start that it has heard.
        """
        starts = self._starts.get(report.epoch, [])
        if len(starts) < 2 or report.stamp_ms is None:
            return 0.0, 0.0
        made_ns = now_ns - report.stamp_ms * MILLISECOND
        start_ns, granted = min(starts, key=lambda start: abs(made_ns - start[0]))
        return (start_ns - starts[0][0]) / SECOND, granted

    def of(self, epoch: int, robot: str, revision: int = 0) -> Words:
        """Return what a robot reported of one of its courses, by default of an epoch's first."""
        return self._words.setdefault((epoch, robot, revision), Words())

    def who(self, epoch: int) -> set[str]:
        """Return the robots that reported in an epoch, which shows that they have its plan."""
        return {name for number, name in self._newest if number == epoch}

    def silent(self, epoch: int, now_ns: int) -> frozenset[str]:
        """Return the robots on their way in an epoch that have not been heard for too long."""
        names = self.who(epoch)
        return frozenset(n for n in names if self.newest(epoch, n).silent_since(now_ns) is not None)

    def revision(self, epoch: int, robot: str) -> int:
        """Return the newest course that a robot drove in an epoch."""
        return self._newest.get((epoch, robot), 0)

    def newest(self, epoch: int, robot: str) -> Words:
        """Return what a robot reported of the newest course that it drove in an epoch."""
        return self.of(epoch, robot, self.revision(epoch, robot))

    def late(self, epoch: int) -> dict[str, tuple[int, list[Knot]]]:
        """Return the course of each robot in an epoch that is late on it, or was.

        With its revision, the last two knots of the robot's progress.
        """
        newest = {name: self.revision(epoch, name) for name in self.who(epoch)}
        knots = {name: self.of(epoch, name, one).progress.knots for name, one in newest.items()}
        return {name: (newest[name], found[-2:]) for name, found in knots.items() if found}

    def forget(self, epoch: int, robot: str, revision: int) -> None:
        """Forget what a robot reported of its courses before this one."""
        for key in [one for one in self._words if one[:2] == (epoch, robot) and one[2] < revision]:
            del self._words[key]

    def last_ns(self, robot: str) -> int | None:
        """Return when a robot was last heard, in any epoch; None if never."""
        return self._last_ns.get(robot)

    def done(self) -> set[str]:
        """Return the robots that were at the goal of their newest course when last heard."""
        last = {robot: epoch for epoch, robot in sorted(self._newest)}
        return {robot for robot, epoch in last.items() if self.newest(epoch, robot).phase == DONE}


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
