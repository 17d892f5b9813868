"""Entities of a DXF drawing as chains of hulls.

Decides: which entities are outlines and how each is approximated.  Must not know: layers, units,
which outline encloses which.  All lengths are in the drawing's unit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from ezdxf.entities.arc import Arc
from ezdxf.entities.circle import Circle
from ezdxf.entities.dxfentity import DXFEntity
from ezdxf.entities.ellipse import Ellipse
from ezdxf.entities.line import Line
from ezdxf.entities.lwpolyline import LWPolyline
from ezdxf.entities.polyline import Polyline
from ezdxf.entities.spline import Spline
from ezdxf.math import Vec3

from coordinator.scenario.checks import printable
from coordinator.scenario_files.maps.curve_hulls import CurveError, Hulls, arc, bulged, line, spline

OUTLINES: Final = (LWPolyline, Polyline, Circle, Arc, Ellipse, Spline, Line)
OUTLINE_NAMES: Final = "LWPOLYLINE, POLYLINE, CIRCLE, ARC, ELLIPSE, SPLINE, LINE"
REMARKS: Final = (
    "TEXT", "MTEXT", "ATTDEF", "ATTRIB", "DIMENSION", "ARC_DIMENSION", "LEADER", "MULTILEADER",
    "TOLERANCE", "POINT", "RAY", "XLINE", "VIEWPORT",
)  # fmt: skip
"""Annotations for people who read the drawing; they enclose nothing."""

_FRAME: Final = 16
"""The flag of a polyline's vertex that is a control point of a spline and not on the line."""

Corner = tuple[float, float, float]
"""A polyline's corner: x, y and the bulge of the edge that follows."""


def layer_of(entity: DXFEntity) -> str:
    """Return the layer's name as written; entities that ezdxf does not know may have none."""
    return str(entity.dxf.layer) if entity.dxf.hasattr("layer") else "0"


def name_of(entity: DXFEntity) -> str:
    """Return a name by which a person finds the entity in the drawing."""
    return printable(f"{entity.dxftype()} #{entity.dxf.handle} on layer {layer_of(entity)}")


def hulls_of(entity: DXFEntity, tolerance: float) -> Hulls:
    """Return the hulls of an entity, in order; those of a closed entity end where they begin.

    Raises CurveError when the entity cannot be approximated.
    """
    hulls: Hulls = []
    if isinstance(entity, Line):
        start, end = entity.dxf.start, entity.dxf.end
        hulls = line((start.x, start.y), (end.x, end.y))
    elif isinstance(entity, Circle):
        hulls = _mirrored(entity, _arc(entity, tolerance))
    elif isinstance(entity, Ellipse):
        hulls = _ellipse(entity, tolerance)
    elif isinstance(entity, Spline):
        hulls = _spline(entity, tolerance)
    elif isinstance(entity, LWPolyline):
        corners = [(float(x), float(y), float(b)) for x, y, b in entity.get_points("xyb")]
        hulls = _mirrored(entity, _polyline(corners, entity.closed, tolerance))
    elif isinstance(entity, Polyline):
        hulls = _old_polyline(entity, tolerance)
    if not hulls:
        raise CurveError("has no length")
    return hulls


def _mirrored(entity: DXFEntity, hulls: Hulls) -> Hulls:
    """Return hulls drawn in the entity's own plane as they look from above."""
    x, y, z = entity.dxf.extrusion
    if math.hypot(x, y) > 1e-6 * abs(z):
        raise CurveError("does not lie in the plane of the drawing")
    return hulls if z > 0.0 else [hull * (-1.0, 1.0) for hull in hulls]


def _arc(entity: Circle, tolerance: float) -> Hulls:
    center, radius = Vec3(entity.dxf.center), float(entity.dxf.radius)
    start, sweep = 0.0, 2.0 * math.pi
    if isinstance(entity, Arc):
        start = math.radians(entity.dxf.start_angle)
        sweep = _turn(math.radians(entity.dxf.end_angle) - start)
    major, minor = np.array([radius, 0.0]), np.array([0.0, radius])
    return arc(np.array([center.x, center.y]), major, minor, start, sweep, tolerance)


def _ellipse(entity: Ellipse, tolerance: float) -> Hulls:
    vectors = (entity.dxf.center, entity.dxf.major_axis, entity.minor_axis)
    center, major, minor = (np.array([vector.x, vector.y]) for vector in map(Vec3, vectors))
    start = float(entity.dxf.start_param)
    return arc(center, major, minor, start, _turn(entity.dxf.end_param - start), tolerance)


def _spline(entity: Spline, tolerance: float) -> Hulls:
    curve = entity.construction_tool()
    points = np.array([(point.x, point.y) for point in curve.control_points])
    weights = np.array(curve.weights()) if curve.is_rational else np.ones(len(points))
    return spline(curve.degree, np.array(curve.knots()), points, weights, tolerance)


def _old_polyline(entity: Polyline, tolerance: float) -> Hulls:
    """Follow a POLYLINE, whose vertices are separate entities."""
    if not (entity.is_2d_polyline or entity.is_3d_polyline):
        raise CurveError("is a mesh, not an outline")
    vertices = [vertex.dxf for vertex in entity.vertices if not vertex.dxf.flags & _FRAME]
    corners = [(v.location.x, v.location.y, float(v.get("bulge", 0.0))) for v in vertices]
    hulls = _polyline(corners, entity.is_closed, tolerance)
    return _mirrored(entity, hulls) if entity.is_2d_polyline else hulls


def _polyline(corners: Sequence[Corner], closed: bool, tolerance: float) -> Hulls:
    hulls: Hulls = []
    following = [*corners[1:], *(corners[:1] if closed else ())]
    for (x, y, bulge), after in zip(corners, following, strict=False):
        hulls += bulged((x, y), after[:2], bulge, tolerance)
    return hulls


def _turn(angle: float) -> float:
    """Return an angle as a turn to the left in (0, 2 pi]; zero becomes a full turn."""
    turn = angle % (2.0 * math.pi)
    return turn if turn > 1e-12 else 2.0 * math.pi
