"""Checks of places: on the floor, clear of obstacles, apart from each other, a way between them.

Decides: how much room is enough, and the wording of each fault.  Must not know: whose places they
are (scenario/checks.py, scenario/order_checks.py).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from coordinator.scenario.model import Point, Pose, Workspace
from coordinator.scenario.obstacle_names import obstacle_name

ROUNDING: Final = 1e-9
"""Distances may be short by this [m], so that rounding does not refuse an exact place."""
LEAST_STEP: Final = 1e-3
"""Two places nearer than this [m] are the same place: there is no path between them."""
MOST_PAIRS: Final = 1_000
"""At most this many pairs of places that are too near together are listed: all robots in one place
would give millions."""
PAIR_CHUNK: Final = 256
"""Number of places whose neighbours are looked up at a time, which bounds the memory if all of them
are the same."""
BOUNDARY: Final = -1
"""The index of the floor's outline, beside the indices of obstacles."""

Numbers = NDArray[np.float64]
Points = NDArray[np.object_]
Polygons = Mapping[int, shapely.Polygon]


class Spot(NamedTuple):
    """A place where a robot must have room: `need` [m] is its radius + margin, NaN if unknown."""

    field: str
    x: float
    y: float
    need: float

    def problem(self, where: str) -> str:
        """Return the message about a spot that is somewhere without enough room."""
        need = "" if math.isnan(self.need) else f", radius + margin need {self.need:.6g} m"
        return f"{self.field}: ({self.x:g}, {self.y:g}) m is {where}{need}"


def missing_steps(field: str, places: Iterable[tuple[str, Point | Pose]]) -> Iterator[str]:
    """Yield a message for each (field, place) that is the same place as the one before it.

    `field`: the table that all of them stand in.
    """
    for (before_field, before), (after_field, after) in itertools.pairwise(places):
        if math.dist(before[:2], after[:2]) < LEAST_STEP:
            where = f"({after[0]:g}, {after[1]:g}) m"
            before_key = before_field.removeprefix(f"{field}.")
            yield (
                f"{after_field}: {where} is the same place as {before_key}, "
                "so there is nothing to drive between them"
            )


def tight_places(spots: Sequence[Spot], floor: Workspace, polygons: Polygons) -> Iterator[str]:
    """Yield a message for each spot off the floor or too near to its edge or an obstacle.

    There are at most two for a spot: one for the floor, one for the nearest obstacle.  Spots whose
    place is NaN are left out.  `polygons`: the floor's sound outlines by index.
    """
    spots = [spot for spot in spots if math.isfinite(spot.x)]
    points = shapely.points(np.array([(spot.x, spot.y) for spot in spots]).reshape(-1, 2))
    # A robot of unknown size still must not stand inside an obstacle or off the floor.
    needs = np.nan_to_num(np.array([spot.need for spot in spots]))
    needs = np.maximum(needs - ROUNDING, ROUNDING)
    obstacles = {index: shape for index, shape in polygons.items() if index != BOUNDARY}
    if BOUNDARY in polygons:
        yield from _edge_problems(spots, points, needs, polygons[BOUNDARY])
    if obstacles:
        yield from _obstacle_problems(spots, points, needs, floor, obstacles)


def _edge_problems(
    spots: Sequence[Spot], points: Points, needs: Numbers, floor: shapely.Polygon
) -> Iterator[str]:
    edge = floor.exterior
    shapely.prepare([floor, edge])
    inside = shapely.covers(floor, points)
    for at in np.flatnonzero(~inside | shapely.dwithin(edge, points, needs)).tolist():
        distance = shapely.distance(edge, points[at])
        side = "from the edge of" if inside[at] else "outside"
        yield spots[at].problem(f"{distance:.6g} m {side} the floor")


def _obstacle_problems(
    spots: Sequence[Spot], points: Points, needs: Numbers, floor: Workspace, obstacles: Polygons
) -> Iterator[str]:
    indices, shapes = list(obstacles), np.array(list(obstacles.values()))
    at, which = shapely.STRtree(shapes).query(points, predicate="dwithin", distance=needs)
    distance = shapely.distance(points[at], shapes[which])
    nearest_first = np.lexsort((distance, at))
    at, which, distance = at[nearest_first], which[nearest_first], distance[nearest_first]
    for first in np.unique(at, return_index=True)[1]:
        name = shape_name(floor, obstacles, indices[which[first]], points[at[first]])
        away = f"{distance[first]:.6g} m from" if distance[first] > 0.0 else "inside"
        yield spots[at[first]].problem(f"{away} {name}")


def shape_name(floor: Workspace, polygons: Polygons, index: int, near: shapely.Geometry) -> str:
    """Return the name of a polygon; one from a map is named by its place nearest to `near`."""
    if index == BOUNDARY:
        return "workspace.boundary"
    listed = f"workspace.obstacles[{index}]"
    return obstacle_name(listed, index, polygons[index], near, floor.from_map)


def near_pairs(places: Numbers, radii: Numbers, margin: float) -> Iterator[tuple[int, int, float]]:
    """Yield (first, second, distance [m]) of discs that are nearer than their radii + margin.

    `places` (n, 2) and `radii` (n,) [m] may be NaN, and `margin` [m] as well: unknown ones are
    near to nothing.
    """
    known = np.flatnonzero(np.isfinite(places[:, 0]) & np.isfinite(radii + margin))
    # Each disc looks only for discs that are no larger than itself, so twice its radius suffices.
    by_size = known[np.argsort(-radii[known], kind="stable")]
    points = shapely.points(places[by_size])
    tree = shapely.STRtree(points)
    reach = 2.0 * radii[by_size] + margin
    for begin in range(0, len(by_size), PAIR_CHUNK):
        chunk = slice(begin, begin + PAIR_CHUNK)
        larger, smaller = tree.query(points[chunk], predicate="dwithin", distance=reach[chunk])
        larger += begin
        a, b = by_size[larger], by_size[smaller]
        distance = np.hypot(*(places[a] - places[b]).T)
        near = (larger < smaller) & (distance < radii[a] + radii[b] + margin - ROUNDING)
        for i, j, gap in zip(a[near], b[near], distance[near], strict=True):
            yield int(min(i, j)), int(max(i, j)), float(gap)
