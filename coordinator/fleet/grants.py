"""The authority of a fleet's robots, as Commands state it, and who is held by whom.

Decides: how authorities are divided among Commands, when a robot counts as held or stuck.  Must not
know: phases, when a Command is sent.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from coordinator.plan.staircases import NO_STAIRCASES, Staircases
from coordinator.schedule.authority import EVER, Authority
from protocol.messages import MOST_HELD, MOST_ROBOTS, Report
from protocol.phases import DONE
from protocol.timeline import Timeline
from protocol.timing import LATE_STEP_MS

STUCK_MS: Final = 10_000
"""A robot that nobody holds and that has not got on for this long is stuck."""

ROOM: Final = 0.1
"""Tolerance [m]: a robot beyond the end of its authority by no more than this has not passed it."""

_STEPS: Final = 2
"""A robot gets on when its known progress has grown by this many steps of lateness."""

ROOM_MS: Final = 1_000
"""A robot that others let drive on for less than this is near the end of its authority.

It is held if it should have been there already."""


class Stated(NamedTuple):
    """What a Command states: the headroom [ms], who has less, and of which numbers it speaks."""

    headroom_ms: int = 0
    held: tuple[tuple[int, int], ...] = ()
    first: int = 0
    last: int = MOST_ROBOTS


class Held(NamedTuple):
    """A robot that another one holds, and since which plan time [ms]."""

    robot: str
    by: str
    since_ms: int


class Grants:
    """The authorities of the robots of one plan; `robots` in the order of its staircases.

    `headroom_ms`: how far ahead of the plan's time a robot may drive when nobody holds it.  That is
    enough to drive on when Commands are lost, and then to brake.  A robot's number is its place in
    `robots`.  `lines`: the robots' motions.
    """

    def __init__(
        self,
        staircases: Staircases,
        robots: Sequence[str],
        headroom_ms: int,
        lines: Sequence[Timeline] = (),
    ) -> None:
        self.headroom_ms = headroom_ms
        self._rule = Authority(staircases, len(robots))
        self._robots = list(robots)
        self._lines = lines
        self._number = {name: number for number, name in enumerate(robots)}
        self._done = np.zeros(len(robots), bool)
        self._got_on_ms = np.zeros(len(robots), np.int64)
        """When each robot last got on, or could not because it was held."""
        self._passed_ms = np.zeros(len(robots), np.int64)
        """What each robot had passed when it last got on."""
        self._held: dict[int, tuple[int, int]] = {}
        """By number: who holds a robot, and since when [ms]."""

    def hear(self, robot: str, report: Report, now_ms: int) -> bool:
        """Take in how far a robot says that it has driven; return whether it can be there.

        `now_ms`: the plan time at which the report is heard.
        """
        number = self._number.get(robot)
        if number is None:
            return True
        self._done[number] = report.phase == DONE
        if report.phase == DONE:
            self._rule.arrive(number)
        if report.stamp_ms is None or self._rule.progress[number] == EVER:
            return True
        claimed_ms = report.stamp_ms - LATE_STEP_MS * report.late
        self._rule.know(number, claimed_ms)
        passed_ms = int(self._rule.progress[number])
        if passed_ms - self._passed_ms[number] >= _STEPS * LATE_STEP_MS:
            self._passed_ms[number] = passed_ms
            self._got_on_ms[number] = max(now_ms, int(self._got_on_ms[number]))
        return report.late == 0 or self._can_be_at(number, claimed_ms)

    def _can_be_at(self, number: int, claimed_ms: int) -> bool:
        """Return whether a robot can be where its plan has it at a plan time, by what it was told.

        One that waits by its plan is there until the wait ends, which may be long after that.
        """
        told_ms = int(self._rule.told[number])
        if claimed_ms <= told_ms + ROOM_MS or not self._lines:
            return claimed_ms <= told_ms + ROOM_MS
        line = self._lines[number]
        return line.s_at(claimed_ms / 1000.0) <= line.s_at(told_ms / 1000.0) + ROOM

    def grant(self, now_ms: int, most_ms: int) -> list[Stated]:
        """Grant what is safe at a plan time [ms], at most up to `most_ms`.

        Return what the Commands state of it; there are several if more robots have less than the
        headroom than one Command can name.
        """
        rule = self._rule
        rule.grant(now_ms, self.headroom_ms, most_ms)
        self._note_held(now_ms, most_ms)
        most = min(now_ms + self.headroom_ms, most_ms)
        less = np.flatnonzero((rule.granted < most) & ~self._done).tolist()
        named = [(k, int(rule.granted[k])) for k in less]
        parts = [named[k : k + MOST_HELD] for k in range(0, max(len(named), 1), MOST_HELD)]
        ends = [-1, *(part[-1][0] for part in parts[:-1]), MOST_ROBOTS]
        return [
            Stated(most - now_ms, tuple(part), begin + 1, end)
            for part, (begin, end) in zip(parts, pairwise(ends), strict=True)
        ]

    def _note_held(self, now_ms: int, most_ms: int) -> None:
        rule = self._rule
        wanted = np.minimum(rule.wanted(now_ms, self.headroom_ms), most_ms)
        is_near = (rule.granted < wanted) & (rule.granted - rule.progress < ROOM_MS) & ~self._done
        self._got_on_ms[is_near] = now_ms
        is_held = is_near & (rule.granted < now_ms)
        before, self._held = self._held, {}
        for number in np.flatnonzero(is_held).tolist():
            by = rule.holder_of(number)
            if by is not None:
                _, since = before.get(number, (by, now_ms))
                self._held[number] = by, since

    def held(self) -> list[Held]:
        """Return the robots that others hold."""
        names = self._robots
        return [Held(names[k], names[by], since) for k, (by, since) in self._held.items()]

    def behind(self, stopped: Collection[str]) -> list[str]:
        """Return the robots that are held by these robots, or by others that these hold."""
        found = {self._number[name] for name in stopped if name in self._number}
        own = set(found)
        while more := {k for k, (by, _) in self._held.items() if by in found} - found:
            found |= more
        return [self._robots[k] for k in sorted(found - own)]

    def stuck(self, now_ms: int) -> list[str]:
        """Return the robots that have not got on for STUCK_MS although nobody holds them."""
        late = (now_ms - self._got_on_ms > STUCK_MS) & ~self._done
        return [self._robots[k] for k in np.flatnonzero(late)]

    def excuse(self, lost_ms: int) -> None:
        """Take in that for so long [ms] robots could not get on, or could not be heard."""
        self._got_on_ms += lost_ms

    def lose_sight(self, until_ms: int) -> None:
        """Take in that robots may have been told more, up to a plan time, than is known."""
        self._rule.may_have_told(until_ms)

    def bounds(self, robot: str) -> tuple[float, float]:
        """Return the plan times [s] between which a robot is: known to have passed, told."""
        if robot not in self._number:
            return 0.0, 0.0
        number = self._number[robot]
        return int(self._rule.progress[number]) / 1000.0, int(self._rule.told[number]) / 1000.0


NOBODY: Final = Grants(NO_STAIRCASES, (), 0)
"""The grants of an epoch in which no robot drives."""
