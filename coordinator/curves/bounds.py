"""Guaranteed bounds of a curve: hulls and boxes that contain it, polylines with a proven error.

Decides: how far a curve may be from its approximation, and which parameter has a given arc length,
to a given tolerance.  Must not know: floors, robots or what the bounds are for.

Everything follows from two facts.  With positive weights a point of a curve is a convex combination
of control points, so a Bezier piece lies in the convex hull of its control points.  In this
combination the inner control points together have a share of at most m W / (m W + (1 - m) e), with
m = 1 - 2^(1 - degree), W the largest inner and e the least outer weight (3/4 for a polynomial
cubic).  The distance of the piece from its chord is at most this share of the distance of the
farthest control point.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import compiled
from coordinator.curves.knots import bezier_pieces
from coordinator.curves.nurbs import Array, Nurbs
from coordinator.curves.nurbs_kernels import W, X, Y

_ROUNDING: Final = 1e-12
"""Allowance for rounding in every bound, as a share of the largest coordinate."""

_DEPTH: Final = 16
_STEPS: Final = 64

_START, _DEVIATION, _CORNERS = range(3)
"""Columns of the pieces that `_halve` returns: the parameter where a piece begins, its deviation
[m], and from _CORNERS on its control points x, y, x, y ... [m]."""


@dataclass(frozen=True, eq=False)
class Chain:
    """A curve as m Bezier pieces, end to end.

    u (m + 1,): the parameters between pieces and at both ends.  corners (m, degree + 1, 2) [m]: a
    piece runs from its first corner to its last, in the convex hull of all its corners.
    deviation (m,) [m]: no point of a piece is farther than this from the chord between its ends,
    and no point of the chord is farther than this from the piece.
    """

    u: Array
    corners: Array
    deviation: Array

    @property
    def points(self) -> Array:
        """The ends of the pieces on the curve, (m + 1, 2) [m]."""
        return np.concatenate((self.corners[:, 0], self.corners[-1:, -1]))

    @property
    def lengths(self) -> tuple[float, float]:
        """Bounds of the curve's length [m]: the lengths of all chords and of all polygons."""
        chords = np.hypot(*np.diff(self.points, axis=0).T)
        polygons = np.hypot(*np.diff(self.corners, axis=1).T)
        return float(chords.sum()), float(polygons.sum())

    @cached_property
    def bound(self) -> float:
        """The greatest distance [m] between the curve and the polyline through `points`."""
        return float(self.deviation.max())

    @property
    def boxes(self) -> Array:
        """Boxes (m, 4) [m] that hold the pieces: least x and y, greatest x and y.

        No side is farther from its piece than the piece's deviation.
        """
        spare = _ROUNDING * np.abs(self.corners).max()
        chord = self.corners[:, (0, -1)]
        wide = self.deviation[:, None]
        low = np.maximum(chord.min(axis=1) - wide, self.corners.min(axis=1) - spare)
        high = np.minimum(chord.max(axis=1) + wide, self.corners.max(axis=1) + spare)
        return np.concatenate((low, high), axis=1)


def flatten(curve: Nurbs, tolerance: float) -> Chain:
    """Return the curve in pieces that deviate from their chords by at most `tolerance` [m].

    Spans are halved at most 16 times; each halving reduces the deviation to about a quarter.
    `Chain.bound` is the deviation that was reached, rounding errors included.  With an infinite
    tolerance there is one piece per span.  Raises ValueError for a tolerance below the rounding
    error, weights that are not positive, and curves of degree 0.
    """
    spare = _ROUNDING * float(np.abs(curve.points).max())
    if not tolerance > 2.0 * spare:
        raise ValueError(f"tolerance {tolerance} m is not above what rounding takes, {spare} m")
    if curve.degree == 0 or not curve.weights.min() > 0.0:
        raise ValueError(
            f"degree {curve.degree} and least weight {curve.weights.min()} are not both positive"
        )
    borders, pieces = bezier_pieces(*curve.lifted)
    found = _halve(borders, pieces, tolerance - spare)
    corners = found[:, _CORNERS:].reshape(-1, curve.degree + 1, 2)
    u = np.append(found[:, _START], borders[-1])
    return Chain(u, corners, found[:, _DEVIATION] + spare)


def bounds(curve: Nurbs, tolerance: float) -> Array:
    """Return a box (4,) [m] that holds the curve, at most `tolerance` [m] too large on each side.

    Its entries are least x and y, greatest x and y.
    """
    boxes = flatten(curve, tolerance).boxes
    return np.concatenate((boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)))


