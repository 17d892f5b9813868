"""Makes the entities that viewers draw of a story: floor, obstacles, paths, zones, robots.

Decides: their shapes, and their colours, which are those of Okabe and Ito.  Must not know: files,
or when things appear (foxglove.py).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
import shapely
from foxglove.messages import (
    ArrowPrimitive,
    Color,
    CylinderPrimitive,
    Duration,
    LinePrimitive,
    LinePrimitiveLineType,
    Point3,
    Pose,
    Quaternion,
    SceneEntity,
    TextPrimitive,
    Timestamp,
    TriangleListPrimitive,
    Vector3,
)

from coordinator.curves.nurbs import Array
from coordinator.exchange.motion_story import Leg
from coordinator.plan.document import Floor, Reason

FRAME: Final = "floor"
"""The frame of the floor; the frame of each robot is relative to it."""


class Colour(NamedTuple):
    """Red, green, blue and opacity, each from 0 to 1."""

    r: float
    g: float
    b: float
    a: float = 1.0


LINE: Final = Colour(0.55, 0.57, 0.6)
"""The colour of the floor's outline and of obstacles."""

_COLOURS: Final = ("0072b2", "d55e00", "009e73", "cc79a7", "e69f00", "56b4e9", "8c8c8c", "a59a00")
_SOLID: Final = LINE._replace(a=0.5)
_ZONE: Final = Colour(0.9, 0.62, 0.0, 0.25)
_LIT: Final = _ZONE._replace(a=0.95)
_INK: Final = Colour(1.0, 1.0, 1.0)

_STRIP: Final = LinePrimitiveLineType.LineStrip
_LOOP: Final = LinePrimitiveLineType.LineLoop

_HEIGHT: Final = 0.2
"""The height of drawn robots [m]."""

_CORNERS: Final = 48
_ZONE_STEP: Final = 0.05


def frame_of(robot: str) -> str:
    """Return the name of a robot's frame."""
    return f"robot/{robot}"


def colour_of(index: int) -> Colour:
    """Return the colour of a robot from its index in the fleet."""
    text = _COLOURS[index % len(_COLOURS)]
    red, green, blue = (int(text[i : i + 2], 16) / 255.0 for i in (0, 2, 4))
    return Colour(red, green, blue)


def ring(radius: float) -> Array:
    """Return points on a circle around the origin, (n, 2) [m]."""
    angles = np.linspace(0.0, math.tau, _CORNERS, endpoint=False)
    return radius * np.column_stack((np.cos(angles), np.sin(angles)))


def pose_at(x: float = 0.0, y: float = 0.0, z: float = 0.0, heading: float = 0.0) -> Pose:
    """Return the pose at a place [m], turned about z by `heading` [rad]."""
    turned = Quaternion(x=0.0, y=0.0, z=math.sin(0.5 * heading), w=math.cos(0.5 * heading))
    return Pose(position=Vector3(x=x, y=y, z=z), orientation=turned)


def floor_entities(floor: Floor, now: Timestamp) -> list[SceneEntity]:
    """Return the floor's outline and its filled obstacles."""
    outline = _line(_LOOP, np.array(floor.boundary), LINE, 0.03)
    entities = [_entity("floor", now, lines=[outline])]
    for number, corners in enumerate(floor.obstacles, start=1):
        edge = _line(_LOOP, np.array(corners), LINE, 0.02)
        filled = [_filled(corners)]
        entities.append(_entity(f"obstacle/{number}", now, lines=[edge], triangles=filled))
    return entities


def path_entity(leg: Leg, colour: Colour, now: Timestamp) -> SceneEntity:
    """Return a robot's path, the places where it stops, and its goal as a ring."""
    points, radius = leg.driven.chain.points, leg.driven.radius
    line = leg.driven.timeline
    stops = [s for s, since in zip(line.s0, line.t0, strict=True) if _rests(leg, s, since)]
    size = Vector3(x=radius, y=radius, z=0.01)
    places = leg.driven.curve.at_arc(stops).tolist() if stops else []
    return _entity(
        f"path/{leg.driven.id}",
        now,
        lines=[
            _line(_STRIP, points, colour, 0.03),
            _line(_LOOP, points[-1] + ring(radius), colour, 0.02),
        ],
        cylinders=[_cylinder(pose_at(x, y), size, colour) for x, y in places],
    )


