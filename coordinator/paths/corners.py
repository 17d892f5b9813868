"""Corners of a curve, where it turns on the spot, and rounding those between straight pieces.

Decides: what counts as a corner, and how far it is rounded.  Must not know: robots, floors.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from coordinator.curves.knots import bezier_pieces
from coordinator.curves.nurbs import Array, Nurbs, nurbs
from coordinator.curves.splines import joined
from coordinator.paths.spline_fit import fit

CORNER: Final = 5e-3
"""Directions that differ by more [rad] make a corner; the proof's limit is twice as much."""

BACK: Final = 2.8
"""A corner that turns by this [rad] or more is not rounded: the curve turns back on itself."""

_NO_LEG: Final = 1e-9
"""Control points nearer than this [m] say nothing about a direction."""

_STRAIGHT: Final = 1e-6
"""A piece whose control points are this near [m] to its chord is straight."""

_SHARE: Final = 0.49
"""The greatest share of a leg over which the corner at its end is rounded."""


class Corner(NamedTuple):
    """Where a curve turns on the spot [m], and by how much [rad]."""

    place: tuple[float, float]
    turn: float


def corners(curve: Nurbs) -> list[Corner]:
    """Return the corners of a curve, in order."""
    return [
        Corner((float(after[0, 0]), float(after[0, 1])), turn)
        for before, after in pairwise(_pieces(curve))
        if (turn := _turn(before, after)) > CORNER
    ]


def still(curve: Nurbs) -> list[tuple[float, float]]:
    """Return where [m] a curve has no direction, because neighbouring control points coincide."""
    return [
        (float(end[0, 0]), float(end[0, 1]))
        for piece in _pieces(curve)
        for end in (piece, piece[::-1])
        if math.dist(end[0], end[1]) <= _NO_LEG
    ]


def rounded(curve: Nurbs, cut: float) -> Nurbs:
    """Return the curve with corners between straight pieces cut by at most `cut` [m].

    Only the corners change.  A curve without corners, or one that turns back on itself, is returned
    unchanged.
    """
    pieces = _pieces(curve)
    turns = [_turn(before, after) for before, after in pairwise(pieces)]
    if not CORNER < max(turns, default=0.0) < BACK:
        return curve
    parts: list[Nurbs] = []
    legs: list[Array] = []
    for piece, bezier in zip(pieces, _beziers(curve), strict=True):
        if _is_straight(piece):
            legs.append(piece[-1])
            legs = legs if len(legs) > 1 else [piece[0], piece[-1]]
            continue
        parts += [_along(legs, cut), bezier] if legs else [bezier]
        legs = []
    return joined([*parts, _along(legs, cut)] if legs else parts)


def _along(vertices: list[Array], cut: float) -> Nurbs:
    """Return the curve along a polyline, its corners cut by at most `cut` [m]."""
    line = np.array(vertices)
    way = np.diff(line, axis=0)
    legs = np.hypot(way[:, 0], way[:, 1])
    if len(legs) == 1:
        return nurbs(1, (0.0, 0.0, legs[0], legs[0]), line)
    units = way / legs[:, None]
    # spline_fit.py: a corner that turns by theta, rounded over d, is cut by d / 3 * sin(theta / 2).
    halves = 0.5 * np.hypot(*np.diff(units, axis=0).T)
    widths = np.minimum(3.0 * cut / np.maximum(halves, 1e-9), _SHARE * np.fmin(legs[:-1], legs[1:]))
    exact = np.zeros(len(line), dtype=np.bool_)
    return fit(line, exact, np.concatenate(([0.0], widths, [0.0]))).curve


def _pieces(curve: Nurbs) -> list[Array]:
    """Return the control points (degree + 1, 2) [m] of each piece that leads anywhere."""
    lifted = bezier_pieces(*curve.lifted)[1]
    control = lifted[:, :, :2] / lifted[:, :, 2:]
    return [piece for piece in control if np.ptp(piece, axis=0).max() > _NO_LEG]


def _beziers(curve: Nurbs) -> list[Nurbs]:
    """Return the pieces that lead anywhere, as curves."""
    borders, lifted = bezier_pieces(*curve.lifted)
    degree = curve.degree
    return [
        Nurbs(degree, np.repeat((0.0, width), degree + 1), piece[:, :2] / piece[:, 2:], piece[:, 2])
        for width, piece in zip(np.diff(borders).tolist(), lifted, strict=True)
        if np.ptp(piece[:, :2] / piece[:, 2:], axis=0).max() > _NO_LEG
    ]


def _turn(before: Array, after: Array) -> float:
    """Return by how much [rad] the direction changes between two pieces."""
    (ax, ay), (bx, by) = -_direction(before[::-1]), _direction(after)
    return abs(math.atan2(ax * by - ay * bx, ax * bx + ay * by))


def _direction(points: Array) -> Array:
    """Return the unit direction in which a piece leaves its first control point."""
    legs = points - points[0]
    sizes = np.hypot(legs[:, 0], legs[:, 1])
    first = int(np.argmax(sizes > _NO_LEG))
    return np.asarray(legs[first] / sizes[first])


def _is_straight(piece: Array) -> bool:
    """Return whether a piece leads straight from its first control point to its last."""
    chord = piece[-1] - piece[0]
    size = math.hypot(*chord)
    if size <= _STRAIGHT:
        return False
    along = (piece - piece[0]) @ chord / size
    across = (piece - piece[0]) @ (-chord[1], chord[0]) / size
    forwards = bool((np.diff(along) >= -_STRAIGHT).all())
    return forwards and bool(np.abs(across).max() <= _STRAIGHT)
