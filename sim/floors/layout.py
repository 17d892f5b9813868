"""The request for a generated floor (Wish), and what a kind of floor returns for it (Layout).

Decides: how much room robots need to pass and to park, and how large a floor for a number of robots
is.  Must not know: the kinds themselves, or where in its boxes a robot is placed (placing.py).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass
from random import Random
from typing import Final, Literal, NamedTuple

from coordinator.base.errors import InputError
from coordinator.scenario.model import Point, Workspace
from protocol.messages import FARTHEST

Kind = Literal[
    "polygons",
    "warehouse",
    "corridors",
    "rooms",
    "u-traps",
    "maze",
    "grid",
    "ring",
    "circle",
    "open",
    "cross-town",
    "aisles",
    "bays",
    "doorway",
    "dense",
    "puzzle",
]
Ring = tuple[Point, ...]
Size = tuple[float, float]
"""Width and height [m]."""

LEAST_SIDE: Final = 1.0
MOST_SIDE: Final = FARTHEST
"""The least and the greatest length [m] of a side of a floor."""
MARGIN: Final = 0.05
"""Tracking error [m] allowed between two robots: the default of scenario files."""
SLACK: Final = 0.05
"""Room [m] that generated places and ways have beyond what the checks require."""
DISC_SHARE: Final = 0.015
"""Share of the free floor that the robots' discs cover, unless a size is given."""
FEWEST: Final = 8
"""Unless a size is given, a floor has room for at least this many robots."""
WIDE: Final = 1.25
"""Ratio of a floor's width to its height."""


class Box(NamedTuple):
    """An axis-parallel rectangle [m]; without extent it is a single point."""

    x0: float
    y0: float
    x1: float
    y1: float

    @property
    def ring(self) -> Ring:
        """Return the corners counter-clockwise, rounded to 1 mm."""
        x0, y0, x1, y1 = self
        return millimetres(((x0, y0), (x1, y0), (x1, y1), (x0, y1)))

    def grown(self, by: float) -> Box:
        """Return the box with each side moved outwards by this distance [m]."""
        return Box(self.x0 - by, self.y0 - by, self.x1 + by, self.y1 + by)


class Region:
    """A set of boxes in which places are chosen at random; larger boxes are chosen more often."""

    def __init__(self, *boxes: Box) -> None:
        self._boxes = boxes
        # A box without extent counts too: some regions are single places.
        areas = [(box.x1 - box.x0) * (box.y1 - box.y0) + 1e-12 for box in boxes]
        self._areas = list(itertools.accumulate(areas))

    def draw(self, dice: Random) -> Point:
        """Return a random place [m] in one of the boxes, rounded to 1 mm."""
        box = dice.choices(self._boxes, cum_weights=self._areas)[0]
        return millimetres([(dice.uniform(box.x0, box.x1), dice.uniform(box.y0, box.y1))])[0]


class Trip(NamedTuple):
    """Where a robot may start and where its goal may be."""

    starts: Region
    goals: Region

    def back(self) -> Trip:
        """Return the trip in the opposite direction."""
        return Trip(self.goals, self.starts)


@dataclass(frozen=True)
class Layout:
    """A floor and its trips: robot i takes trip i modulo the number of trips.

    Start and goal of a trip are at least `least_trip` [m] apart in a straight line.
    """

    floor: Workspace
    trips: tuple[Trip, ...]
    least_trip: float


@dataclass(frozen=True)
class Wish:
    """The request for a floor: the number of robots and their largest radius [m].

    `size` [m] and the number of `obstacles` are None when the kind may choose.
    """

    robots: int
    radius: float
    size: Size | None = None
    obstacles: int | None = None

    @property
    def reach(self) -> float:
        """Return the distance [m] of a robot's centre from walls, slack included."""
        return self.radius + MARGIN + SLACK

    @property
    def need(self) -> float:
        """Return the least distance [m] between the centres of two robots."""
        return 2.0 * self.radius + MARGIN

    @property
    def apart(self) -> float:
        """Return the distance [m] between two places at which a third robot passes between them."""
        return 2.0 * (self.need + SLACK)

    @property
    def lane(self) -> float:
        """Return the width [m] of a lane where a robot passes between two parked at its sides."""
        return 2.0 * self.reach + self.apart

    @property
    def door(self) -> float:
        """Return the width [m] of a gap that one robot passes easily."""
        return 2.0 * self.reach + 0.3

    def size_of(self, free: float) -> Size:
        """Return the requested size, else one for a floor of which a share `free` is free."""
        if self.size is not None:
            return self.size
        robots = max(self.robots, FEWEST)
        area = robots * math.pi * self.radius**2 / (DISC_SHARE * free)
        width = math.ceil(2.0 * math.sqrt(area * WIDE)) / 2.0
        return width, math.ceil(2.0 * area / width) / 2.0

    def chosen(self, things: str, default: int, most: int) -> int:
        """Return the number of obstacles; InputError when there is no room for them."""
        if self.obstacles is None and most < 1:
            raise InputError([f"--size: the floor is too small for {things}"])
        count = min(default, most) if self.obstacles is None else self.obstacles
        if count > most:
            room = f"this floor has room for {most}"
            raise InputError([f"--obstacles: {count} {things} do not fit, {room}"])
        return count


def floor_of(size: Size, obstacles: Iterable[Ring] = ()) -> Workspace:
    """Return an axis-parallel floor with a corner at the origin and these obstacles."""
    return Workspace(boundary=whole(size).ring, obstacles=tuple(obstacles))


def whole(size: Size) -> Box:
    """Return the box of a whole floor."""
    return Box(0.0, 0.0, *size)


def least_trip(size: Size) -> float:
    """Return the least length [m] of a trip on an axis-parallel floor."""
    return 0.3 * math.hypot(*size)


def millimetres(points: Iterable[Point]) -> Ring:
    """Return points [m] rounded to 1 mm; 0.0 is added so that no zero is negative."""
    return tuple((round(x, 3) + 0.0, round(y, 3) + 0.0) for x, y in points)
