"""A course: what one robot was sent to drive, and the plan times at which it may be driving it.

Decides: from and until when a course counts.  Must not know: why a robot has it, who may drive.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
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


_MOST_BOXES: Final = 12
"""Around a path there are at most so many boxes."""


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

    @cached_property
    def goal(self) -> tuple[float, float]:
        """The place where the robot rests at the end [m]."""
        x, y = self.driven.curve.points[-1].tolist()
        return x, y


class Boxes:
    """The boxes around the stretches of the paths of n courses, and their robots' `radii` (n,) [m].

    A long path has several, as its one box would cover places to which it never comes near.
    """

    def __init__(self, courses: Sequence[Course]) -> None:
        boxes = [_boxes_along(one.driven) for one in courses]
        self._boxes = np.concatenate([*boxes, np.empty((0, 4))])
        self._first = np.cumsum([0, *(len(one) for one in boxes)])[:-1]
        self._bound = np.array([one.driven.chain.bound for one in courses])
        self.radii = np.array([one.driven.radius for one in courses])

    def apart(self, points: Array) -> Array:
        """Return by how much [m] each path and a polyline (m, 2) are apart at least (n,)."""
        if not len(self.radii):
            return np.zeros(0)
        x0, y0, x1, y1 = self._boxes.T
        u0, v0, u1, v1 = boxes_of(points).T[:, :, None]
        along_x, along_y = np.maximum(x0 - u1, u0 - x1), np.maximum(y0 - v1, v0 - y1)
        nearest = np.maximum(along_x, along_y).min(axis=0)
        return np.asarray(np.minimum.reduceat(nearest, self._first) - self._bound)


@kept
def _boxes_along(driven: Driven) -> Array:
    """Return the boxes (k, 4) [m] around stretches of a path's chain, as `boxes_of` does."""
    return boxes_of(driven.chain.points)


def boxes_of(points: Array) -> Array:
    """Return x0, y0, x1, y1 (k, 4) [m] of the boxes around stretches of a polyline (n, 2)."""
    last = len(points) - 1
    ends = np.linspace(0, last, min(last, _MOST_BOXES) + 1).astype(int)
    low, high = (one.reduceat(points[:-1], ends[:-1]) for one in (np.minimum, np.maximum))
    low, high = np.minimum(low, points[ends[1:]]), np.maximum(high, points[ends[1:]])
    return np.column_stack((low, high))


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