def robot_entity(leg: Leg, colour: Colour, now: Timestamp) -> SceneEntity:
    """Return a robot's body, an arrow that points ahead, and its name, in the robot's frame."""
    radius, name = leg.driven.radius, leg.driven.id
    size = Vector3(x=2.0 * radius, y=2.0 * radius, z=_HEIGHT)
    arrow = ArrowPrimitive(
        pose=pose_at(z=_HEIGHT),
        shaft_length=0.5 * radius,
        shaft_diameter=0.25 * radius,
        head_length=0.4 * radius,
        head_diameter=0.5 * radius,
        color=_paint(_INK),
    )
    return SceneEntity(
        timestamp=now,
        frame_id=frame_of(name),
        id=f"robot/{name}",
        lifetime=Duration(0),
        frame_locked=True,
        cylinders=[_cylinder(pose_at(z=0.5 * _HEIGHT), size, colour)],
        arrows=[arrow],
        texts=[_label(pose_at(z=2.5 * _HEIGHT), 1.2 * radius, colour, name)],
    )


def zone_entity(
    name: str, reason: Reason, mine: Leg, theirs: Leg, lit: bool, now: Timestamp
) -> SceneEntity:
    """Return a zone that a robot waits to enter: the stretches of both paths.

    If `lit`, they are highlighted, and a label says who waits for whom.
    """
    colour = _LIT if lit else _ZONE
    stretches = [_stretch(mine, reason.zone), _stretch(theirs, reason.their_zone)]
    x, y = mine.driven.curve.at_arc([reason.s])[0].tolist()
    words = f"{reason.robot} waits for {reason.yields_to}"
    label = _label(pose_at(x, y, 4.0 * _HEIGHT), mine.driven.radius, _LIT, words)
    wide = 0.5 * min(mine.driven.radius, theirs.driven.radius)
    return _entity(
        name,
        now,
        lines=[_line(_STRIP, points, colour, wide) for points in stretches],
        texts=[label] if lit else [],
    )


def _rests(leg: Leg, s: float, since: float) -> bool:
    """Return whether the robot stood at arc length s right before time `since`."""
    return s > 0.0 and leg.driven.timeline.v_at(math.nextafter(since, -math.inf)) == 0.0


def _stretch(leg: Leg, zone: tuple[float, float]) -> Array:
    low, high = zone
    return leg.driven.curve.at_arc(np.linspace(low, high, 2 + math.ceil((high - low) / _ZONE_STEP)))


def _entity(
    name: str,
    now: Timestamp,
    lines: list[LinePrimitive],
    *,
    cylinders: list[CylinderPrimitive] | None = None,
    triangles: list[TriangleListPrimitive] | None = None,
    texts: list[TextPrimitive] | None = None,
) -> SceneEntity:
    """Return an entity in the floor's frame that is shown until another of its name replaces it."""
    return SceneEntity(
        timestamp=now,
        frame_id=FRAME,
        id=name,
        lifetime=Duration(0),
        frame_locked=True,
        lines=lines,
        cylinders=cylinders,
        triangles=triangles,
        texts=texts,
    )


def _points(places: Array) -> list[Point3]:
    return [Point3(x=x, y=y, z=0.0) for x, y in places.tolist()]


def _line(
    kind: LinePrimitiveLineType, places: Array, colour: Colour, thickness: float
) -> LinePrimitive:
    return LinePrimitive(
        type=kind,
        pose=pose_at(),
        thickness=thickness,
        points=_points(places),
        color=_paint(colour),
    )


def _paint(colour: Colour) -> Color:
    return Color(r=colour.r, g=colour.g, b=colour.b, a=colour.a)


def _cylinder(pose: Pose, size: Vector3, colour: Colour) -> CylinderPrimitive:
    """Return a cylinder along z, centred at a pose."""
    return CylinderPrimitive(
        pose=pose, size=size, bottom_scale=1.0, top_scale=1.0, color=_paint(colour)
    )


def _label(pose: Pose, size: float, colour: Colour, text: str) -> TextPrimitive:
    """Return a text that faces the viewer, `size` metres high."""
    return TextPrimitive(pose=pose, billboard=True, font_size=size, color=_paint(colour), text=text)


def _filled(corners: Sequence[tuple[float, float]]) -> TriangleListPrimitive:
    """Return a polygon, convex or not, as triangles."""
    parts = shapely.constrained_delaunay_triangles(shapely.Polygon(corners))
    rings = [np.asarray(part.exterior.coords)[:3] for part in shapely.get_parts(parts)]
    places = np.concatenate(rings) if rings else np.empty((0, 2))
    return TriangleListPrimitive(pose=pose_at(), points=_points(places), color=_paint(_SOLID))
