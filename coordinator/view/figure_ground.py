"""Draws the ground: its edge, the obstacles, and their grown outlines, which no centre may enter.

Obstacles are drawn as their union, so that no seam is visible between adjacent pieces of a map.
Decides: how the ground looks, and how many grown outlines are shown.  Must not know: paths.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from shapely import Polygon

from coordinator.curves.nurbs import Array
from coordinator.plan.document import Floor

WALL: Final = "#6b7280"
OBSTACLE: Final = "#d3d7de"
GROWN: Final = "#8a93a3"
HALO: Final = "#f1f2f5"
DASHES: Final = ((0, (1.2, 1.6)), (0, (5.0, 2.0)), "solid")
"""Line styles of the outlines, from the least grown to the most grown."""
_QUARTER: Final = 12
"""Segments in a quarter of a round corner."""


def reaches(radii: Iterable[float], margin: float) -> list[float]:
    """Return how far [m] obstacles are grown: radius + margin, at most three distinct values."""
    every = sorted({round(radius + margin, 6) for radius in radii})
    return every if len(every) <= len(DASHES) else [every[0], every[len(every) // 2], every[-1]]


def draw_ground(axes: Axes, floor: Floor, grown: list[float]) -> None:
    """Draw the floor's edge, the obstacles, and around them their outlines grown by `grown` [m]."""
    outline = Polygon(floor.boundary)
    obstacles = _union(floor)
    for index, (reach, dash) in enumerate(zip(grown, DASHES, strict=False)):
        free = free_ground(outline, obstacles, reach)
        if index == 0:
            _fill(axes, shapely.difference(outline, free), fc=HALO, ec="none", zorder=0.5)
        _fill(axes, free, fill=False, ec=GROWN, lw=0.55, ls=dash, zorder=1.5, gid="grown")
    _fill(axes, obstacles, fc=OBSTACLE, ec=WALL, lw=0.9, zorder=1, gid="obstacles")
    _fill(axes, outline, fill=False, ec=WALL, lw=1.4, zorder=2, gid="boundary")


def free_ground(
    outline: shapely.Geometry, obstacles: shapely.Geometry, reach: float
) -> shapely.Geometry:
    """Return where a centre is at least `reach` [m] from obstacles and from the floor's edge."""
    inner = shapely.buffer(outline, -reach, quad_segs=_QUARTER)
    return shapely.difference(inner, shapely.buffer(obstacles, reach, quad_segs=_QUARTER))


def edge_points(floor: Floor, step: float) -> Array:
    """Return points (n, 2) [m], `step` [m] or less apart, along all edges that are drawn."""
    edges = [shapely.boundary(Polygon(floor.boundary)), shapely.boundary(_union(floor))]
    return np.asarray(shapely.get_coordinates(shapely.segmentize(edges, step)))


def _union(floor: Floor) -> shapely.Geometry:
    return shapely.union_all([Polygon(corners) for corners in filter(None, floor.obstacles)])


def _fill(axes: Axes, geometry: shapely.Geometry, **style: object) -> None:
    """Add polygons, their holes left open, as one patch."""
    rings = []
    for part in shapely.get_parts(shapely.orient_polygons(geometry)):
        if isinstance(part, Polygon) and not part.is_empty:
            rings += [part.exterior, *part.interiors]
    if rings:
        paths = [Path(shapely.get_coordinates(ring), closed=True) for ring in rings]
        axes.add_patch(PathPatch(Path.make_compound_path(*paths), **style))
