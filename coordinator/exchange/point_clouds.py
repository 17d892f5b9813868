"""Makes point clouds of floor, paths and robots for Rerun, which does not draw scene updates.

Decides: how dense the points are.  Must not know: files, or when things appear
(foxglove.py).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import shapely
from foxglove.messages import (
    PackedElementField,
    PackedElementFieldNumericType,
    PointCloud,
    Timestamp,
)

from coordinator.curves.nurbs import Array
from coordinator.exchange.foxglove_scene import FRAME, LINE, Colour, frame_of, pose_at, ring
from coordinator.exchange.motion_story import Leg
from coordinator.plan.document import Floor

_SPACING: Final = 0.05
"""Distance between points of a line [m], unless the line would have more than _MOST points."""

_MOST: Final = 5_000

_AHEAD: Final = 12
"""Number of points of the line that shows where a robot's front is."""

_PLACE: Final = ("x", "y", "z")
_COLOUR: Final = ("red", "green", "blue", "alpha")
_POINT: Final = np.dtype(
    [(name, np.dtype("<f4")) for name in _PLACE] + [(name, np.dtype("u1")) for name in _COLOUR]
)
_KINDS: Final = {
    4: PackedElementFieldNumericType.Float32,
    1: PackedElementFieldNumericType.Uint8,
}


def floor_cloud(floor: Floor, now: Timestamp) -> PointCloud:
    """Return the outlines of the floor and its obstacles."""
    rings = [shapely.LinearRing(corners) for corners in (floor.boundary, *floor.obstacles)]
    lines = [shapely.segmentize(line, _spacing(line.length)) for line in rings]
    return _cloud(FRAME, now, [(shapely.get_coordinates(line), LINE) for line in lines])


def paths_cloud(legs: Sequence[Leg], colours: Sequence[Colour], now: Timestamp) -> PointCloud:
    """Return the robots' paths and their goals as rings, each in its robot's colour."""
    parts = []
    for leg, colour in zip(legs, colours, strict=True):
        length = leg.driven.timeline.length
        count = 2 + math.ceil(length / _spacing(length))
        points = leg.driven.curve.at_arc(np.linspace(0.0, length, count))
        parts += [(points, colour), (points[-1] + ring(leg.driven.radius), colour)]
    return _cloud(FRAME, now, parts)


def robot_cloud(leg: Leg, colour: Colour, now: Timestamp) -> PointCloud:
    """Return a robot's outline and a line that points ahead, in the robot's frame."""
    radius = leg.driven.radius
    ahead = np.column_stack((np.linspace(0.0, radius, _AHEAD), np.zeros(_AHEAD)))
    return _cloud(frame_of(leg.driven.id), now, [(ring(radius), colour), (ahead, colour)])


def _spacing(length: float) -> float:
    return max(_SPACING, length / _MOST)


def _cloud(frame: str, now: Timestamp, parts: Sequence[tuple[Array, Colour]]) -> PointCloud:
    """Return points (n, 2) [m] of several colours as one message."""
    points = np.zeros(sum(len(places) for places, _ in parts), _POINT)
    begin = 0
    for places, colour in parts:
        part = points[begin : begin + len(places)]
        part["x"], part["y"] = places.T
        for name, share in zip(_COLOUR, colour, strict=True):
            part[name] = round(255.0 * share)
        begin += len(places)
    fields = [
        PackedElementField(name=name, offset=offset, type=_KINDS[kind.itemsize])
        for name, (kind, offset, *_) in (_POINT.fields or {}).items()
    ]
    return PointCloud(
        timestamp=now,
        frame_id=frame,
        pose=pose_at(),
        point_stride=_POINT.itemsize,
        fields=fields,
        data=points.tobytes(),
    )
