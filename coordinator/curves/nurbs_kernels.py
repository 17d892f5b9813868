"""Compiled: derivatives of NURBS curves, the table of arc lengths and its inverse.

Decides: how the numbers of nurbs.py are computed.  Must not know: anything but arrays.  Shapes are
not checked here; callers do that.

A curve is C = A / w, where A = w C.  `control` (n, 3) holds its homogeneous control points, rows
(w x, w y, w).  `knots` (n + degree + 1,) is a clamped knot vector that starts at 0.  Parameters
outside the domain are clamped; NaN stays NaN.  Equation numbers refer to the paper.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import compiled

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

X, Y, W = range(3)
"""Components of a homogeneous control point (w x, w y, w); X and Y also of a point."""

RATE, SPEED = 3, 0
"""Rows of the scratch array (6, m) of `measure`: rows RATE + X, RATE + Y and RATE + W receive the
derivatives of (A, w); the result |C'| is written to row SPEED."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_CELLS: Final = 16
"""Number of cells per span in the table of arc lengths."""
_BORDERS = np.linspace(-1.0, 1.0, _CELLS + 1)
_PLACES = np.append(_BORDERS, np.add.outer(_BORDERS[:-1], (_NODES + 1.0) / _CELLS))
"""The ends of a span's cells, then the quadrature nodes of all cells, on a span from -1 to 1."""
_BLOCK: Final = 64
"""Points that are evaluated together: the intermediate results then fit into the L1 cache."""


class Series(NamedTuple):
    """The polynomials (A, w) on the n spans of a curve that are not empty.

    borders (n + 1,): the parameters where spans begin and end.  powers (n, degree + 1, 3): Taylor
    series about the middle of each span; row r has the coefficients of the r-th power of the
    distance from the middle.
    """

    borders: Array
    powers: Array


class ArcTable(NamedTuple):
    """Arc lengths of a curve at the ends of m cells: parameters u, arc lengths s [m] and du/ds.

    All are (m + 1,).
    """

    u: Array
    s: Array
    slope: Array


@compiled
def find_interval(borders: Array, first: int, last: int, at: float, guess: int) -> int:
    """Return the i in [first, last] with borders[i] <= at < borders[i + 1].

    Returns `first` or `last` when `at` lies before or after all of these intervals.  The search is
    quick if `guess`, which has to be in [first, last], is the answer.
    """
    if borders[guess] <= at < borders[guess + 1]:
        return guess
    while first < last:
        middle = (first + last + 1) // 2
        if borders[middle] <= at:
            first = middle
        else:
            last = middle - 1
    return first


@compiled
def clamp(at: float, high: float) -> float:
    """Return a number clamped to [0, high]; NaN stays NaN."""
    if at < 0.0:
        return 0.0
    return high if at > high else at


@compiled
def differences(degree: int, knots: Array, control: Array, order: int) -> Array:
    """Return the control points of (A, w) and of its derivatives up to `order`, (order + 1, n, 3).

    Entry r is the r-th derivative, a spline of degree - r with the knots knots[r:-r].  Only its
    first n - r control points are used.
    """
    count = len(control)
    rows = np.zeros((order + 1, count, 3))
    for i in range(count):
        for axis in range(3):
            rows[0, i, axis] = control[i, axis]
    for r in range(1, min(order, degree) + 1):
        for i in range(count - r):
            width = knots[i + degree + 1] - knots[i + r]
            scale = (degree - r + 1) / width if width > 0.0 else 0.0
            for axis in range(3):
                rows[r, i, axis] = scale * (rows[r - 1, i + 1, axis] - rows[r - 1, i, axis])
    return rows


@compiled
def locate(degree: int, knots: Array, u: Array) -> tuple[Array, Indices, Array]:
    """Return the clamped parameters (m,), their spans (m,), and the knots near them.

    The latter are knots[span - degree + 1] to knots[span + degree], (2 * degree, m).
    """
    at, spans = np.empty(len(u)), np.empty(len(u), np.int64)
    near, span = np.empty((2 * degree, len(u))), degree
    for lane in range(len(u)):
        at[lane] = clamp(u[lane], knots[-1])
        span = find_interval(knots, degree, len(knots) - degree - 2, at[lane], span)
        spans[lane] = span
    for i in range(2 * degree):
        for lane in range(len(u)):
            near[i, lane] = knots[spans[lane] + i + 1 - degree]
    return at, spans, near


