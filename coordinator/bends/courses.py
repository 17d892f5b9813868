"""A robot's course along a way in space and time: its curve, its speeds, and samples of both.

Decides: how the vertices and times of a way become a path and a motion.  Must not know: other
robots, how ways are searched.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from coordinator.base.errors import PlanError
from coordinator.base.kept import kept
from coordinator.curves.nurbs import Array, Nurbs
from coordinator.ground.free_space import Space
from coordinator.motion.slowing import Slow, slowed
from coordinator.motion.velocity_profile import Motion, Wait
from coordinator.paths.path_planner import Pathfinder
from coordinator.paths.smoothing import smooth
from coordinator.scenario.model import Robot
from coordinator.schedule.track import Track

_STEP: Final = 0.15
"""Distance [m] between a robot's samples."""

_FULL: Final = 0.999
"""Legs at this share of the planned speed or more are driven at full speed."""

_SOON: Final = 1e-6

TrackOf = Callable[[int, Nurbs], Track]
"""Returns the track of a robot, by its number, on a path."""


@dataclass(frozen=True, eq=False)
class Course:
    """A robot's path with its track, its motion, and samples (n, 5) of that."""

    path: Nurbs
    track: Track
    motion: Motion
    samples: Array


class Road(NamedTuple):
    """A path with its track."""

    path: Nurbs
    track: Track


class CourseMaker:
    """Makes the courses of a fleet."""

    def __init__(self, finder: Pathfinder, track_of: TrackOf) -> None:
        self._finder, self._track_of = finder, track_of
        self._robots = finder.scenario.robots
        self._ramps: dict[int, float] = {}

    def speed(self, index: int) -> float:
        """Return a robot's planned speed [m/s]."""
        return self._finder.scenario.planned_speed(self._robots[index])

    def ramp(self, index: int) -> float:
        """Return the time [s] that speeding up from rest costs a robot, and so does braking."""
        return self._ramps[index]

    def shortest(self, index: int, path: Nurbs, track: Track) -> Course:
        """Return the course along a robot's shortest way, without a wait."""
        self._ramps[index] = 0.5 * self.speed(index) / track.limits.ramp
        return self._timed(index, path, track, [], [])

    def later(self, index: int, course: Course, delay: float) -> Course:
        """Return a course on which all comes later by `delay` [s], with a wait at the start."""
        motion = course.motion
        waits = [replace(wait, depart=wait.depart + delay) for wait in motion.waits]
        if not waits or waits[0].s > 0.0:
            waits.insert(0, Wait(0.0, delay, -1))
        return self._moving(index, course.path, course.track, Motion(motion.limits, waits))

    def road(self, index: int, space: Space, way: Array) -> Road | None:
        """Return a robot's road along a polygon (n, 2) [m]; None if no curve is clear."""
        path = self._curve(index, space, way)
        return None if path is None else Road(path, self._track_of(index, path))

    def paced(self, index: int, road: Road, paces: Array) -> Course:
        """Return the course along a road from time 0 on; `paces` [m/s] bound equal parts of it."""
        borders = np.linspace(0.0, road.path.length, len(paces) + 1).tolist()
        slow = [
            Slow(begin, end, pace)
            for (begin, end), pace in zip(pairwise(borders), paces.tolist(), strict=True)
            if pace < _FULL * self.speed(index)
        ]
        return self._timed(index, road.path, road.track, [], slow)

    def along(self, index: int, space: Space, way: Array, times: Array) -> Iterator[Course]:
        """Yield courses along a polygon (n, 2) [m] in a space, its times (n, 2) [s] given.

        times: when the robot comes and when it goes, at speeds that change at once.  If it rests on
        the way, the first course has it come later, slowly, and go on without a rest.  There are
        none without a clear curve.
        """
        road = self.road(index, space, way)
        if road is None:
            return
        path, track = road
        legs = np.hypot(*np.diff(way, axis=0).T)
        along = np.append(0.0, np.cumsum(legs))
        along *= path.length / along[-1]
        rests = times[:, 1] > times[:, 0] + _SOON
        rests[0] = False
        leaves = float(times[0, 1]) - self.ramp(index)
        start = [Wait(0.0, leaves, -1)] if leaves > _SOON else []
        if rests.any():
            through = times.copy()
            through[rests, 0] = through[rests, 1]
            yield self._timed(index, path, track, start, self._slow(index, along, legs, through))
        waits = [
            Wait(float(along[k]), float(times[k, 1]) - self.ramp(index), -1)
            for k in np.flatnonzero(rests)
        ]
        slow = self._slow(index, along, legs, times)
        yield self._timed(index, path, track, [*start, *waits], slow)

    def _curve(self, index: int, space: Space, way: Array) -> Nurbs | None:
        """Return the curve of a robot along a polygon (n, 2); None if none is clear."""
        exact = np.zeros(len(way), dtype=np.bool_)
        exact[[0, -1]] = True
        try:
            return smooth(way, exact, space, self._finder.handling(self._robots[index])).curve
        except PlanError:
            return None

    def _slow(self, index: int, along: Array, legs: Array, times: Array) -> list[Slow]:
        """Return the legs (n,) [m] that are driven slowly, by where they lie on the path."""
        speeds = legs / np.maximum(times[1:, 0] - times[:-1, 1], 1e-9)
        return [
            Slow(float(along[k]), float(along[k + 1]), float(speeds[k]))
            for k in np.flatnonzero(speeds < _FULL * self.speed(index))
        ]

    def _timed(
        self, index: int, path: Nurbs, track: Track, waits: list[Wait], slow: Sequence[Slow]
    ) -> Course:
        motion = Motion(slowed(track.limits, slow), waits)
        return self._moving(index, path, track, motion)

    def _moving(self, index: int, path: Nurbs, track: Track, motion: Motion) -> Course:
        return Course(path, track, motion, _sampled(path, motion, self._robots[index].radius))


def may_bend(robot: Robot) -> bool:
    """Return whether a robot may take another way than its shortest one."""
    return (
        robot.path is None
        and not robot.is_idle
        and not robot.via
        and len(robot.start) == len(robot.goal) == 2
    )


def _sampled(path: Nurbs, motion: Motion, radius: float) -> Array:
    """Return samples (n, 5) of a motion; their columns are X to RADIUS of traffic_kernels."""
    inner, points = _places_on(path)
    leaves = motion.start_time
    begin = np.concatenate(([-math.inf, leaves], motion.reached(inner), [motion.finish]))
    end = np.concatenate(([leaves], motion.left(inner), [motion.finish, math.inf]))
    return np.column_stack((points, begin, end, np.full(len(points), radius)))


@kept
def _places_on(path: Nurbs) -> tuple[Array, Array]:
    """Return arc lengths [m] between samples, and the places (n, 2) [m] of samples on a path."""
    count = max(int(path.length / _STEP), 1)
    borders = np.linspace(0.0, path.length, count + 1)
    places = np.concatenate(([0.0], 0.5 * (borders[1:] + borders[:-1]), [path.length]))
    return borders[1:-1], path.at_arc(places)
