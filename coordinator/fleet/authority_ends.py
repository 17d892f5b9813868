"""Where the authorities of a fleet's robots end on their courses in force, and what bounds them.

A closed place bounds what a robot may be granted until it is open again, a halt until the robot may
go on, and for a robot that others go around it ends for ever.

Decides: up to where a robot may ever be granted, where it comes to rest with what it was told.
Must not know: Commands, how authority is divided.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from coordinator.fleet.sent_courses import Courses
from coordinator.fleet.standstills import Standstills
from coordinator.schedule.authority import EVER, Authority
from protocol.timing import LATE_STEP_MS

ROOM: Final = 0.1
"""Tolerance [m]: a robot beyond the end of its authority by no more than this has not passed it."""

_STANDS: Final = 0.02
"""A robot no farther than this [m] from where its authority ends, as far as is known, stands there.
"""


class AuthorityEnds:
    """The ends of the authorities of robots that have these courses, by the rule that grants them.

    limits: how far [ms] robots may drive, because of a closed place; halts: where [ms] they come to
    rest, if they were halted there; given_up: those that are granted nothing more, for ever.
    """

    def __init__(
        self, rule: Authority, courses: Mapping[str, Courses], standstills: Standstills
    ) -> None:
        self._rule, self._courses, self._standstills = rule, courses, standstills
        self.limits: dict[str, int] = {}
        self.halts: dict[str, int] = {}
        self.given_up: set[str] = set()

    def take_over(self, limits: dict[str, int], halts: dict[str, int], given_up: set[str]) -> None:
        """Take over what a checkpoint states."""
        self.limits, self.halts, self.given_up = limits, halts, given_up
        for name in given_up - halts.keys():  # Of logs that do not state it.
            halts[name] = int(self._rule.most[self._courses[name].now.slot])

    def give_up(self, robot: str) -> None:
        """Grant nothing more on a robot's course, for ever."""
        self.halts[robot] = int(self._rule.granted[self._courses[robot].now.slot])
        self._bound(robot)
        self.given_up.add(robot)

    def forget(self, robot: str) -> None:
        """Take in that a robot has begun another course, or has left."""
        self.limits.pop(robot, None)
        self.halts.pop(robot, None)
        self.given_up.discard(robot)

    def limit(self, robot: str, most_ms: int) -> None:
        """Grant a robot never more than this on the course in force, and less if it was halted."""
        self.limits[robot] = most_ms
        self._bound(robot)

    def limit_of(self, robot: str) -> int:
        """Return how far a robot may ever drive on the course in force [ms]."""
        return self.limits.get(robot, EVER)

    def _bound(self, robot: str) -> None:
        """Grant on a robot's course in force up to its limit, and to where it was halted."""
        most_ms = min(self.limit_of(robot), self.halts.get(robot, EVER))
        self._rule.most[self._courses[robot].now.slot] = most_ms

    def halt(self, robot: str, at_ms: int = 0) -> int:
        """Grant a robot nothing more on its course; return where it then comes to rest [ms].

        It is granted as much as `at_ms` if that is more, unless it was given up.
        """
        end_ms = self._end_ms(robot)
        if robot not in self.given_up:
            end_ms = max(end_ms, at_ms)
            self.halts[robot] = end_ms
            self._bound(robot)
        return end_ms

    def go_on(self, robot: str) -> None:
        """Grant again on a robot's course what is safe, unless it was given up or has left."""
        if robot in self._courses and robot not in self.given_up:
            self.halts.pop(robot, None)
            self._bound(robot)

    def told_ms(self, robot: str) -> int:
        """Return how far [ms] a robot may have been told to drive on the course in force."""
        sent = self._courses[robot].now
        return max(int(self._rule.told[sent.slot]), sent.begin_ms)

    def _known_ms(self, robot: str) -> int:
        """Return how far [ms] a robot is known to have been told to drive."""
        sent = self._courses[robot].now
        return max(int(self._rule.granted[sent.slot]), sent.begin_ms)

    def _end_ms(self, robot: str) -> int:
        """Return where [ms] a robot comes to rest on the course in force with what it was told.

        After a log was gone on from, more may have been told than is known.  A robot that stands
        where that ends was not, as it seems, and one that is held for long stands where it is.  If
        it was told more, it takes no course that begins there.
        """
        told_ms, known_ms = self.told_ms(robot), self._known_ms(robot)
        sent = self._courses[robot].now
        if sent.course is None or known_ms >= told_ms:
            return told_ms
        line, passed_ms = sent.course.driven.timeline, int(self._rule.progress[sent.slot])
        reported_ms = (passed_ms, known_ms, passed_ms + LATE_STEP_MS)  # It may have passed more.
        least, end, most = (line.s_at(ms / 1000.0) for ms in reported_ms)
        stands = sent.slot in self._standstills.for_long
        stands |= least - _STANDS <= end <= most + _STANDS
        return min(max(known_ms, passed_ms), told_ms) if stands else told_ms

    def may_have_more(self, robot: str) -> bool:
        """Return whether a robot stands where its authority seems to end, and may have more."""
        return self._end_ms(robot) < self.told_ms(robot)

    def is_end_known(self, robot: str) -> bool:
        """Return whether it is known where a robot's authority ends, or seems to be.

        A robot that has passed all that it may have been told has no more.
        """
        passed_ms = int(self._rule.progress[self._courses[robot].now.slot])
        is_exact = max(self._known_ms(robot), passed_ms) >= self.told_ms(robot)
        return is_exact or self.may_have_more(robot)

    def is_at_end(self, robot: str) -> bool:
        """Return whether a robot is known to be where its authority ends, or near it."""
        sent = self._courses[robot].now
        if sent.course is None:
            return False
        line, passed_ms = sent.course.driven.timeline, int(self._rule.progress[sent.slot])
        return line.s_at(passed_ms / 1000.0) >= line.s_at(self._end_ms(robot) / 1000.0) - ROOM
