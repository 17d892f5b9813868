"""The courses that one robot was sent: the one in force, and the one that it has not begun.

Decides: which of them count.  Must not know: authority, other robots, messages.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import msgspec

from coordinator.plan.course import Course, PlainCourse


class Span(NamedTuple):
    """A part of a robot's course, by its revision and plan times [ms]."""

    revision: int
    since_ms: int
    until_ms: int


@dataclass
class Sent:
    """A course that a robot was sent: its revision, its number in Commands, its place in tables.

    `course` is None where nobody asked for it.
    """

    slot: int
    number: int
    revision: int = 0
    begin_ms: int = 0
    course: Course | None = None
    is_withdrawn: bool = False
    """Whether nothing is ever granted on it, because its robot was given up before it began it."""

    shared_ms: int = 0
    """Until when it is the course before it; where it begins at rest, that is its beginning."""

    @property
    def is_from_rest(self) -> bool:
        """Whether it begins at rest."""
        return self.shared_ms <= self.begin_ms


@dataclass
class Courses:
    """A robot's course in force, and the one that it was sent and has not begun.

    `slots`: the two places in tables that its courses take in turn.  `replaced`: withdrawn courses
    from where the robot rests, in place of which it was sent `next`: it may begin one of them yet.
    """

    now: Sent
    next: Sent | None = None
    slots: tuple[int, int] = (0, 0)
    replaced: list[Sent] = field(default_factory=list)

    @property
    def free_slot(self) -> int:
        """The slot that the course in force does not take."""
        first, second = self.slots
        return second if self.now.slot == first else first

    def __iter__(self) -> Iterator[Sent]:
        """Iterate over the courses that the robot may be driving."""
        yield self.now
        if self.next is not None:
            yield self.next

    @property
    def newest(self) -> Sent:
        """The newest course."""
        return self.now if self.next is None else self.next

    def begins_at_rest(self, now_ms: int) -> bool:
        """Return whether the robot may begin its next course [ms], from where it comes to rest."""
        coming = self.next
        if coming is None or coming.is_withdrawn:
            return False
        return coming.is_from_rest and coming.begin_ms < now_ms

    def is_changing(self, holds: int) -> bool:
        """Return whether a robot that holds this revision has yet to begin its next course.

        One that was withdrawn before the robot held it does not count.
        """
        coming = self.next
        return coming is not None and (not coming.is_withdrawn or holds >= coming.revision)


class PlainSent(msgspec.Struct, frozen=True):
    """A `Sent` as plain data."""

    slot: int
    number: int
    revision: int
    begin_ms: int
    course: PlainCourse | None
    is_withdrawn: bool
    shared_ms: int = 0

    @classmethod
    def of(cls, sent: Sent) -> PlainSent:
        """Return what was sent as plain data."""
        course = None if sent.course is None else PlainCourse.of(sent.course)
        return cls(
            sent.slot,
            sent.number,
            sent.revision,
            sent.begin_ms,
            course,
            sent.is_withdrawn,
            sent.shared_ms,
        )

    def sent(self) -> Sent:
        """Return what was sent; raise ValueError if a robot would refuse its message."""
        course = None if self.course is None else self.course.course()
        return Sent(
            self.slot,
            self.number,
            self.revision,
            self.begin_ms,
            course,
            self.is_withdrawn,
            self.shared_ms,
        )
