"""How far each robot is known to have driven, and how far it may drive, on each of its courses.

A robot's progress on a course is the plan time that has it where it is; its authority is the plan
time that it does not pass.  Authorities are granted such that no robot comes to where another one
may still be, however late robots or messages are (design section 3).

Decides: what is known of progress, and which authorities follow.  Must not know: messages, phases.
"""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np

from coordinator.plan.staircases import Staircases
from coordinator.schedule.authority_kernels import Integers, Table, breaks, grant, holder

EVER: Final = 2**40
"""The progress [ms] of a robot that is at its goal: it has passed all plan times."""

SLACK_MS: Final = 2_000
"""A robot is granted no more than this beyond its known progress, apart from the headroom: one that
is late or silent is told little ahead of what it is known to have driven."""


_ARRAYS: Final = ("progress", "granted", "told", "barred", "most")


class PlainAuthority(msgspec.Struct, frozen=True):
    """Progress and authority as plain data: the bytes of the arrays."""

    progress: bytes
    granted: bytes
    told: bytes
    barred: bytes
    most: bytes


class Authority:
    """Progress and authority on the courses of one plan, in ms of plan time; both only grow.

    `told`: the most that a robot may have been told.  It is what is granted, unless another
    coordinator granted more before.  `barred`: courses on which nothing more is granted; `most`:
    no more than this is ever granted.  `leads`: for a course that runs along another one of its
    robot for a while, that one, and -1 for others: it is granted no more than that one.  Courses
    are numbered as in the staircases.
    """

    def __init__(self, staircases: Staircases, courses: int) -> None:
        self._table = _table_of(staircases, courses)
        self.progress: Integers = np.zeros(courses, np.int64)
        self.granted: Integers = np.zeros(courses, np.int64)
        self.told: Integers = np.zeros(courses, np.int64)
        self.barred = np.zeros(courses, bool)
        self.most: Integers = np.full(courses, EVER, np.int64)
        self.leads: Integers = np.full(courses, -1, np.int64)

    def plain(self) -> PlainAuthority:
        """Return progress and authority as plain data, without the staircases."""
        return PlainAuthority(*(getattr(self, name).tobytes() for name in _ARRAYS))

    @classmethod
    def of_plain(cls, staircases: Staircases, told: PlainAuthority) -> Authority:
        """Return progress and authority under these staircases."""
        made = cls(staircases, len(told.progress) // np.dtype(np.int64).itemsize)
        for name in _ARRAYS:
            kind = getattr(made, name).dtype
            setattr(made, name, np.frombuffer(getattr(told, name), kind).copy())
        return made

    def follow(self, course: int, leads: int, until_ms: int) -> None:
        """Grant on a course no more than on another one of its robot, and nothing beyond a time."""
        self.barred[course], self.most[course], self.leads[course] = False, until_ms, leads

    def part(self, course: int) -> None:
        """Grant on a course by itself, whatever is granted on another one of its robot."""
        self.barred[course], self.most[course], self.leads[course] = False, EVER, -1

    def grow(self, courses: int) -> None:
        """Make room for more courses, on which nothing is granted."""
        self.progress, self.granted, self.told = (
            np.append(one, np.zeros(courses, np.int64))
            for one in (self.progress, self.granted, self.told)
        )
        self.barred = np.append(self.barred, np.ones(courses, bool))
        self.most = np.append(self.most, np.full(courses, EVER))
        self.leads = np.append(self.leads, np.full(courses, -1))

    def allows(self, staircases: Staircases) -> bool:
        """Return whether what was told already is within these staircases."""
        return not breaks(_table_of(staircases, len(self.told)), self.progress, self.told)

    def renew(self, staircases: Staircases) -> None:
        """Grant by other staircases from now on."""
        self._table = _table_of(staircases, len(self.told))

    def know(self, course: int, progress_ms: int) -> None:
        """Take in that a course was driven up to a plan time; never more than was told."""
        self.reach(course, min(progress_ms, int(self.told[course])))

    def reach(self, course: int, progress_ms: int) -> None:
        """Take in that a course was driven up to a plan time, whatever was told."""
        self.progress[course] = max(int(self.progress[course]), progress_ms)

    def arrive(self, course: int) -> None:
        """Take in that a robot is at the end of a course, where it stays."""
        self.progress[course] = self.told[course] = EVER

    def open(self, course: int, progress_ms: int, told_ms: int) -> None:
        """Begin a new course, on which nothing is granted as long as it is barred.

        Its robot may be on it up to `told_ms` without being told anything of it: at its beginning,
        or as far as it was told to drive on a course that is the same there.
        """
        self.progress[course], self.told[course] = progress_ms, told_ms
        self.granted[course] = 0
        self.barred[course], self.most[course], self.leads[course] = True, EVER, -1

    def wanted(self, now_ms: int, headroom_ms: int) -> Integers:
        """Return how far (n,) [ms] robots would be let at a plan time if nobody were in the way."""
        return np.minimum(self.unlimited(now_ms, headroom_ms), self.most)

    def unlimited(self, now_ms: int, headroom_ms: int) -> Integers:
        """Return the same without the courses' own limits."""
        wanted: Integers = np.minimum(now_ms, self.progress + SLACK_MS) + headroom_ms
        return np.where(self.barred, 0, wanted)

    def grant(self, now_ms: int, headroom_ms: int, most_ms: int) -> None:
        """Grant what is safe, up to the headroom beyond a plan time, and at most `most_ms`."""
        wanted = np.minimum(self.wanted(now_ms, headroom_ms), most_ms)
        before = self.granted.copy()
        grant(self._table, self.progress, wanted, self.granted)
        led = np.flatnonzero(self.leads >= 0)
        most = np.minimum(self.granted[led], self.granted[self.leads[led]])
        self.granted[led] = np.maximum(most, before[led])
        np.maximum(self.told, self.granted, out=self.told)

    def holder_of(self, course: int, staircases: Staircases | None = None) -> int | None:
        """Return the course that leaves a course the least authority; None if nobody limits it.

        `staircases`: those that count, by default those by which authority is granted.
        """
        table = self._table if staircases is None else _table_of(staircases, len(self.told))
        found = int(holder(table, self.progress, course))
        return None if found < 0 else found

    def may_have_told(self, courses: Integers, until_ms: int) -> None:
        """Take in that courses may have been let be driven up to a plan time."""
        self.told[courses] = np.maximum(self.told[courses], until_ms)


def _table_of(staircases: Staircases, courses: int) -> Table:
    return Table(
        staircases.tau_ms,
        np.searchsorted(staircases.behind, np.arange(courses + 1)),
        staircases.ahead,
        staircases.first,
        staircases.at,
        staircases.need,
        staircases.first[:-1].copy(),
    )
