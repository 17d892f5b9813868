"""Lines, arcs and splines of a drawing as chains of hulls that contain them.

Decides: how finely a curve is cut.  Must not know: files and their entities.  A hull is an array
(k, 2) of points: a piece of the curve runs from the first to the last of them and lies inside the
convex hull of all.  No point of that convex hull is farther than the tolerance from the piece.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Hulls = list[Array]

MOST_HULLS: Final = 100_000
"""A curve that needs more hulls is refused: the tolerance is far too small for its size."""
_WIDEST: Final = math.pi / 8
"""Half the angle of the longest piece of an arc: a circle has at least eight pieces."""
_MOST_CUTS: Final = 40
"""The greatest number of times that a piece of a spline is halved."""


class CurveError(ValueError):
    """A curve that cannot be followed; the text says why."""


def line(*points: tuple[float, float]) -> Hulls:
    """Return the hulls of straight lines from point to point; none between equal points."""
    corners = np.array(points, np.float64)
    return [corners[i : i + 2] for i in range(len(corners) - 1) if points[i] != points[i + 1]]


def arc(
    center: Array, major: Array, minor: Array, start: float, sweep: float, tolerance: float
) -> Hulls:
    """Return the hulls of center + major cos t + minor sin t, t from `start` over `sweep` [rad].

    Each hull is a triangle: the ends of the piece and the intersection of the tangents there.  On a
    circle of radius r and over an angle of 2 h, the tip is r (1 / cos h - 1) from the curve and the
    chord is nearer than that.  An ellipse is the affine image of a circle; it is no farther from
    its hulls than the circle around its longer half axis is from the hulls of that circle.
    """
    radius = max(math.hypot(*major), math.hypot(*minor))
    if not radius * tolerance > 0.0:
        raise CurveError("has no size")
    half = min(_WIDEST, math.sqrt(1.8 * tolerance / radius))
    count = math.ceil(abs(sweep) / (2.0 * half))
    if count > MOST_HULLS:
        raise CurveError(f"needs more than {MOST_HULLS} corners")
    half = sweep / (2.0 * max(count, 1))
    angles = start + half * np.arange(2 * count + 1)
    reach = np.where(np.arange(2 * count + 1) % 2 == 1, 1.0 / math.cos(half), 1.0)
    points = center + reach[:, None] * (
        np.cos(angles)[:, None] * major + np.sin(angles)[:, None] * minor
    )
    return [points[i : i + 3] for i in range(0, 2 * count, 2)]


def bulged(a: tuple[float, float], b: tuple[float, float], bulge: float, tol: float) -> Hulls:
    """Return the hulls of a polyline's edge; bulge is tan(angle / 4), positive turning left."""
    if bulge == 0.0 or a == b:
        return line(a, b)
    first, last = np.array(a), np.array(b)
    angle = 4.0 * math.atan(bulge)
    chord = last - first
    middle = 0.5 * (first + last)
    away = (1.0 - bulge * bulge) / (4.0 * bulge)
    center = middle + away * np.array([-chord[1], chord[0]])
    major = first - center
    return arc(center, major, np.array([-major[1], major[0]]), 0.0, angle, tol)


def spline(degree: int, knots: Array, points: Array, weights: Array, tolerance: float) -> Hulls:
    """Return the hulls of a NURBS curve: its Bezier pieces, halved until their hulls are flat.

    knots (n + degree + 1,), points (n, 2), positive weights (n,).
    """
    if len(points) <= degree or len(knots) != len(points) + degree + 1 or degree < 1:
        raise CurveError("its knots and control points do not fit")
    if not (np.diff(knots) >= 0.0).all() or not (weights > 0.0).all():
        raise CurveError("its knots decrease or its weights are not positive")
    homogeneous = np.column_stack((points * weights[:, None], weights))
    pieces = _beziers(degree, knots, homogeneous)
    return [hull for piece in pieces for hull in _flat(piece, tolerance)]


def _beziers(degree: int, knots: Array, points: Array) -> Hulls:
    """Return the Bezier pieces (degree + 1, 3) of a spline, by inserting each knot (Boehm)."""
    low, high = knots[degree], knots[-degree - 1]
    inside = np.unique(knots[(knots >= low) & (knots <= high)])
    for knot in inside:
        many = np.count_nonzero(knots == knot)
        if many > degree and low < knot < high:
            raise CurveError("is broken in two by a knot that is repeated too often")
        for _ in range(degree - many):
            span = int(np.searchsorted(knots, knot, side="right")) - 1
            moved = np.arange(span - degree + 1, span + 1)
            share = ((knot - knots[moved]) / (knots[moved + degree] - knots[moved]))[:, None]
            mixed = share * points[moved] + (1.0 - share) * points[moved - 1]
            points = np.concatenate((points[: span - degree + 1], mixed, points[span:]))
            knots = np.insert(knots, span + 1, knot)
    spans = np.searchsorted(knots, inside[:-1], side="right") - 1
    if not len(spans):
        raise CurveError("has no length")
    return [points[span - degree : span + 1] for span in spans]


def _flat(bezier: Array, tolerance: float) -> Hulls:
    """Return the hulls of a rational Bezier piece (degree + 1, 3), in order."""
    hulls: Hulls = []
    waiting = [(bezier, 0)]
    while waiting:
        piece, cuts = waiting.pop()
        hull = piece[:, :2] / piece[:, 2:]
        if _height(hull) <= tolerance:
            hulls.append(hull)
        elif cuts < _MOST_CUTS and len(hulls) < MOST_HULLS:
            left, right = _halves(piece)
            waiting += [(right, cuts + 1), (left, cuts + 1)]
        else:
            raise CurveError(f"needs more than {MOST_HULLS} corners")
    return hulls


def _height(hull: Array) -> float:
    """Return the greatest distance of the hull's points from its chord."""
    chord = hull[-1] - hull[0]
    square = float(chord @ chord)
    along = (hull - hull[0]) @ chord / square if square > 0.0 else np.zeros(len(hull))
    nearest = hull[0] + np.clip(along, 0.0, 1.0)[:, None] * chord
    return float(np.hypot(*(hull - nearest).T).max())


def _halves(piece: Array) -> tuple[Array, Array]:
    """Cut a Bezier piece in the middle, by de Casteljau."""
    left, right = [piece[0]], [piece[-1]]
    while len(piece) > 1:
        piece = 0.5 * (piece[1:] + piece[:-1])
        left.append(piece[0])
        right.append(piece[-1])
    return np.array(left), np.array(right[::-1])
