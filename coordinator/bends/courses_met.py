"""Which parts of others' courses one robot can meet at all, by where it can be and when.

What others pass before the robot can come near does not matter to it, nor what they come to after
it has arrived.  Courses are kept as samples, and as a few boxes in space and time around these.

Decides: what a search for a course may leave out of the courses of others.  Must not know: paths
and motions that are searched, zones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt
import shapely

from coordinator.base.kept import kept
from coordinator.bends.traffic_kernels import BEGIN, END, Errand, Y, part_met
from coordinator.curves.nurbs import Array
from coordinator.curves.nurbs_kernels import Indices
from coordinator.plan.course import Course, boxes_of
from coordinator.scenario.model import Robot

Flags = npt.NDArray[np.bool_]

STEP: Final = 0.15
"""Distance [m] between the samples of a course."""

_BOXES: Final = 12
"""Around the samples of a course there are at most so many boxes, and one more for its end."""

_X0, _Y0, _X1, _Y1, _SINCE, _UNTIL = range(6)
"""Columns of boxes: where [m], and from when to when [s] the robot is there."""


def errand_of(robot: Robot, leaves: float, latest: float, speed: float) -> Errand:
    """Return what bounds where a robot can be that leaves its start no earlier than `leaves` [s].

    latest [s]: when it has to arrive; speed [m/s].
    """
    start, goal = np.array(robot.start[:2]), np.array(robot.goal[:2])
    return Errand(start, goal, leaves, latest, speed)


class CoursesMet:
    """The courses of others as boxes in space and time; `late`: how late [s] robots may be.

    Paths and meshes keep off places where robots rest for good, if they can, so most courses do not
    count for where they end.
    """

    def __init__(self, courses: Sequence[Course], late: Mapping[str, float]) -> None:
        self.courses = courses
        boxes = [_boxes_along(one) for one in courses]
        self._boxes = np.concatenate([*boxes, np.empty((0, 6))])
        ends = np.cumsum([0, *(len(one) for one in boxes)])
        self._first = ends[:-1]
        self._radius = np.repeat([one.driven.radius for one in courses], np.diff(ends))
        self.delays = [late.get(one.driven.id, 0.0) for one in courses]
        self._boxes[:, _UNTIL] += np.repeat(self.delays, np.diff(ends))
        self._is_way = np.isfinite(self._boxes[:, _UNTIL])

    def met(self, errand: Errand, reach: float, tau: float) -> list[int]:
        """Return the courses that a robot can meet on its errand while these robots are under way.

        It keeps `reach` [m] from the rims of others, and `tau` [s] from their times.
        """
        return self._whose(self._in_time(errand, reach, tau) & self._is_way)

    def met_along(self, points: Array, errand: Errand, reach: float, tau: float) -> list[int]:
        """Return the courses that a robot can meet on its errand on a path (n, 2) [m].

        Those that it can meet only where they end for good count if the path comes near that place.
        """
        counts = self._in_time(errand, reach, tau)
        rows = np.flatnonzero(counts)
        x0, y0, x1, y1 = self._boxes[rows, : _Y1 + 1].T
        u0, v0, u1, v1 = boxes_of(points).T[:, :, None]
        apart_x, apart_y = np.maximum(x0 - u1, u0 - x1), np.maximum(y0 - v1, v0 - y1)
        apart = np.maximum(apart_x, apart_y).min(axis=0)
        need = reach + STEP + self._radius[rows]
        counts[rows] = apart < need
        ends = rows[(apart < need) & ~self._is_way[rows]]
        needs = reach + self._radius[ends]
        line, places = shapely.linestrings(points), shapely.points(self._boxes[ends, : _Y0 + 1])
        counts[ends] = shapely.dwithin(line, places, needs)
        return self._whose(counts)

    def _in_time(self, errand: Errand, reach: float, tau: float) -> Flags:
        """Return which boxes a robot can meet in time."""
        need, boxes = reach + STEP + self._radius, self._boxes
        from_start = np.maximum(self._apart(errand.start) - need, 0.0)
        to_goal = np.maximum(self._apart(errand.goal) - need, 0.0)
        begins = errand.leaves + from_start / errand.speed
        ends = np.where(to_goal > 0.0, errand.latest - to_goal / errand.speed, np.inf)
        in_time = (boxes[:, _UNTIL] + tau >= begins) & (boxes[:, _SINCE] - tau <= ends)
        return np.asarray(in_time)

    def _apart(self, place: Array) -> Array:
        """Return how far [m] the boxes are from a place (2,) [m]."""
        low, high = self._boxes[:, : _Y0 + 1], self._boxes[:, _X1 : _Y1 + 1]
        beyond = np.maximum(np.maximum(low - place, place - high), 0.0)
        return np.asarray(np.hypot(beyond[:, 0], beyond[:, 1]))

    def _whose(self, counts: Flags) -> list[int]:
        if not len(counts):
            return []
        return np.flatnonzero(np.logical_or.reduceat(counts, self._first)).tolist()


def part_of(course: Course, errand: Errand, reach: float, tau: float, delay: float) -> Array:
    """Return the samples of a course that a robot can meet on its errand.

    reach, tau: as in CoursesMet; the other robot is late by up to `delay` [s].
    """
    first, end = _met(course, errand, reach, tau, delay)
    return samples_of(course)[first:end]


def stretch_of(
    course: Course, errand: Errand, reach: float, tau: float, delay: float
) -> tuple[float, float] | None:
    """Return from where to where [m] on its path a robot may meet a course, as `part_of` does."""
    first, end = _met(course, errand, reach, tau, delay)
    if first == end:
        return None
    step = course.driven.curve.length / (len(samples_of(course)) - 2)
    return step * max(first - 1, 0), step * (end - 1)


def _met(course: Course, errand: Errand, reach: float, tau: float, delay: float) -> tuple[int, int]:
    need = reach + course.driven.radius + STEP
    return part_met(samples_of(course), errand, need, tau, delay)


@kept
def samples_of(course: Course) -> Array:
    """Return samples (n, 5) of a course; their columns are X to RADIUS of traffic_kernels."""
    driven = course.driven
    length = driven.curve.length
    borders = np.linspace(0.0, length, max(int(length / STEP), 1) + 1)
    places = np.concatenate(([0.0], 0.5 * (borders[1:] + borders[:-1]), [length]))
    legs, finish = driven.legs, driven.timeline.finish
    _, _, s0, s1, _, _ = legs
    goes = np.searchsorted(s0, borders[:-1], side="right") - 1
    comes = np.minimum(np.searchsorted(s1, borders[1:-1], side="left"), len(s0) - 1)
    left, reached = _time_on(legs, goes, borders[:-1]), _time_on(legs, comes, borders[1:-1])
    begin = np.concatenate(([course.since, left[0]], reached, [finish]))
    end = np.concatenate((left, [finish, course.until]))
    points = driven.curve.at_arc(places)
    return np.column_stack((points, begin, end, np.full(len(places), driven.radius)))


@kept
def _boxes_along(course: Course) -> Array:
    """Return the boxes (k, 6) around the samples of a course."""
    samples = samples_of(course)
    last = len(samples) - 1
    first = np.unique(np.linspace(0, last, min(last, _BOXES), endpoint=False).astype(int))
    first = np.append(first, last)
    low = np.minimum.reduceat(samples, first)
    high = np.maximum.reduceat(samples, first)
    return np.column_stack((low[:, : Y + 1], high[:, : Y + 1], low[:, BEGIN], high[:, END]))


def _time_on(legs: Array, leg: Indices, s: Array) -> Array:
    """Return when [s] arc lengths (n,) [m] are passed on these legs (n,) of a motion."""
    t0, t1, s0, _, v0, v1 = legs[:, leg]
    passed = s - s0
    rate = (v1 - v0) / np.maximum(t1 - t0, 1e-12)
    pace = v0 + np.sqrt(np.maximum(v0 * v0 + 2.0 * rate * passed, 0.0))
    found: Array = np.clip(t0 + 2.0 * passed / np.maximum(pace, 1e-9), t0, t1)
    return found
