"""A course: what one robot was sent to drive, and the plan times at which it may be driving it.

Decides: from and until when a course counts.  Must not know: why a robot has it, who may drive.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import msgspec
import numpy as np

from coordinator.base.kept import kept
from coordinator.curves.chords import Chords, chords_of
from coordinator.curves.nurbs import Array, Nurbs
from coordinator.plan.wire import Driven, unpack
from protocol.codec import encode

_CHORD_ERROR: Final = 5e-4
"""How far [m] chords may be from a path."""


@dataclass(frozen=True, eq=False)
class Course:
    """A robot's course, driven from plan time `since` at the earliest, until `until` [s].

    One that its robot is known to drive counts from 0 on: the robot stood at its beginning before
    it began.  One whose robot is known to be at its end counts from there on.
    """

    driven: Driven
    since: float
    until: float = math.inf

    def begun(self) -> Course:
        """Return the course of a robot that is known to drive it: it is there, however late."""
        return replace(self, since=0.0)

    def arrived(self, stamp_ms: int | None) -> Course:
        """Return the course of a robot that was at its end at a plan time [ms], and stays there."""
        finish = self.driven.timeline.finish
        if self.has_ended or stamp_ms is None or stamp_ms < 1000.0 * finish:
            return self
        return replace(self, since=finish)

    @property
    def has_ended(self) -> bool:
        """Whether the robot is known to stand at the end."""
        return self.since >= self.driven.timeline.finish

    @staticmethod
    def chords_of(path: Nurbs) -> Chords:
        """Return a path as chords, for zones."""
        return chords_of(path, _CHORD_ERROR)

    @property
    def goal(self) -> tuple[float, float]:
        """The place where the robot rests at the end [m]."""
        x, y = self.driven.curve.points[-1].tolist()
        return x, y


class Boxes:
    """The boxes around the paths of n courses: `low`, `high` (n, 2) [m], and their robots' radii.

    Paths may leave their boxes by `bound` (n,) [m].
    """

    def __init__(self, courses: Sequence[Course]) -> None:
        boxes = np.array([corners(one.driven) for one in courses]).reshape(-1, 2, 2)
        self.low, self.high = boxes[:, 0], boxes[:, 1]
        self.bound = np.array([one.driven.chain.bound for one in courses])
        self.radii = np.array([one.driven.radius for one in courses])

    def apart(self, low: Array, high: Array) -> Array:
        """Return by how much [m] each path and another box are apart at least, along x or y."""
        return np.asarray(np.maximum(self.low - high, low - self.high).max(axis=1) - self.bound)


@kept
def corners(driven: Driven) -> Array:
    """Return the corners of the box around a path's chain, (2, 2) [m]: least and greatest."""
    points = driven.chain.points
    return np.array([points.min(axis=0), points.max(axis=0)])


class PlainCourse(msgspec.Struct, frozen=True):
    """A course as plain data: its message, and its robot's radius [m]."""

    message: bytes
    radius: float
    since: float

    @classmethod
    def of(cls, course: Course) -> PlainCourse:
        """Return a course, which counts for ever, as plain data."""
        return cls(encode(course.driven.plan), course.driven.radius, course.since)

    def course(self) -> Course:
        """Return the course; raise ValueError if a robot would refuse its message."""
        return Course(unpack(self.message, self.radius), self.since)
