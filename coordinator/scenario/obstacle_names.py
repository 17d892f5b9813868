"""How messages name the obstacles of a workspace, and the note about those outside the floor.

An obstacle that the scenario lists is named by its index there; one from a map has no index that a
person could look up, so it is named by the map's file and a place.

Decides: these names.  Must not know: what is wrong with an obstacle, or how maps are read.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray

from coordinator.scenario.model import MapPart, Point

_LISTED: Final = 4
"""At most this many obstacles outside the floor are named; the others are counted."""

Polygons = NDArray[np.object_]


def polygons_of(rings: Sequence[Sequence[Point]]) -> Polygons:
    """Return the polygons of outlines [m], in one call: a map can have tens of thousands."""
    sizes = [len(ring) for ring in rings]
    corners = np.array([corner for ring in rings for corner in ring]).reshape(-1, 2)
    which = np.repeat(np.arange(len(rings)), sizes)
    return np.asarray(shapely.polygons(shapely.linearrings(corners, indices=which)))


def obstacle_name(
    listed: str, index: int, outline: shapely.Polygon, near: shapely.Geometry, part: MapPart | None
) -> str:
    """Return the name of an obstacle for messages: `listed` if the scenario itself lists it.

    The name of one from a map has the place on its outline that is nearest to `near`.
    """
    if part is None or index < part.first:
        return listed
    place = shapely.get_point(shapely.shortest_line(outline.exterior, near), 0)
    return f"the obstacle of {part.file} at ({place.x:.2f}, {place.y:.2f}) m"


def closed_place(name: str) -> str:
    """Return the name of a place that an operator has closed for messages."""
    return f"the closed place {name}"


def too_near(apart: float, reach: float, name: str) -> str:
    """Return in words, to follow "which", that a place is `apart` [m] from a thing of this name.

    `reach` [m]: how far it should be.
    """
    return f"is nearer than {reach:g} m to {name}" if apart > 0.0 else f"is inside {name}"


def note_outside(
    boundary: Sequence[Point], obstacles: Sequence[Sequence[Point]], part: MapPart | None
) -> str:
    """Return a sentence about obstacles wholly outside the floor; empty when there are none.

    Empty outlines replace invalid ones and are ignored.
    """
    sound = np.array([i for i, ring in enumerate(obstacles) if ring], dtype=np.intp)
    if not boundary or not len(sound):
        return ""
    (floor,) = polygons_of([boundary])
    shapely.prepare(floor)
    with np.errstate(all="ignore"):
        apart = shapely.disjoint(floor, polygons_of([obstacles[i] for i in sound.tolist()]))
    outside = sound[apart].tolist()
    own = [index for index in outside if part is None or index < part.first]
    named = [f"workspace.obstacles[{index}]" for index in own[:_LISTED]]
    named += [f"{len(own) - _LISTED} more"] if len(own) > _LISTED else []
    if part is not None and len(outside) > len(own):
        named.append(f"{len(outside) - len(own)} of {part.file}")
    if not named:
        return ""
    head = "1 obstacle lies" if len(outside) == 1 else f"{len(outside)} obstacles lie"
    return f"{head} wholly outside the floor, without effect: {', '.join(named)}"
