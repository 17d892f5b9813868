"""The floor of a scenario as geometry: how far places and lines are from anything solid.

Decides: what is solid, namely every obstacle and all that lies beyond the floor's boundary.  There
is no way between obstacles that share an edge or touch at a corner.  Must not know: robots, curves,
times.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt
import shapely
from shapely import Polygon

from coordinator.curves.nurbs import Array
from coordinator.scenario.model import MapPart, Point
from coordinator.scenario.obstacle_names import obstacle_name, too_near

_SOME: Final = 16
_SPARE: Final = 1e-6
"""Of a line so many places are looked at first: only edges nearer to it than these [m], and this
much more for rounding, can be the nearest."""


class Floor:
    """The outline of the floor and the obstacles on it, exactly as given.

    `names`: those of the last obstacles, in words; the others are known by their numbers.
    """

    def __init__(
        self,
        boundary: Sequence[Point],
        obstacles: Sequence[Sequence[Point]],
        names: Sequence[str] = (),
    ) -> None:
        self.outline = Polygon(boundary)
        self.obstacles = [Polygon(corners) for corners in obstacles]
        self._names = dict(enumerate(names, start=len(obstacles) - len(names)))

    @cached_property
    def solid(self) -> shapely.STRtree:
        """A spatial index of the obstacles and of the area outside the floor."""
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

    @cached_property
    def _sides(self) -> shapely.STRtree:
        """A spatial index of the edges, one by one."""
        rings = [shapely.get_coordinates(ring) for ring in shapely.get_parts(self._edges)]
        sides = np.concatenate([np.stack((ring[:-1], ring[1:]), axis=1) for ring in rings])
        return shapely.STRtree(shapely.linestrings(sides))

    def _is_open(self, place: shapely.Point) -> bool:
        """Return whether a place is on the floor and in no obstacle."""
        solid = self.solid.query(place, predicate="intersects")
        return bool(shapely.intersects(self.outline, place)) and not len(solid)

    def name(self, index: int, near: shapely.Geometry, part: MapPart | None = None) -> str:
        """Return the name of an obstacle in words; one of a map has its place nearest to `near`.

        `part`: which of the obstacles come from a map.
        """
        outline = self.obstacles[index]
        known = self._names.get(index)
        return known or obstacle_name(f"workspace.obstacles[{index}]", index, outline, near, part)

    def what_is_at(self, place: Point, reach: float, part: MapPart | None = None) -> str:
        """Return in words what is solid nearer than `reach` [m] to a place [m], to follow "which".

        "" if nothing is.  `part`: which of the obstacles come from a map.
        """
        here = shapely.Point(place)
        if not shapely.intersects(self.outline, here):
            return "is off the floor"
        apart = np.append(
            shapely.distance(self.obstacles, here), shapely.distance(self.outline.exterior, here)
        )
        nearest = int(apart.argmin())
        if apart[nearest] >= reach:
            return ""
        if nearest == len(self.obstacles):
            return f"is nearer than {reach:g} m to the floor's edge"
        return too_near(float(apart[nearest]), reach, self.name(nearest, here, part))

    def distance(self, points: Array) -> Array:
        """Return the distance [m] from each of the points (n, 2) to anything solid, (n,)."""
        places = shapely.points(points)
        return np.where(self._are_open(places), shapely.distance(self._edges, places), 0.0)

    def are_open(self, points: Array) -> npt.NDArray[np.bool_]:
        """Return which of the points (n, 2) [m] are on the floor and in no obstacle, (n,)."""
        return self._are_open(shapely.points(points))

    def _are_open(self, places: npt.NDArray[np.object_]) -> npt.NDArray[np.bool_]:
        """Return the same of points (n,) as shapely has them."""
        found: npt.NDArray[np.bool_] = shapely.intersects(self.outline, places)
        found[self.solid.query(places, predicate="intersects")[0]] = False
        return found

    def gap(self, line: Array) -> float:
        """Return the distance [m] from a polyline (n, 2) to anything solid; 0 if it enters it.

        A line that meets no edge is either free everywhere or inside something solid everywhere;
        its first point decides.  A line may be a place, twice; no edge is found near such a leg.
        """
        tree, whole = self._sides, shapely.linestrings(line)
        some = shapely.points(line[:: max(len(line) // _SOME, 1)])
        reach = float(shapely.distance(self._edges, some).min()) + _SPARE
        legs = shapely.linestrings(np.stack((line[:-1], line[1:]), axis=1))
        near = np.unique(tree.query(legs, predicate="dwithin", distance=reach)[1])
        edges = tree.geometries.take(near) if len(near) else self._edges
        apart = float(np.min(shapely.distance(whole, edges)))
        return apart if apart > 0.0 and self._is_open(shapely.Point(line[0])) else 0.0
