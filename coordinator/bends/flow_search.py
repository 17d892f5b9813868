"""Ways that look at who comes when: robots move aside, drive more slowly, or wait.

Robots are placed one after another, each on the earliest way in space and time among those that are
placed; then some are taken out and put back in another order (large neighbourhood search, Shaw
1998; Li et al. 2022), by counted rounds.  What others forbid is looked up at samples here; the
schedule on exact conflict zones, and the proof, come after.

Decides: the path of each robot, and a first motion on it.  Must not know: zones, plans on the wire.
"""

from __future__ import annotations

import math
import random
from collections.abc import Collection, Sequence
from typing import Final

import numpy as np

from coordinator.base.bounds import bounds_of
from coordinator.bends.courses import Course, CourseMaker, TrackOf, may_bend
from coordinator.bends.meshes import NARROW, WIDE, Ends, Meshes
from coordinator.bends.roundabout import AreApart, Roundabout, keeping_to
from coordinator.bends.same_side import Mover, same_side
from coordinator.bends.traffic_kernels import (
    Traffic,
    count_meetings,
    first_meeting,
    gathered,
    least_delay,
)
from coordinator.bends.way_kernels import Trip
from coordinator.bends.ways import PADS, way_among
from coordinator.curves.nurbs import Array, Nurbs
from coordinator.paths.path_planner import Pathfinder
from coordinator.scenario.model import Robot
from coordinator.schedule.track import Track

_SLACK: Final = np.array((0.08, 0.012))
"""What motions keep beyond tau [s] and the need [m], since samples have gaps."""

_WORTH: Final = 0.3
"""A detour has to be quicker than waiting at the start by this much [s]."""

_SOON: Final = 0.8
"""If the curve of a way meets nobody after a delay of at most this [s], no wider way is looked for:
that takes longer, as a rule."""

_LARGEST: Final = 4
_SHUFFLED: Final = 0.3
"""With a late robot up to _LARGEST others are taken out, and this share of times put back in any
order, else after it."""

_LATE: Final = 0.2
"""Robots that are delayed by less than this [s] are not taken out for their own sake."""

_TRIES: Final = 24
_DOUBLINGS: Final = 3
"""How often a robot that has found no motion is put back together with others in its way, and how
many sizes their number takes, each twice the last.  If it finds none then, the search ends: where
one finds none, it mostly is not the only one."""

_JAM: Final = 0.2
"""If robots lose more than this share of the time that they take alone, all keep to one side."""

_SAME: Final = 1e-6

_MISSING: Final = 100.0
"""What a robot without a motion counts as delay [s]."""


