"""What viewers draw of a story: floor, obstacles, paths, zones, robots.

Decides: shapes and colours, those of Okabe and Ito.  Must not know: files, or when things appear
(export_foxglove.py).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import shapely

from coordinator.export import Leg
from coordinator.export_schema import (
    LINE_LOOP,
    LINE_STRIP,
    ArrowPrimitive,
    Color,
    CylinderPrimitive,
    LinePrimitive,
    Point3,
    Pose,
    SceneEntity,
    TextPrimitive,
    Time,
    TriangleListPrimitive,
    Vector3,
)
from coordinator.nurbs import Array
from coordinator.plan import Floor, Reason

FRAME: Final = "floor"
"""The frame that everything stands in; each robot has one of its own."""

_COLOURS: Final = ("0072b2", "d55e00", "009e73", "cc79a7", "e69f00", "56b4e9", "8c8c8c", "a59a00")
_LINE: Final = Color(0.55, 0.57, 0.6)
_SOLID: Final = Color(0.55, 0.57, 0.6, 0.5)
_ZONE: Final = Color(0.9, 0.62, 0.0, 0.25)
_LIT: Final = Color(0.9, 0.62, 0.0, 0.95)

_HEIGHT: Final = 0.2
"""How high robots are drawn [m]."""

_CORNERS: Final = 48
_ZONE_STEP: Final = 0.05


def frame_of(robot: str) -> str:
    """Return the name of a robot's frame."""
    return f"robot/{robot}"


def colour_of(index: int) -> Color:
    """Return the colour of a robot by its place among the others."""
    text = _COLOURS[index % len(_COLOURS)]
    red, green, blue = (int(text[i : i + 2], 16) / 255.0 for i in (0, 2, 4))
    return Color(red, green, blue)


def floor_entities(floor: Floor, now: Time) -> list[SceneEntity]:
    """Return the floor's outline and its obstacles, filled."""
    outline = _loop(np.array(floor.boundary), _LINE, 0.03)
    entities = [SceneEntity(timestamp=now, frame_id=FRAME, id="floor", lines=[outline])]
    for number, corners in enumerate(floor.obstacles, start=1):
        entities.append(
            SceneEntity(
                timestamp=now,
                frame_id=FRAME,
                id=f"obstacle/{number}",
                lines=[_loop(np.array(corners), _LINE, 0.02)],
                triangles=[_filled(corners)],
            )
        )
    return entities


def path_entity(leg: Leg, colour: Color, now: Time) -> SceneEntity:
    """Return a robot's path, the places where it stops, and its goal as a ring."""
    points = leg.driven.chain.points
    angles = np.linspace(0.0, math.tau, _CORNERS, endpoint=False)
    ring = points[-1] + leg.driven.radius * np.column_stack((np.cos(angles), np.sin(angles)))
    line = leg.driven.timeline
    stops = [s for s, since in zip(line.s0, line.t0, strict=True) if _rests(leg, s, since)]
    size = Vector3(leg.driven.radius, leg.driven.radius, 0.01)
    return SceneEntity(
        timestamp=now,
        frame_id=FRAME,
        id=f"path/{leg.driven.id}",
        lines=[_line(LINE_STRIP, points, colour, 0.03), _loop(ring, colour, 0.02)],
        cylinders=[
            CylinderPrimitive(Pose(Vector3(*place)), size, colour)
            for place in (leg.driven.curve.at_arc(stops).tolist() if stops else [])
        ],
    )


def robot_entity(leg: Leg, colour: Color, now: Time) -> SceneEntity:
    """Return a robot's body, an arrow ahead and its name, in a frame of its own."""
    radius, name = leg.driven.radius, leg.driven.id
    body = Pose(Vector3(0.0, 0.0, 0.5 * _HEIGHT))
    above = Pose(Vector3(0.0, 0.0, _HEIGHT))
    label = Pose(Vector3(0.0, 0.0, 2.5 * _HEIGHT))
    ink = Color(1.0, 1.0, 1.0)
    thick = 0.25 * radius
    return SceneEntity(
        timestamp=now,
        frame_id=frame_of(name),
        id=f"robot/{name}",
        cylinders=[CylinderPrimitive(body, Vector3(2 * radius, 2 * radius, _HEIGHT), colour)],
        arrows=[ArrowPrimitive(above, 0.5 * radius, thick, 0.4 * radius, 2.0 * thick, ink)],
        texts=[TextPrimitive(pose=label, font_size=1.2 * radius, color=colour, text=name)],
    )


def zone_entity(
    name: str, reason: Reason, mine: Leg, theirs: Leg, lit: bool, now: Time
) -> SceneEntity:
    """Return a zone that one robot waits to enter: both stretches, and while `lit` who waits."""
    colour = _LIT if lit else _ZONE
    stretches = [_stretch(mine, reason.zone), _stretch(theirs, reason.their_zone)]
    x, y = mine.driven.curve.at_arc([reason.s])[0].tolist()
    text = TextPrimitive(
        pose=Pose(Vector3(x, y, 4.0 * _HEIGHT)),
        font_size=mine.driven.radius,
        color=_LIT,
        text=f"{reason.robot} waits for {reason.yields_to}",
    )
    wide = 0.5 * min(mine.driven.radius, theirs.driven.radius)
    return SceneEntity(
        timestamp=now,
        frame_id=FRAME,
        id=name,
        lines=[_line(LINE_STRIP, points, colour, wide) for points in stretches],
        texts=[text] if lit else [],
    )


def _rests(leg: Leg, s: float, since: float) -> bool:
    """Tell whether a leg of the motion that begins at s at a time begins after a rest."""
    return s > 0.0 and leg.driven.timeline.v_at(math.nextafter(since, -math.inf)) == 0.0


def _stretch(leg: Leg, zone: tuple[float, float]) -> Array:
    low, high = zone
    return leg.driven.curve.at_arc(np.linspace(low, high, 2 + math.ceil((high - low) / _ZONE_STEP)))


def _points(places: Array) -> list[Point3]:
    return [Point3(x, y) for x, y in places.tolist()]


def _line(kind: int, places: Array, colour: Color, thickness: float) -> LinePrimitive:
    return LinePrimitive(type=kind, thickness=thickness, points=_points(places), color=colour)


def _loop(places: Array, colour: Color, thickness: float) -> LinePrimitive:
    return _line(LINE_LOOP, places, colour, thickness)


def _filled(corners: Sequence[tuple[float, float]]) -> TriangleListPrimitive:
    """Return a polygon as triangles, whatever its shape."""
    parts = shapely.constrained_delaunay_triangles(shapely.Polygon(corners))
    rings = [np.asarray(part.exterior.coords)[:3] for part in shapely.get_parts(parts)]
    places = np.concatenate(rings) if rings else np.empty((0, 2))
    return TriangleListPrimitive(points=_points(places), color=_SOLID)