@compiled
def lift(degree: int, knots: Array, rows: Array, u: Array) -> Array:
    """Return (A, w) and its derivatives at parameters u (m,): (order + 1, 3, m).

    `rows` are the control points that `differences` returns.  De Boor's algorithm, each step for
    all points together.
    """
    at, spans, near = locate(degree, knots, u)
    lifted, work = np.zeros((len(rows), 3, len(u))), np.empty((degree + 1, 3, len(u)))
    for r in range(min(len(rows) - 1, degree) + 1):
        for i in range(r, degree + 1):
            shift = i - r - degree
            for axis in range(3):
                for lane in range(len(u)):
                    work[i, axis, lane] = rows[r, spans[lane] + shift, axis]
        for level in range(1, degree - r + 1):
            for i in range(degree, level + r - 1, -1):
                for lane in range(len(u)):
                    low = near[i - 1, lane]
                    part = (at[lane] - low) / (near[degree + i - r - level, lane] - low)
                    rest = 1.0 - part
                    for axis in range(3):
                        before = rest * work[i - 1, axis, lane]
                        work[i, axis, lane] = before + part * work[i, axis, lane]
        for axis in range(3):
            for lane in range(len(u)):
                lifted[r, axis, lane] = work[degree, axis, lane]
    return lifted


@compiled
def derivatives(degree: int, knots: Array, control: Array, u: Array, order: int) -> Array:
    """Return C and its derivatives up to `order` at parameters u (m,): (order + 1, m, 2).

    Eq. (9)-(12) for any order: C^(r) = (A^(r) - sum_{i=1..r} (r over i) w^(i) C^(r-i)) / w.
    """
    rows = differences(degree, knots, control, order)
    places = np.empty((order + 1, len(u), 2))
    for start in range(0, len(u), _BLOCK):
        lifted = lift(degree, knots, rows, u[start : start + _BLOCK])
        for r in range(order + 1):
            choose = 1.0
            for i in range(1, r + 1):
                choose = choose * (r - i + 1) / i
                for axis in range(2):
                    for lane in range(lifted.shape[2]):
                        known = lifted[i, W, lane] * lifted[r - i, axis, lane]
                        lifted[r, axis, lane] -= choose * known
            for lane in range(lifted.shape[2]):
                for axis in range(2):
                    lifted[r, axis, lane] /= lifted[0, W, lane]
                    places[r, start + lane, axis] = lifted[r, axis, lane]
    return places


@compiled
def series(degree: int, knots: Array, control: Array) -> Series:
    """Return the Taylor series of (A, w) on each span; they are exact but for rounding."""
    borders, middles, count = np.zeros(len(knots)), np.empty(len(knots)), 0
    for i in range(len(knots) - 1):
        if knots[i] < knots[i + 1]:
            middles[count] = knots[i] + 0.5 * (knots[i + 1] - knots[i])
            count += 1
            borders[count] = knots[i + 1]
    borders, middles = borders[: count + 1], middles[:count]
    lifted = lift(degree, knots, differences(degree, knots, control, degree), middles)
    powers = np.empty((len(middles), degree + 1, 3))
    factorial = 1.0
    for r in range(degree + 1):
        factorial *= max(r, 1)
        for span in range(len(middles)):
            for axis in range(3):
                powers[span, r, axis] = lifted[r, axis, span] / factorial
    return Series(borders, powers)


@compiled
def measure(powers: Array, offsets: Array, work: Array) -> None:
    """Write |C'| at distances (m,) from the middle of a span to work[SPEED].

    powers (degree + 1, 3): the span's Taylor series.  work (6, m) is overwritten.
    """
    for axis in range(6):
        for lane in range(len(offsets)):
            work[axis, lane] = 0.0
    for r in range(len(powers) - 1, -1, -1):
        for axis in range(3):
            power = powers[r, axis]
            for lane in range(len(offsets)):
                value, slope = work[axis, lane], work[RATE + axis, lane]
                work[RATE + axis, lane] = slope * offsets[lane] + value
                work[axis, lane] = value * offsets[lane] + power
    for lane in range(len(offsets)):
        w, rate = work[W, lane], work[RATE + W, lane]
        x = work[RATE + X, lane] - rate * (work[X, lane] / w)
        y = work[RATE + Y, lane] - rate * (work[Y, lane] / w)
        work[SPEED, lane] = math.sqrt(x * x + y * y) / w


