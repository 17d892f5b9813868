"""What is asked of a generated floor, and what a kind of floor answers.

Decides: how much room robots need to pass and to park, and how large a floor of that many robots
is.  Must not know: the kinds themselves, or where in its boxes a robot ends up (placing.py).
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
]
Ring = tuple[Point, ...]
Size = tuple[float, float]
"""Width and height [m]."""

MARGIN: Final = 0.05
"""Tracking error [m] allowed between two robots: the default of scenario files."""
SLACK: Final = 0.05
"""Room [m] that generated places and ways have beyond what the checks ask."""
DISC_SHARE: Final = 0.015
"""Share of the free floor that the robots' discs cover, unless a size is given."""
FEWEST: Final = 8
"""No floor is made smaller than for so many robots of its own accord."""
WIDE: Final = 1.25
"""Width of a floor by its height."""


class Box(NamedTuple):
    """An upright rectangle [m]; of no extent, it is a place."""

    x0: float
    y0: float
    x1: float
    y1: float

    @property
    def ring(self) -> Ring:
        """Return the corners, counter-clockwise, to the millimetre."""
        x0, y0, x1, y1 = self
        return millimetres(((x0, y0), (x1, y0), (x1, y1), (x0, y1)))

    def grown(self, by: float) -> Box:
        """Return the box with each side moved outwards [m]."""
        return Box(self.x0 - by, self.y0 - by, self.x1 + by, self.y1 + by)


class Region:
    """Ground made of boxes, from which places are drawn: larger boxes are hit more often."""

    def __init__(self, *boxes: Box) -> None:
        self._boxes = boxes
        # A box without extent counts too: some regions are single places.
        areas = [(box.x1 - box.x0) * (box.y1 - box.y0) + 1e-12 for box in boxes]
        self._areas = list(itertools.accumulate(areas))

    def draw(self, dice: Random) -> Point:
        """Return a place [m] in one of the boxes, to the millimetre."""
        box = dice.choices(self._boxes, cum_weights=self._areas)[0]
        return millimetres([(dice.uniform(box.x0, box.x1), dice.uniform(box.y0, box.y1))])[0]


class Trip(NamedTuple):
    """Where a robot may start and where it may be bound for."""

    starts: Region
    goals: Region

    def back(self) -> Trip:
        """Return the way back."""
        return Trip(self.goals, self.starts)


@dataclass(frozen=True)
class Layout:
    """A floor and its trips: robot i takes trip i, counted round and round.

    No trip is shorter than `least_trip` [m], start to goal as the crow flies.
    """

    floor: Workspace
    trips: tuple[Trip, ...]
    least_trip: float


@dataclass(frozen=True)
class Wish:
    """What is asked of a kind: for how many robots, of what radius [m] at most.

    `size` [m] and the number of `obstacles` are None when the kind may choose.
    """

    robots: int
    radius: float
    size: Size | None = None
    obstacles: int | None = None

    @property
    def reach(self) -> float:
        """Return how far [m] the centre of a robot keeps from walls, slack included."""
        return self.radius + MARGIN + SLACK

    @property
    def need(self) -> float:
        """Return the least distance [m] between the centres of two robots."""
        return 2.0 * self.radius + MARGIN

    @property
    def apart(self) -> float:
        """Return how far [m] places lie apart: a third robot passes between two."""
        return 2.0 * (self.need + SLACK)

    @property
    def lane(self) -> float:
        """Return the width [m] of a way where one robot passes between two parked at its sides."""
        return 2.0 * self.reach + self.apart

    @property
    def door(self) -> float:
        """Return the width [m] of a gap that one robot passes with ease."""
        return 2.0 * self.reach + 0.3

    def size_of(self, free: float) -> Size:
        """Return the size asked for, else one for a floor whose free share is about `free`."""
        if self.size is not None:
            return self.size
        robots = max(self.robots, FEWEST)
        area = robots * math.pi * self.radius**2 / (DISC_SHARE * free)
        width = math.ceil(2.0 * math.sqrt(area * WIDE)) / 2.0
        return width, math.ceil(2.0 * area / width) / 2.0

    def chosen(self, things: str, default: int, most: int) -> int:
        """Return the number of obstacles; InputError when there is no room for them."""
        if self.obstacles is None and most < 1:
            raise InputError([f"--size: no {things} fit on so small a floor"])
        count = min(default, most) if self.obstacles is None else self.obstacles
        if count > most:
            raise InputError([f"--obstacles: {count} {things} do not fit on this floor, {most} do"])
        return count


def floor_of(size: Size, obstacles: Iterable[Ring] = ()) -> Workspace:
    """Return an upright floor from the origin with these obstacles."""
    return Workspace(boundary=whole(size).ring, obstacles=tuple(obstacles))


def whole(size: Size) -> Box:
    """Return the box of a whole floor."""
    return Box(0.0, 0.0, *size)


def least_trip(size: Size) -> float:
    """Return the length [m] below which a trip on an upright floor is not worth making."""
    return 0.3 * math.hypot(*size)


def millimetres(points: Iterable[Point]) -> Ring:
    """Return points [m] rounded to 1 mm; 0.0 is added so that no zero is negative."""
    return tuple((round(x, 3) + 0.0, round(y, 3) + 0.0) for x, y in points)
