"""Compiled: whether v^2 times curvature stays below a limit, proven between all places.

With P = (w x, w y, w) and N = (x' w - x w', y' w - y w') in these homogeneous numbers the curvature
is det(P, P', P'') w^3 / |N|^3: polynomials all, and over a short piece each of them is near its
middle's value by the sum of its other coefficients.

Decides: what is certain about curvature.  Must not know: robots or what the limit is for.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from coordinator.base.compiled import compiled
from coordinator.curves.nurbs_kernels import Array, parameters_at

_SHORT: Final = 1e-6
"""Pieces shorter than this [m] are judged by their middle alone."""

_WAITING: Final = 64


@compiled
def _about(powers: Array, offset: float, half: float, coefficients: Array) -> None:
    """Leave the curve as powers of part in [-1, 1] of a piece about `offset`, its middle at 0, 0.

    powers (degree + 1, 3): Taylor series of (A, w) about a place `offset` before the middle.
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
        middle = coefficients[0, axis] / coefficients[0, 2]
        for i in range(count):
            coefficients[i, axis] -= middle * coefficients[i, 2]


@compiled
def _curvature(c: Array) -> tuple[float, float]:
    """Return the curvature at the middle of a piece, and a bound for all of it; inf if none."""
    count = len(c)
    size = 3 * count
    nx, ny, det = np.zeros(size), np.zeros(size), np.zeros(size)
    for i in range(count):
        for j in range(1, count):
            nx[i + j - 1] += j * (c[j, 0] * c[i, 2] - c[i, 0] * c[j, 2])
            ny[i + j - 1] += j * (c[j, 1] * c[i, 2] - c[i, 1] * c[j, 2])
            for k in range(2, count):
                cross = c[i, 0] * (c[j, 1] * c[k, 2] - c[j, 2] * c[k, 1])
                cross += c[i, 1] * (c[j, 2] * c[k, 0] - c[j, 0] * c[k, 2])
                cross += c[i, 2] * (c[j, 0] * c[k, 1] - c[j, 1] * c[k, 0])
                det[i + j + k - 3] += j * k * (k - 1) * cross
    slowest = math.hypot(nx[0], ny[0])
    middle = abs(det[0]) * c[0, 2] ** 3 / slowest**3
    most, heaviest = abs(det[0]), c[0, 2]
    for i in range(1, size):
        slowest -= math.hypot(nx[i], ny[i])
        most += abs(det[i])
        if i < count:
            heaviest += abs(c[i, 2])
    return middle, most * heaviest**3 / slowest**3 if slowest > 0.0 else math.inf


@compiled
def too_sharp(
    borders: Array, powers: Array, table_u: Array, table_s: Array, slope: Array,
    knots_s: Array, knots_w: Array, most: float,
) -> float:  # fmt: skip
    """Return an arc length [m] near which v^2 times curvature may exceed `most`; -1 if nowhere.

    borders, powers: `series` of the curve; then its `arc_table`; v^2 is linear between knots, from
    knots_w[2 k] to knots_w[2 k + 1] in leg k, whose ends are knots_s[k] and knots_s[k + 1].
    """
    coefficients, ends = np.empty((powers.shape[1], 3)), np.empty(2)
    waiting = np.empty((_WAITING, 2))
    joints = np.interp(borders, table_u, table_s)
    leg = span = 0
    begin = 0.0
    while leg < len(knots_s) - 1 and span < len(powers):
        end = min(knots_s[leg + 1], joints[span + 1])
        waiting[0, 0], waiting[0, 1], top = begin, end, 0
        long = knots_s[leg + 1] - knots_s[leg]
        rise = (knots_w[2 * leg + 1] - knots_w[2 * leg]) / long
        while top >= 0:
            low, high = waiting[top, 0], waiting[top, 1]
            ends[0], ends[1] = low, high
            u = parameters_at(table_u, table_s, slope, ends)
            half = 0.5 * (u[1] - u[0])
            middle = 0.5 * (borders[span] + borders[span + 1])
            _about(powers[span], u[0] + half - middle, half, coefficients)
            sharp, sharpest = _curvature(coefficients)
            first = knots_w[2 * leg] + rise * (low - knots_s[leg])
            last = first + rise * (high - low)
            if min(first, last) * sharp > most:
                return float(0.5 * (low + high))
            top -= 1
            if not max(first, last) * sharpest <= most and high - low > _SHORT:
                cut = 0.5 * (low + high)
                waiting[top + 1, 0], waiting[top + 1, 1] = cut, high
                waiting[top + 2, 0], waiting[top + 2, 1] = low, cut
                top += 2
        begin = end
        leg += knots_s[leg + 1] <= end
        span += joints[span + 1] <= end
    return -1.0
