"""Compiled: the proof that v^2 times a power of curvature stays below a limit on a whole curve.

Let P = (X, Y, w) be the homogeneous coordinates and N = (X' w - X w', Y' w - Y w').  The curvature
is det(P, P', P'') w^3 / |N|^3.  All of these are polynomials.  On a short piece, written as a
polynomial in [-1, 1], each differs from its value in the middle by at most the sum of the absolute
values of its other coefficients.

Decides: what is certain about curvature.  Must not know: robots or what the limit is for.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from coordinator.base.compiled import allocation_free, compiled
from coordinator.curves.nurbs_kernels import ArcTable, Array, Series, W, X, Y, parameters_at

_SHORT: Final = 1e-6
"""Pieces shorter than this [m] are judged by their middle alone."""

_WAITING: Final = 64
"""Size of the stack of pieces that are not decided yet."""


@allocation_free
def _about(powers: Array, offset: float, half: float, coefficients: Array) -> None:
    """Write a piece of a curve as polynomials in [-1, 1] to `coefficients` (degree + 1, 3).

    powers (degree + 1, 3): Taylor series of (A, w).  The middle of the piece is at the parameter
    `offset` of this series, its ends are at `offset` -+ `half`.  The piece is moved so that its
    middle is at the origin.
    """
    count = len(powers)
    for axis in range(3):
        for i in range(count):
            coefficients[i, axis] = powers[i, axis]
        for i in range(count - 1):
            for j in range(count - 2, i - 1, -1):
                coefficients[j, axis] += offset * coefficients[j + 1, axis]
        scale = 1.0
        for i in range(count):
            coefficients[i, axis] *= scale
            scale *= half
    for axis in range(2):
        middle = coefficients[0, axis] / coefficients[0, W]
        for i in range(count):
            coefficients[i, axis] -= middle * coefficients[i, W]


@compiled
def _curvature(c: Array) -> tuple[float, float]:
    """Return the curvature [1/m] in the middle of a piece and an upper bound for the whole piece.

    c (degree + 1, 3): the piece as `_about` writes it.  The bound is infinite if the piece is too
    long to tell.
    """
    count = len(c)
    size = 3 * count
    nx, ny, det = np.zeros(size), np.zeros(size), np.zeros(size)
    for i in range(count):
        for j in range(1, count):
            nx[i + j - 1] += j * (c[j, X] * c[i, W] - c[i, X] * c[j, W])
            ny[i + j - 1] += j * (c[j, Y] * c[i, W] - c[i, Y] * c[j, W])
            for k in range(2, count):
                cross = c[i, X] * (c[j, Y] * c[k, W] - c[j, W] * c[k, Y])
                cross += c[i, Y] * (c[j, W] * c[k, X] - c[j, X] * c[k, W])
                cross += c[i, W] * (c[j, X] * c[k, Y] - c[j, Y] * c[k, X])
                det[i + j + k - 3] += j * k * (k - 1) * cross
    slowest = math.hypot(nx[0], ny[0])
    middle = abs(det[0]) * c[0, W] ** 3 / slowest**3
    most, heaviest = abs(det[0]), c[0, W]
    for i in range(1, size):
        slowest -= math.hypot(nx[i], ny[i])
        most += abs(det[i])
        if i < count:
            heaviest += abs(c[i, W])
    return middle, most * heaviest**3 / slowest**3 if slowest > 0.0 else math.inf


@compiled
def too_sharp(
    curve: Series, table: ArcTable, knots_s: Array, squares: Array, power: int, most: float
) -> float:
    """Return an arc length [m] near which v^2 k^power may exceed `most`; -1 if nowhere.

    k: the curvature [1/m].  power: 1 for the acceleration across the path, 2 for the turn rate.
    knots_s (n + 1,) [m]: the ends of the legs.  squares (n, 2): v^2 at both ends of each leg;
    between them it is linear in the arc length.
    """
    borders, powers = curve
    coefficients, ends = np.empty((powers.shape[1], 3)), np.empty(2)
    starts, stops = np.empty(_WAITING), np.empty(_WAITING)
    joints = np.interp(borders, table.u, table.s)
    leg = span = 0
    begin = 0.0
    while leg < len(knots_s) - 1 and span < len(powers):
        end = min(knots_s[leg + 1], joints[span + 1])
        starts[0], stops[0], top = begin, end, 0
        long = knots_s[leg + 1] - knots_s[leg]
        rise = (squares[leg, 1] - squares[leg, 0]) / long
        while top >= 0:
            low, high = starts[top], stops[top]
            ends[0], ends[1] = low, high
            u = parameters_at(table.u, table.s, table.slope, ends)
            half = 0.5 * (u[1] - u[0])
            middle = 0.5 * (borders[span] + borders[span + 1])
            _about(powers[span], u[0] + half - middle, half, coefficients)
            sharp, sharpest = _curvature(coefficients)
            first = squares[leg, 0] + rise * (low - knots_s[leg])
            last = first + rise * (high - low)
            if min(first, last) * sharp**power > most:
                return float(0.5 * (low + high))
            top -= 1
            if not max(first, last) * sharpest**power <= most and high - low > _SHORT:
                cut = 0.5 * (low + high)
                starts[top + 1], stops[top + 1] = cut, high
                starts[top + 2], stops[top + 2] = low, cut
                top += 2
        begin = end
        leg += knots_s[leg + 1] <= end
        span += joints[span + 1] <= end
    return -1.0