class FlowSearch:
    """A search for the ways of a whole fleet.

    `last`: what share the last arrival has in the cost of a plan, beside the mean one.
    `are_apart`: None if there are too many robots for exact zones before the end.
    """

    def __init__(
        self,
        finder: Pathfinder,
        paths: Sequence[Nurbs],
        tracks: Sequence[Track],
        track_of: TrackOf,
        tau: float,
        last: float = 0.0,
        are_apart: AreApart | None = None,
    ) -> None:
        self._last, self._are_apart = last, are_apart
        scenario = finder.scenario
        self.robots, self.margin, self.tau = scenario.robots, scenario.margin, tau
        bending = [index for index, robot in enumerate(self.robots) if may_bend(robot)]
        among = {index: finder.space_among_places(index) for index in bending}
        alone = {index: finder.space(self.robots[index]) for index in bending}
        self._meshes = (
            Meshes(finder, among, WIDE, keeps_off=True),
            Meshes(finder, among, NARROW, keeps_off=True),
            Meshes(finder, alone, NARROW, keeps_off=False),
        )
        self._maker = CourseMaker(finder, track_of)
        self._straight = [
            self._maker.shortest(index, path, track)
            for index, (path, track) in enumerate(zip(paths, tracks, strict=True))
        ]
        self.alone = [course.motion.finish for course in self._straight]
        self.courses: list[Course | None] = [None] * len(paths)
        self._standing = [self._at_start(robot) for robot in self.robots]
        self._traffic: Traffic | None = None
        points = np.concatenate([course.samples[:, :2] for course in self._straight])
        widest = 2.0 * max(robot.radius for robot in self.robots) + self.margin
        self._size = widest + max(pad for _, pad in PADS) + 0.02
        corners = np.array([*scenario.workspace.boundary, *points])
        low, high = bounds_of(corners)
        self._low = low - 1.0
        self._counts = (np.ceil((high + 1.0 - self._low) / self._size)).astype(int)
        self._slack = _SLACK.copy()
        self.random = random.Random(len(paths))
        self.is_crowded = False
        """Whether a robot at first found no motion among the others."""

    def run(self, rounds: int) -> list[Course] | None:
        """Place all robots, then improve by `rounds`; None if a robot finds no motion.

        Robots of higher priority are placed first.  Of equal ones those with the shortest way come
        first: they are soon out of the way of all others.
        """
        order = sorted(
            range(len(self.robots)),
            key=lambda index: (-self.robots[index].priority, self.alone[index]),
        )
        for index in order:
            self._place(index, math.inf)
        for index in order:
            if self.courses[index] is None:
                self.is_crowded = True
                self._make_way(index)
            if self.courses[index] is None:
                return None
        if rounds:
            self._turn()
        tried = [0] * len(order)
        for _ in range(rounds):
            seed = max(order, key=lambda index: self._delay(index) / (1 + tried[index]))
            if self._delay(seed) <= _LATE:
                break
            self._try(self._neighbourhood([seed]) if tried[seed] else self._in_the_way(seed))
            tried[seed] += 1
        return self._found()

    def _make_way(self, index: int) -> None:
        """Put a robot that has found no motion back before others in its way, at last many."""
        for number in range(_TRIES):
            most = _LARGEST << _DOUBLINGS * number // _TRIES
            if number % 2:
                self._try(self._neighbourhood([index], most))
            else:
                self._try(self._in_the_way(index, most))
            if self.courses[index] is not None:
                break

    def place_again(self, chosen: Collection[int]) -> list[Course]:
        """Place robots once more that met others in spite of all, with twice the slack.

        A robot that finds no other course keeps the one that it has.
        """
        self._slack *= 2.0
        before = {index: self.courses[index] for index in chosen}
        for index in chosen:
            self._put(index, None)
        for index in sorted(chosen, key=lambda index: self.alone[index]):
            if not self._place(index, math.inf):
                self._put(index, before[index])
        return [course for course in self.courses if course is not None]

    def _found(self) -> list[Course] | None:
        found = [course for course in self.courses if course is not None]
        return found if len(found) == len(self.courses) else None

    def _delay(self, index: int) -> float:
        course = self.courses[index]
        return _MISSING if course is None else course.motion.finish - self.alone[index]

    def _neighbourhood(self, late: list[int], most: int = _LARGEST) -> list[int]:
        """Return robots to take out: a late one and some of those that it meets, up to `most`."""
        seed = self.random.choices(late, [self._delay(index) for index in late])[0]
        own = self._straight[seed].samples
        traffic = self._gathered()
        near = sorted(_met(own, traffic, self._size) - {seed})
        return [seed, *self.random.sample(near, min(len(near), self.random.randint(0, most)))]

    def _in_the_way(self, seed: int, most: int = _LARGEST) -> list[int]:
        """Return a late robot and those that it would meet most on its shortest way, up to `most`.

        Put back first, it drives there, and the others see where they can go then.
        """
        own, count = self._straight[seed].samples, len(self.robots)
        met = count_meetings(own, self._gathered(), seed, *self._kept(seed), count)
        first = np.argsort(-met, kind="stable")[:most]
        return [seed, *first[met[first] > 0].tolist()]

    def _try(self, chosen: list[int]) -> None:
        """Put robots back in this order; undo it if that is no better."""
        if self.random.random() < _SHUFFLED:
            self.random.shuffle(chosen)
        before, arrivals = [self.courses[index] for index in chosen], self._arrivals()
        left = [arrival for index, arrival in enumerate(arrivals) if index not in chosen]
        earlier = max(arrivals) - max(left, default=0.0)
        gain = self._last * len(arrivals) * max(earlier, 0.0)
        most = sum(self._delay(index) for index in chosen) + gain
        for index in chosen:
            self._put(index, None)
        now = 0.0
        for index in chosen:
            if not self._place(index, self.alone[index] + most - now):
                break
            now += self._delay(index)
            if now >= most - _SAME:
                break
        else:
            if self._cost(self._arrivals()) < self._cost(arrivals) - _SAME:
                return
        for index, course in zip(chosen, before, strict=True):
            self._put(index, course)

    def _turn(self) -> None:
        """Let all robots keep to the same side if that is better."""
        was = sum(map(self._delay, range(len(self.robots))))
        if was < _JAM * sum(self.alone) or not all(map(may_bend, self.robots)):
            return
        need, tau = self.margin + PADS[0][1], self.tau + PADS[0][0]
        spaces, gather = self._meshes[-1].spaces, self._traffic_of
        best = self._cost(self._arrivals())
        for turning in same_side(self._movers(), keeping_to(spaces), gather, need, tau):
            way_round = Roundabout(self.robots, self._maker, spaces, self.margin, turning)
            if not way_round.roads or self._cost(way_round.least_arrivals()) >= best:
                continue
            courses = way_round.courses(self._are_apart)
            cost = self._cost([course.motion.finish for course in courses])
            if courses and cost < best and (self._are_apart is not None or self._is_clear(courses)):
                best, self.courses, self._traffic = cost, list(courses), None

    def _movers(self) -> list[Mover]:
        return [
            Mover(
                np.array(robot.start[:2]),
                np.array(robot.goal[:2]),
                robot.radius,
                self._maker.speed(index),
                self._straight[index].track.limits.ramp,
            )
            for index, robot in enumerate(self.robots)
        ]

    def _cost(self, arrivals: Sequence[float]) -> float:
        """Return what plans are compared by: the sum of arrivals [s], and the last one's share."""
        return sum(arrivals) + self._last * len(arrivals) * max(arrivals, default=0.0)

    def _arrivals(self) -> list[float]:
        return [alone + self._delay(index) for index, alone in enumerate(self.alone)]

    def _is_clear(self, courses: list[Course]) -> bool:
        traffic = self._traffic_of([course.samples for course in courses])
        return all(
            first_meeting(course.samples, traffic, index, *self._kept(index)) < 0
            for index, course in enumerate(courses)
        )

    def _put(self, index: int, course: Course | None) -> None:
        self.courses[index], self._traffic = course, None

    def _gathered(self) -> Traffic:
        """Return the samples of all robots; those that are not placed stand at their starts."""
        if self._traffic is None:
            parts = [
                standing if course is None else course.samples
                for course, standing in zip(self.courses, self._standing, strict=True)
            ]
            self._traffic = self._traffic_of(parts)
        return self._traffic

    def _traffic_of(self, parts: list[Array]) -> Traffic:
        """Return the samples (n, 5) of all robots, sorted by the cells of one grid."""
        owner = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
        x, y = self._low.tolist()
        columns, rows = self._counts.tolist()
        return gathered(np.concatenate(parts), owner, x, y, self._size, columns, rows)

    def _place(self, index: int, latest: float) -> bool:
        """Give a robot its earliest course before `latest` [s]; return whether there is one."""
        traffic, straight = self._gathered(), self._straight[index]
        delay = least_delay(straight.samples, traffic, index, *self._kept(index))
        found: Course | None = None
        can_wait = self.alone[index] + delay < latest
        if delay > _WORTH and may_bend(self.robots[index]):
            most = min(latest, self.alone[index] + delay)
            found = self._bent(index, traffic, most - _WORTH)
        if found is None and can_wait:
            found = self._maker.later(index, straight, delay) if delay > 0.0 else straight
        if found is not None:
            self._put(index, found)
        return found is not None

    def _bent(self, index: int, traffic: Traffic, latest: float) -> Course | None:
        """Return a robot's course on the earliest way in space and time; None if there is none.

        It keeps off other robots' starts and goals, unless these close all ways.  A finer mesh is
        searched where the wide one has no way for the robot.
        """
        for meshes in self._meshes:
            ends = meshes.ends(index)
            if ends is not None:
                return self._bent_on(meshes, ends, index, traffic, latest)
        return None

    def _bent_on(
        self, meshes: Meshes, ends: Ends, index: int, traffic: Traffic, latest: float
    ) -> Course | None:
        """Do what `_bent` does, on the meshes that the robot enters and leaves at `ends`."""
        space, mesh = meshes.spaces[index], meshes.of(index)
        ramp, reach = self._maker.ramp(index), self.robots[index].radius + self.margin
        best, added = None, math.inf
        for tau_pad, need_pad in PADS:
            trip = Trip(
                index,
                *ends,
                self._maker.speed(index),
                ramp,
                reach + need_pad,
                self.tau + tau_pad,
            )
            way, times = way_among(mesh, trip, space, traffic, latest - ramp)
            if not len(way):
                break
            for course in self._maker.along(index, space, way, times):
                delay = least_delay(course.samples, traffic, index, *self._kept(index))
                if course.motion.finish + delay < latest:
                    best, added, latest = course, delay, course.motion.finish + delay
                if delay <= _SOON:
                    break
            if added <= _SOON:
                break
        return self._maker.later(index, best, added) if best is not None and added > 0.0 else best

    def _kept(self, index: int) -> tuple[float, float]:
        """Return how far [m] a robot keeps from others' radii, and for how long [s]."""
        tau, need = self._slack.tolist()
        return self.robots[index].radius + self.margin + need, self.tau + tau

    def _at_start(self, robot: Robot) -> Array:
        """Return the sample (1, 5) of a robot that has yet to be placed."""
        return np.array([[*robot.start[:2], -math.inf, 0.0, robot.radius]])


def _met(own: Array, traffic: Traffic, size: float) -> set[int]:
    """Return the robots whose samples lie in the cells of one's own samples."""
    column = ((own[:, 0] - traffic.x) / size).astype(int)
    row = ((own[:, 1] - traffic.y) / size).astype(int)
    cells = np.unique(row * traffic.columns + column)
    return {
        int(one)
        for cell in cells.tolist()
        for one in traffic.owner[traffic.first[cell] : traffic.first[cell + 1]]
    }
