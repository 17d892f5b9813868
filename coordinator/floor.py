"""Where the centre of a robot may be: obstacles grown by its radius, corners to turn around.

Decides: how obstacles grow and what counts as blocked.  A shared edge and a touching corner block;
so does the floor's edge.  Must not know: curves, times or which robot asks.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt
import shapely
from shapely import Polygon
from shapely.geometry.polygon import orient

from coordinator.nurbs import Array
from coordinator.scenario import Point

_TURN_STEP: Final = math.pi / 4
"""Round corners of grown obstacles become tangent polygons with at most this turn a vertex."""

_SLACK: Final = 1e-6
"""Blocked ground is smaller than the grown obstacle by this [m]: touching it is allowed."""


@dataclass(frozen=True)
class Disc:
    """A round place to keep the centre out of, [m], seen as a tangent polygon of so many sides."""

    x: float
    y: float
    radius: float
    sides: int = 8


@dataclass(frozen=True, eq=False)
class Ground:
    """What blocks the centre of one robot, and the corners [m], (n, 2), that a way may turn at."""

    blocked: shapely.Geometry
    corners: Array

    def clear(self, start: Array, ends: Array) -> npt.NDArray[np.bool_]:
        """Tell for each end (n, 2) whether the straight line from start (2,) is free."""
        lines = np.empty((len(ends), 2, 2))
        lines[:, 0] = start
        lines[:, 1] = ends
        return ~np.asarray(shapely.intersects(self.blocked, shapely.linestrings(lines)))


class Floor:
    """The workspace as geometry, with its grown forms cached per distance."""

    def __init__(self, boundary: Sequence[Point], obstacles: Sequence[Sequence[Point]]) -> None:
        self.outline = Polygon(boundary)
        self.obstacles = [Polygon(corners) for corners in obstacles]
        x0, y0, x1, y1 = self.outline.bounds
        far = 1.0 + max(x1 - x0, y1 - y0)
        frame = shapely.box(x0 - far, y0 - far, x1 + far, y1 + far)
        self._frame = shapely.difference(frame, self.outline)
        self._grown: dict[float, shapely.Geometry] = {}

    @cached_property
    def solid(self) -> shapely.Geometry:
        """All that is solid: the obstacles and everything outside the floor."""
        solid = shapely.union_all([*self.obstacles, self._frame])
        shapely.prepare(solid)
        return solid

    def distance(self, points: Array) -> Array:
        """Return the distances [m], (n,), from points (n, 2) to the nearest solid thing."""
        return np.asarray(shapely.distance(shapely.points(points), self.solid))

    def grown(self, distance: float) -> shapely.Geometry:
        """Return everything solid, grown by a distance [m]."""
        if distance not in self._grown:
            self._grown[distance] = grow([*self.obstacles, self._frame], distance)
        return self._grown[distance]

    def ground(self, reach: float, room: float, discs: Sequence[Disc] = ()) -> Ground:
        """Return the ground for a centre that keeps `reach` from solid things.

        Corners lie farther out by `room` [m], which the rounding of the curve uses up.
        """
        inner = [self.grown(reach - _SLACK), *(_round(disc, -_SLACK) for disc in discs)]
        outer = [self.grown(reach + room), *(_round(disc, room) for disc in discs)]
        blocked = shapely.union_all(inner)
        shapely.prepare(blocked)
        corners = _convex_corners(shapely.union_all(outer))
        free = ~np.asarray(shapely.intersects(blocked, shapely.points(corners)))
        return Ground(blocked, corners[free])

    def names_near(self, area: shapely.Geometry, reach: float) -> list[str]:
        """Name the obstacles (and the floor's edge) that bound a piece of free ground."""
        near = [
            f"obstacle {index}"
            for index, obstacle in enumerate(self.obstacles)
            if shapely.distance(obstacle, area) < reach * 1.1 + 0.01
        ]
        if shapely.distance(self._frame, area) < reach * 1.1 + 0.01:
            near.append("the floor's edge")
        return near


def grow(polygons: Iterable[shapely.Geometry], distance: float) -> shapely.Geometry:
    """Grow polygons by a distance [m]: exact along edges, tangent polygons around corners.

    The result contains the true offset; it exceeds it only around convex corners, by at most
    distance * (1 / cos(22.5 deg) - 1).
    """
    solid = [part for shape in polygons for part in shapely.get_parts(shape)]
    pieces = list(solid)
    for polygon in solid:
        oriented = orient(polygon)
        for ring in (oriented.exterior, *oriented.interiors):
            pieces.extend(_ring_pieces(np.asarray(ring.coords)[:-1], distance))
    return shapely.union_all(pieces)


def _ring_pieces(corners: Array, distance: float) -> list[Polygon]:
    """Return what a ring (solid on its left) gains: a strip per edge, a wedge per corner."""
    edges = np.roll(corners, -1, axis=0) - corners
    sizes = np.hypot(edges[:, 0], edges[:, 1])
    corners, edges, sizes = corners[sizes > 0], edges[sizes > 0], sizes[sizes > 0]
    normals = np.column_stack((edges[:, 1], -edges[:, 0])) / sizes[:, None]
    ends = np.roll(corners, -1, axis=0)
    strips = np.stack(
        (corners, corners + distance * normals, ends + distance * normals, ends), axis=1
    )
    pieces = list(shapely.polygons(strips))
    before = np.roll(normals, 1, axis=0)
    turns = np.arctan2(
        before[:, 0] * normals[:, 1] - before[:, 1] * normals[:, 0],
        np.einsum("ij,ij->i", before, normals),
    )
    for corner, normal, turn in zip(corners, before, turns, strict=True):
        if turn > 1e-9:
            pieces.append(_wedge(corner, math.atan2(normal[1], normal[0]), turn, distance))
    return pieces


def _wedge(corner: Array, angle: float, turn: float, distance: float) -> Polygon:
    """Return the tangent polygon around the arc from `angle` over `turn` [rad]."""
    count = math.ceil(turn / _TURN_STEP - 1e-9)
    step = turn / count
    tips = [(angle + (i + 0.5) * step, distance / math.cos(0.5 * step)) for i in range(count)]
    polar = [(angle, distance), *tips, (angle + turn, distance)]
    arc = [(corner[0] + r * math.cos(a), corner[1] + r * math.sin(a)) for a, r in polar]
    return Polygon([tuple(corner), *arc])


def _round(disc: Disc, extra: float) -> Polygon:
    """Return the tangent polygon around a disc."""
    radius = (disc.radius + extra) / math.cos(math.pi / disc.sides)
    angles = (np.arange(disc.sides) + 0.5) * (2.0 * math.pi / disc.sides)
    return Polygon(
        np.column_stack((disc.x + radius * np.cos(angles), disc.y + radius * np.sin(angles)))
    )


def _convex_corners(shape: shapely.Geometry) -> Array:
    """Return the corners (n, 2) of an area that stick out: only there does a taut way turn."""
    found = [np.empty((0, 2))]
    for part in shapely.get_parts(shape):
        oriented = orient(part)
        for ring in (oriented.exterior, *oriented.interiors):
            corners = np.asarray(ring.coords)[:-1]
            before = corners - np.roll(corners, 1, axis=0)
            after = np.roll(corners, -1, axis=0) - corners
            turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
            found.append(corners[turn > 0.0])
    return np.concatenate(found)


def as_array(points: Iterable[Point]) -> Array:
    """Return points as an array (n, 2)."""
    return np.array(list(points), dtype=np.float64).reshape(-1, 2)
