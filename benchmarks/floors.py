"""Floors for shortest ways: separate polygons, and pairs of places to connect.

Decides: sizes, seeds and queries; the same ones for every library.  Polygons neither touch nor
overlap, because the other libraries fail on both.  Must not know: which library is measured.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from random import Random
from typing import Final

import shapely

from coordinator.scenario.model import Point
from sim.floors.polygons import polygon_floor

CORNERS: Final = (20, 100, 500, 2_000, 8_000)
QUERIES: Final = 50
AREA: Final = 5.0
"""Area of the floor [m^2] per corner; gaps are at least about 1 m, so a robot of 0.3 m passes."""
OFF: Final = 0.35
"""The least distance [m] of a place from everything solid."""
SEED: Final = 1


@dataclass(frozen=True)
class Arena:
    """A floor with its queries: corners counter-clockwise [m], start and goal of each way."""

    corners: int
    boundary: tuple[Point, ...]
    polygons: tuple[tuple[Point, ...], ...]
    queries: tuple[tuple[Point, Point], ...]


def arena(corners: int) -> Arena:
    """Return the floor with this many corners in all, whose side grows as their square root."""
    side = math.sqrt(AREA * corners)
    floor = polygon_floor(corners, SEED, (side, side))
    shapes = [shapely.orient_polygons(shapely.Polygon(ring)) for ring in floor.obstacles]
    rings = [tuple((x, y) for x, y in shape.exterior.coords[:-1]) for shape in shapes]
    tree = shapely.STRtree(shapes)
    dice = Random(SEED)
    places: list[Point] = []
    while len(places) < 2 * QUERIES:
        place = dice.uniform(OFF, side - OFF), dice.uniform(OFF, side - OFF)
        if not len(tree.query(shapely.Point(place), "dwithin", OFF)):
            places.append(place)
    queries = tuple(zip(places[::2], places[1::2], strict=True))
    return Arena(corners, floor.boundary, tuple(rings), queries)