@compiled
def integral(values: Array, first: int) -> float:
    """Return the integral over [-1, 1] of a function, given its values at the 8 Gauss nodes.

    The values at the nodes are values[first], values[first + 1] and so on.  Adding them in pairs
    makes the weights add up to exactly 2, so that a straight line has its exact length.
    """
    last, total = first + len(_NODES) - 1, 0.0
    for node in range(len(_NODES) // 2):
        total += _WEIGHTS[node] * (values[first + node] + values[last - node])
    return total


@compiled
def arc_table(borders: Array, powers: Array) -> ArcTable:
    """Return the arc-length table of a curve's Series, with 16 cells per span.

    Each cell is measured by Gauss quadrature with 8 nodes.  Cells without length are left out; a
    curve without length keeps its last cell.  The width of a cell is computed from its rounded
    ends, so that rounding errors cancel along a straight line.
    """
    count = _CELLS * len(powers)
    u, s, slope = np.zeros(count + 1), np.zeros(count + 1), np.empty(count + 1)
    keep, work = np.ones(count + 1, np.bool_), np.empty((6, len(_PLACES)))
    for span in range(len(powers)):
        width = borders[span + 1] - borders[span]
        measure(powers[span], 0.5 * width * _PLACES, work)
        for cell in range(_CELLS):
            here, first = span * _CELLS + cell, _CELLS + 1 + cell * len(_NODES)
            u[here + 1] = borders[span] + width * ((cell + 1) / _CELLS)
            if cell == _CELLS - 1:
                u[here + 1] = borders[span + 1]
            slope[here] = 1.0 / max(work[SPEED, cell], 1e-9)
            size = 0.5 * (u[here + 1] - u[here]) * integral(work[SPEED], first)
            keep[here + 1] = size > 0.0
            s[here + 1] = s[here] + (size if size > 0.0 else 0.0)
    slope[count] = 1.0 / max(work[SPEED, _CELLS], 1e-9)
    keep[count] |= s[count] == 0.0
    return ArcTable(u[keep], s[keep], slope[keep])


@compiled
def arcs_at(borders: Array, powers: Array, table_u: Array, table_s: Array, u: Array) -> Array:
    """Return the arc lengths (m,) [m] from the start to parameters u (m,).

    borders, powers: the curve's Series.  table_u, table_s: from its ArcTable.
    """
    arcs, offsets, work = np.empty(len(u)), np.empty(len(_NODES)), np.empty((6, len(_NODES)))
    cell = span = 0
    for point in range(len(u)):
        at = clamp(u[point], table_u[-1])
        if at == table_u[-1]:
            arcs[point] = table_s[-1]
            continue
        cell = find_interval(table_u, 0, len(table_u) - 2, at, cell)
        span = find_interval(borders, 0, len(powers) - 1, at, span)
        here = max(table_u[cell], borders[span])
        half, middle = 0.5 * (at - here), borders[span] + 0.5 * (borders[span + 1] - borders[span])
        for node in range(len(_NODES)):
            offsets[node] = here + half + half * _NODES[node] - middle
        measure(powers[span], offsets, work)
        arcs[point] = table_s[cell] + half * integral(work[SPEED], 0)
    return arcs


@compiled
def parameters_at(table_u: Array, table_s: Array, slope: Array, s: Array) -> Array:
    """Return the parameters (m,) at arc lengths s (m,) [m].

    They are interpolated by a cubic Hermite polynomial in each cell of an ArcTable.
    """
    parameters, cell = np.empty(len(s)), 0
    for point in range(len(s)):
        at = clamp(s[point], table_s[-1])
        cell = find_interval(table_s, 0, len(table_s) - 2, at, cell)
        size = table_s[cell + 1] - table_s[cell]
        part = (at - table_s[cell]) / size if size > 0.0 else 0.0
        rest = 1.0 - part
        left = rest * rest * ((1.0 + 2.0 * part) * table_u[cell] + part * slope[cell] * size)
        right = (3.0 - 2.0 * part) * table_u[cell + 1] - rest * slope[cell + 1] * size
        parameters[point] = left + part * part * right
    return parameters
