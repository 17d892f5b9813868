"""The workspace as geometry: what is solid, and its ground prepared for one reach after another.

Decides: how far places are from anything solid, and what closes a piece of free ground in.  A
shared edge and a touching corner block; so does the floor's edge.  Must not know: curves, times or
which robot asks.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Final

import numpy as np
import shapely
from shapely import Polygon

from coordinator.ground import Ground
from coordinator.growth import Rings
from coordinator.nurbs import Array
from coordinator.scenario import Point

_QUARTER: Final = 16
"""Segments that a quarter of a round corner has where grown obstacles are shown or named."""


class Floor:
    """The workspace, with its grounds kept per reach."""

    def __init__(self, boundary: Sequence[Point], obstacles: Sequence[Sequence[Point]]) -> None:
        self.outline = Polygon(boundary)
        self.obstacles = [Polygon(corners) for corners in obstacles]
        self._rings = Rings.of(obstacles, np.array(boundary))
        self._grounds: dict[tuple[float, float], Ground] = {}

    @cached_property
    def _things(self) -> shapely.STRtree:
        """The obstacles, and what lies outside of the floor, to look things up in."""
        x0, y0, x1, y1 = self.outline.bounds
        far = 1.0 + max(x1 - x0, y1 - y0)
        frame = shapely.box(x0 - far, y0 - far, x1 + far, y1 + far)
        outside = shapely.get_parts(shapely.difference(frame, self.outline))
        return shapely.STRtree([*self.obstacles, *outside])

    @cached_property
    def _edges(self) -> shapely.Geometry:
        """The edges of the floor and of all obstacles."""
        edges = shapely.multilinestrings(shapely.get_rings([self.outline, *self.obstacles]))
        shapely.prepare(edges)
        return edges

    def _is_open(self, place: shapely.Point) -> bool:
        """Tell whether a place is on the floor and in no obstacle."""
        solid = self._things.query(place, predicate="intersects")
        return bool(shapely.intersects(self.outline, place)) and not len(solid)

    def distance(self, points: Array) -> Array:
        """Return the distances [m], (n,), from points (n, 2) to the nearest solid thing."""
        places = shapely.points(points)
        found = self._things.query_nearest(places, return_distance=True, all_matches=False)
        return np.asarray(found[1])

    def gap(self, line: Array) -> float:
        """Return the distance [m] from a polyline (n, 2) to the nearest solid thing; 0 within.

        A line that meets no edge lies where its first point does.
        """
        apart = float(shapely.distance(self._edges, shapely.linestrings(line)))
        return apart if apart > 0.0 and self._is_open(shapely.Point(line[0])) else 0.0

    def ground(self, reach: float, room: float = 0.0) -> Ground:
        """Return the ground for a centre that keeps `reach` [m] from solid things.

        Its ways turn at corners farther out by `room` [m].
        """
        key = (round(reach, 9), round(room, 9))
        if key not in self._grounds:
            self._grounds[key] = Ground(self._rings, *key)
        return self._grounds[key]

    def fresh_ground(self, reach: float) -> Ground:
        """Return ground that is not kept, for a reach [m] that is asked for once."""
        return Ground(self._rings, reach)

    def free(self, reach: float) -> list[shapely.Geometry]:
        """Return the connected pieces where a centre keeps `reach` [m] from solid things."""
        grown = shapely.buffer(self._things.geometries, reach, quad_segs=_QUARTER)
        return list(shapely.get_parts(shapely.difference(self.outline, shapely.union_all(grown))))