def parameter_of(curve: Nurbs, s: npt.ArrayLike, tolerance: float = 1e-10) -> Array:
    """Return the parameters (m,) whose `arc_at` is s (m,) [m] to a tolerance [m]; s is clamped.

    Newton's method from `parameter_at`, kept between bounds by bisection.  With a tolerance below
    the rounding error, about 1e-15 of the length, the result is as accurate as rounding allows.
    """
    wanted = np.clip(np.array(s, dtype=np.float64, ndmin=1), 0.0, curve.length)
    u = curve.parameter_at(wanted)
    low, high = np.zeros_like(u), np.full_like(u, curve.knots[-1])
    for _ in range(_STEPS):
        miss = curve.arc_at(u) - wanted
        far = np.abs(miss) > tolerance
        if not far.any():
            break
        low, high = np.where(miss < 0.0, u, low), np.where(miss > 0.0, u, high)
        speed = np.maximum(np.hypot(*curve.derivatives(u, 1)[1].T), 1e-12)
        newton = u - miss / speed
        inside = (newton > low) & (newton < high)
        u = np.where(far, np.where(inside, newton, 0.5 * (low + high)), u)
    return u


@compiled
def _deviation(lifted: Array) -> float:
    """Return an upper bound of the distance [m] of a piece (degree + 1, 3) from its chord."""
    degree = len(lifted) - 1
    x, y = lifted[0, X] / lifted[0, W], lifted[0, Y] / lifted[0, W]
    along = lifted[degree, X] / lifted[degree, W] - x
    across = lifted[degree, Y] / lifted[degree, W] - y
    square = along * along + across * across
    far = heaviest = 0.0
    for i in range(1, degree):
        dx, dy = lifted[i, X] / lifted[i, W] - x, lifted[i, Y] / lifted[i, W] - y
        part = (dx * along + dy * across) / square if square > 0.0 else 0.0
        part = min(max(part, 0.0), 1.0)
        dx, dy = dx - part * along, dy - part * across
        far = max(far, dx * dx + dy * dy)
        heaviest = max(heaviest, lifted[i, W])
    inner = (1.0 - 0.5 ** (degree - 1)) * heaviest
    outer = 0.5 ** (degree - 1) * min(lifted[0, W], lifted[degree, W])
    return float(math.sqrt(far) * inner / (inner + outer))


@compiled
def _cut(waiting: Array, top: int) -> None:
    """Halve the Bezier piece waiting[top] by de Casteljau's algorithm.

    The right half replaces it, the left half is written to waiting[top + 1].
    """
    count = waiting.shape[1]
    for i in range(count):
        for axis in range(3):
            waiting[top + 1, i, axis] = waiting[top, 0, axis]
            for j in range(count - 1 - i):
                both = waiting[top, j, axis] + waiting[top, j + 1, axis]
                waiting[top, j, axis] = 0.5 * both


@compiled
def _doubled(values: Array) -> Array:
    """Return a copy of a table (m, n) with twice as many rows."""
    wider = np.empty((2 * len(values), values.shape[1]))
    for i in range(len(values)):
        for j in range(values.shape[1]):
            wider[i, j] = values[i, j]
    return wider


@compiled
def _halve(borders: Array, pieces: Array, tolerance: float) -> Array:
    """Halve Bezier pieces (n, degree + 1, 3) until they deviate by <= tolerance [m] from chords.

    borders (n + 1,): the parameters where pieces begin and end.  Returns a row for each of the new
    pieces, with the columns named above.
    """
    corners = pieces.shape[1]
    found, count = np.empty((4 * len(borders), _CORNERS + 2 * corners)), 0
    waiting, level = np.empty((_DEPTH + 1, corners, 3)), np.zeros(_DEPTH + 1, np.int64)
    for span in range(len(pieces)):
        for i in range(corners):
            for axis in range(3):
                waiting[0, i, axis] = pieces[span, i, axis]
        top, begin, width = 0, borders[span], borders[span + 1] - borders[span]
        level[0] = 0
        while top >= 0:
            far = _deviation(waiting[top])
            if far > tolerance and level[top] < _DEPTH:
                _cut(waiting, top)
                level[top] += 1
                level[top + 1] = level[top]
                top += 1
                continue
            if count == len(found):
                found = _doubled(found)
            found[count, _START], found[count, _DEVIATION] = begin, far
            for i in range(corners):
                for axis in range(2):
                    at = _CORNERS + 2 * i + axis
                    found[count, at] = waiting[top, i, axis] / waiting[top, i, W]
            begin += width * 0.5 ** level[top]
            count, top = count + 1, top - 1
    return found[:count]
