"""Where the centre of a robot may be, as connected pieces, and how a robot leaves its place.

Decides: what is connected, and which straight ways out of a place stay clear of all other places.
Must not know: how places are chosen (placing.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray

from coordinator.scenario.model import Point, Workspace

FAN: Final = 24
"""Directions in which a robot may leave its place."""
BEYOND: Final = 0.01
"""An exit ends this much [m] outside the disc around its place."""

_ANGLES: Final = np.arange(FAN) * (math.tau / FAN)
DIRECTIONS: Final = np.column_stack((np.cos(_ANGLES), np.sin(_ANGLES)))


class Pieces:
    """The connected pieces of an area, looked up by point."""

    def __init__(self, area: shapely.Geometry) -> None:
        self.area = area
        self._parts = shapely.get_parts(area)
        shapely.prepare(self._parts)
        self._tree = shapely.STRtree(self._parts)

    def at(self, points: NDArray[np.float64]) -> NDArray[np.intp]:
        """Return for points (n, 2) [m] the number of the piece around each, -1 outside."""
        found = np.full(len(points), -1)
        index, piece = self._tree.query(shapely.points(points))
        # The tree would prepare the points; here it is the pieces that are prepared.
        inside = shapely.contains_xy(self._parts[piece], points[index])
        found[index[inside]] = piece[inside]
        return found

    def leaves_a_way(self, place: Point, keep: float) -> bool:
        """Return whether a disc of radius `keep` [m] here leaves what is around it connected.

        It does if the free part of the disc's rim is in one piece.
        """
        rim = np.array(place) + (keep + BEYOND) * DIRECTIONS
        free = shapely.contains_xy(self.area, rim[:, 0], rim[:, 1])
        return bool(np.count_nonzero(free != np.roll(free, 1)) <= 2)


def free_space(floor: Workspace, reach: float) -> Pieces:
    """Return the area in which a centre is at least `reach` [m] from everything solid.

    Polygons stand for round corners and deviate inwards from them by at most 0.5 % of reach.
    """
    solid = shapely.union_all([shapely.Polygon(ring) for ring in floor.obstacles])
    area = shapely.Polygon(floor.boundary).buffer(-reach).difference(solid.buffer(reach))
    shapely.prepare(area)
    return Pieces(area)


@dataclass(frozen=True)
class Exits:
    """The ways out of each place of n robots, and the pieces to which they lead.

    `places` (2 n, 2) [m]: start and goal of one robot after the other.  `pieces` (2 n, FAN): the
    piece to which each direction leads, -1 where it is blocked.  `ground`: the free space minus a
    disc around every place.
    """

    places: NDArray[np.float64]
    pieces: NDArray[np.intp]
    ground: Pieces

    def common(self, robot: int) -> NDArray[np.intp]:
        """Return the pieces in which the robot can go from its start to its goal."""
        shared = np.intersect1d(self.pieces[2 * robot], self.pieces[2 * robot + 1])
        return shared[shared >= 0]

    def headings(self, place: int, piece: int) -> list[float]:
        """Return the directions [rad] that lead from a place straight onto a piece."""
        return [
            math.remainder(way * math.tau / FAN, math.tau)
            for way in np.flatnonzero(self.pieces[place] == piece).tolist()
        ]


def find_exits(free: Pieces, trips: list[tuple[Point, Point]], keep: float) -> Exits:
    """Return the exits of robots that stay `keep` [m] away from the places of all others."""
    places = np.array(trips).reshape(-1, 2)
    points = shapely.points(places)
    discs = shapely.union_all(shapely.buffer(points, keep))
    ground = Pieces(shapely.difference(free.area, discs))
    ends = (places[:, None, :] + (keep + BEYOND) * DIRECTIONS).reshape(-1, 2)
    starts = np.repeat(places, FAN, axis=0)
    ways = shapely.linestrings(np.stack((starts, ends), axis=1))
    pieces = ground.at(ends)
    leading = np.flatnonzero(pieces >= 0)
    pieces[leading[~shapely.covers(free.area, ways[leading])]] = -1
    way, place = shapely.STRtree(points).query(ways, predicate="dwithin", distance=keep)
    strange = way // (2 * FAN) != place // 2
    pieces[way[strange]] = -1
    return Exits(places, pieces.reshape(-1, FAN), ground)
