"""Floors strewn with random simple polygons, convex and not, some of which touch or overlap.

Decides: shapes and where they lie.  Must not know: robots, beyond the gap that they need.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from random import Random
from typing import Final

import shapely

from coordinator.base.errors import InputError
from coordinator.scenario.model import Point, Workspace
from sim.floors.layout import (
    Layout,
    Region,
    Ring,
    Size,
    Trip,
    Wish,
    floor_of,
    least_trip,
    millimetres,
    whole,
)
from sim.floors.spread import Spread

FEWEST: Final = 3
MOST: Final = 12
"""The most corners of a polygon."""
COVERED: Final = 0.2
"""Share of the floor that the circles around the polygons cover, if there is room for them."""
USUAL: Final = 0.9
"""Usual radius [m] of such a circle."""
SMALLEST: Final = 0.05
"""No polygon is made smaller than this radius [m]: rounding to 1 mm would bend it."""
JOINED: Final = 0.3
"""Share of the polygons that touch or overlap another one."""
LEAST_AREA: Final = 1e-3
"""Polygons beside others have at least this area [m^2]."""
TRIES: Final = 30
"""Random places that are tried for a polygon before it is made smaller."""
NEIGHBOUR_TRIES: Final = 1_000
"""Random polygons that are tried beside others before the floor counts as full."""


def polygons(wish: Wish, dice: Random) -> Layout:
    """Return a floor of random polygons of which some share an edge, a corner or an area."""
    size = wish.size_of(free=0.82)
    usual = max(2, round(COVERED * size[0] * size[1] / (math.pi * USUAL**2)))
    count = usual if wish.obstacles is None else wish.obstacles
    corners = [dice.randint(FEWEST, MOST) for _ in range(count)]
    joined = round(JOINED * (count - 1)) if count else 0
    shapes = _scatter(dice, size, corners[joined:], wish.door)
    for index in range(joined):
        shapes.append(_neighbour(dice, size, shapes, corners[index]))
    anywhere = Region(whole(size))
    return Layout(floor_of(size, shapes), (Trip(anywhere, anywhere),), least_trip(size))


def polygon_floor(corners: int, seed: int, size: Size, gap: float = 0.9) -> Workspace:
    """Return a floor of separate polygons with exactly this many corners in all, for benchmarks.

    Polygons of 3 to 12 corners lie `gap` [m] apart where there is room, and touch neither each
    other nor the floor's edge.  Raises InputError when they do not fit, and ValueError for fewer
    than 3 corners.
    """
    if corners < FEWEST:
        raise ValueError(f"{corners} corners are too few, a polygon has at least {FEWEST}")
    dice = Random(f"polygons-{seed}")
    counts: list[int] = []
    left = corners
    while left > MOST:
        counts.append(min(dice.randint(FEWEST, MOST), left - FEWEST))
        left -= counts[-1]
    return floor_of(size, _scatter(dice, size, [*counts, left], gap))


def _scatter(dice: Random, size: Size, corners: Sequence[int], gap: float) -> list[Ring]:
    """Return polygons inside circles that do not overlap, of the usual size where there is room.

    Raises InputError when they would have to be smaller than SMALLEST.
    """
    if not corners:
        return []
    mean = math.sqrt(COVERED * size[0] * size[1] / (math.pi * len(corners)))
    gap = min(gap, 0.6 * mean)
    radius = max(mean, SMALLEST)
    taken = Spread(2.8 * radius + gap)
    shapes: list[Ring] = []
    for count in corners:
        scale, misses = dice.uniform(0.6, 1.4), 0
        while True:
            own = radius * scale
            rim = own + gap / 2.0
            middle = dice.uniform(rim, size[0] - rim), dice.uniform(rim, size[1] - rim)
            if 2.0 * rim < min(size) and taken.fits(*middle, rim):
                break
            misses += 1
            if misses % TRIES == 0:
                radius *= 0.9
            if radius < SMALLEST:
                floor = f"{size[0]:g} m x {size[1]:g} m"
                raise InputError(
                    [f"--obstacles: no more than {len(shapes)} polygons fit on a floor of {floor}"]
                )
        taken.add(*middle, rim)
        shapes.append(_polygon(dice, count, middle, own))
    return shapes


def _polygon(
    dice: Random, corners: int, middle: Point, radius: float, first: float | None = None
) -> Ring:
    """Return a simple polygon inside a circle: half of them convex, the others stars.

    `first` is the direction [rad] of the first corner; it then lies on the circle.
    """
    convex = dice.random() < 0.5
    flat = dice.uniform(0.5, 1.0) if convex else 1.0
    turn = dice.uniform(0.0, math.tau) if first is None else first
    points = []
    for index in range(corners):
        shift = dice.uniform(-0.25, 0.25) if index else 0.0
        angle = (index + shift) * math.tau / corners
        length = radius if convex or not index else radius * dice.uniform(0.4, 1.0)
        x, y = length * math.cos(angle), flat * length * math.sin(angle)
        points.append(
            (
                middle[0] + x * math.cos(turn) - y * math.sin(turn),
                middle[1] + x * math.sin(turn) + y * math.cos(turn),
            )
        )
    return millimetres(points)


def _neighbour(dice: Random, size: Size, shapes: Sequence[Ring], corners: int) -> Ring:
    """Return a polygon on the floor that shares an edge, a corner or an area with another one.

    Raises InputError when none is found beside polygons that fill the floor.
    """
    floor = shapely.box(0.0, 0.0, *size)
    for _ in range(NEIGHBOUR_TRIES):
        other = dice.choice(shapes)
        middle = shapely.Polygon(other).centroid
        index = dice.randrange(len(other))
        corner, before = other[index], other[index - 1]
        away = math.atan2(corner[1] - middle.y, corner[0] - middle.x)
        radius = max(SMALLEST, dice.uniform(0.5, 0.9) * math.dist(corner, (middle.x, middle.y)))
        how = dice.choice(("edge", "corner", "area"))
        if how == "edge":
            ring = _on_edge(dice, before, corner)
        elif how == "corner":
            end = corner[0] + radius * math.cos(away), corner[1] + radius * math.sin(away)
            ring = _polygon(dice, corners, end, radius, first=away + math.pi)
            ring = (corner, *ring[1:])
        else:
            ring = _polygon(dice, corners, corner, radius)
        polygon = shapely.Polygon(ring)
        if polygon.is_valid and polygon.area > LEAST_AREA and floor.covers(polygon):
            return ring
    raise InputError([f"--obstacles: no more than {len(shapes)} polygons fit on this floor"])


def _on_edge(dice: Random, begin: Point, end: Point) -> Ring:
    """Return a triangle or a box on the right-hand side of an edge."""
    x, y = end[0] - begin[0], end[1] - begin[1]
    high = dice.uniform(0.4, 1.0)
    if dice.random() < 0.5:
        along = dice.uniform(0.2, 0.8)
        tops = [(begin[0] + along * x + high * y, begin[1] + along * y - high * x)]
    else:
        tops = [(end[0] + high * y, end[1] - high * x), (begin[0] + high * y, begin[1] - high * x)]
    return (begin, end, *millimetres(tops))
