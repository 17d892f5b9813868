"""Courses on which all robots keep to the same side, at paces that fit the room between them.

Decides: how fast each part of an arc is driven.  Must not know: which arcs there are
(same_side.py), other courses.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np

from coordinator.bends.courses import Course, CourseMaker, Road
from coordinator.bends.same_side import Turning
from coordinator.curves.nurbs import Array
from coordinator.ground.free_space import Space
from coordinator.motion.velocity_profile import Motion
from coordinator.scenario.model import Robot
from coordinator.schedule.track import Track

AreApart = Callable[[Sequence[Track]], Callable[[Sequence[Motion]], bool]]
"""Returns for tracks whether nobody meets anybody on them by motions, on exact conflict zones."""

_PARTS: Final = 8
_LEAST_ROOM: Final = 0.05
"""Each arc has so many equal parts, driven the faster the more room [m] there is at them."""

_HALVINGS: Final = 10


class Roundabout:
    """The curves along one flow's arcs; `roads` is empty if an arc has none that is clear."""

    def __init__(
        self,
        robots: Sequence[Robot],
        maker: CourseMaker,
        spaces: Mapping[int, Space],
        margin: float,
        turning: Turning,
    ) -> None:
        self._robots, self._maker, self._pace = robots, maker, turning.pace
        self._need = 2.0 * max(robot.radius for robot in robots) + margin
        found = [maker.road(index, spaces[index], way) for index, way in enumerate(turning.arcs)]
        roads = [road for road in found if road is not None]
        self.roads: list[Road] = roads if len(roads) == len(found) else []

    def least_arrivals(self) -> list[float]:
        """Return when robots would arrive [s] if they had their roads for themselves."""
        return [road.track.alone for road in self.roads]

    def courses(self, are_apart: AreApart | None) -> list[Course]:
        """Return the quickest courses found on which nobody meets anybody; none if there are none.

        Without `are_apart` they are at the flow's own pace, and not looked at again.
        """
        if are_apart is None:
            return self._paced(np.array([self._pace]))
        room, is_clear = self._room(), are_apart([road.track for road in self.roads])
        low, high = 0.0, max(map(self._maker.speed, range(len(self.roads)))) / room.min()
        middle, found = self._pace / room.max(), list[Course]()
        for _ in range(_HALVINGS):
            courses = self._paced(middle * room)
            if is_clear([course.motion for course in courses]):
                low, found = middle, courses
            else:
                high = middle
            middle = 0.5 * (low + high)
        return found

    def _paced(self, paces: Array) -> list[Course]:
        return [self._maker.paced(index, road, paces) for index, road in enumerate(self.roads)]

    def _room(self) -> Array:
        """Return how far apart [m], beyond what they need, robots are that are equally far on."""
        middles = np.linspace(0.0, 1.0, 2 * _PARTS + 1)[1::2]
        places = np.array([road.path.at_arc(middles * road.path.length) for road in self.roads])
        near = np.hypot(*np.moveaxis(places[:, None] - places[None], -1, 0))
        near[np.diag_indices(len(self.roads))] = math.inf
        return np.asarray(np.maximum(near.min(axis=(0, 1)) - self._need, _LEAST_ROOM))


def keeping_to(spaces: Mapping[int, Space]) -> Callable[[int, Array], bool]:
    """Return whether the floor has room for a robot's polygon (n, 2) [m]."""

    def keeps(index: int, way: Array) -> bool:
        return bool(spaces[index].keeping(way[:-1], way[1:]).all())

    return keeps
