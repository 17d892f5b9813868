"""Compiled: a curve cut into chords that stay within a tolerance, proven by its control points.

A Bezier piece with positive weights lies in the hull of its control points and is no longer than
its control polygon.  The share of the inner control points in it is at most m W / (m W + (1 - m) e)
with m = 1 - 2^(1 - degree), W the largest inner and e the least outer weight, and by that factor
it is nearer to its chord than they are.

Decides: where a curve is cut and how far its chords are out.  Must not know: what chords are for.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from coordinator.base.compiled import compiled
from coordinator.curves.nurbs_kernels import Array, Indices, measure

_ROUNDING: Final = 1e-15
"""Share of all lengths that a sum of them may be out by."""
_AIM: Final = 0.95
"""Share of the tolerance that steps aim at."""
_PLACES: Final = (0.21132486540518713, 0.7886751345948129)
"""Where in a cell the slope of a cubic Hermite piece is out most."""


@compiled
def judge(piece: Array) -> tuple[float, float]:
    """Return how far a Bezier piece is from its chord travelled evenly, and its longest length.

    Across the chord it is out by what its control points allow; along it by at most what it can be
    longer than the chord.
    """
    degree = len(piece) - 1
    x, y = piece[0, 0] / piece[0, 2], piece[0, 1] / piece[0, 2]
    along = piece[degree, 0] / piece[degree, 2] - x
    across = piece[degree, 1] / piece[degree, 2] - y
    square = along * along + across * across
    far = heaviest = polygon = last_x = last_y = 0.0
    for i in range(1, degree + 1):
        dx, dy = piece[i, 0] / piece[i, 2] - x, piece[i, 1] / piece[i, 2] - y
        polygon += math.sqrt((dx - last_x) * (dx - last_x) + (dy - last_y) * (dy - last_y))
        last_x, last_y = dx, dy
        if i < degree:
            part = (dx * along + dy * across) / square if square > 0.0 else 0.0
            part = min(max(part, 0.0), 1.0)
            dx, dy = dx - part * along, dy - part * across
            far = max(far, dx * dx + dy * dy)
            heaviest = max(heaviest, piece[i, 2])
    inner = (1.0 - 0.5 ** (degree - 1)) * heaviest
    outer = 0.5 ** (degree - 1) * min(piece[0, 2], piece[degree, 2])
    far *= (inner / (inner + outer)) ** 2
    longer = max(polygon - math.sqrt(square), 0.0)
    return math.sqrt(far + longer * longer), polygon


@compiled
def cut_piece(piece: Array, part: float, left: Array, right: Array) -> None:
    """Cut a Bezier piece at a share of its parameter: de Casteljau."""
    count = len(piece)
    for axis in range(3):
        for i in range(count):
            right[i, axis] = piece[i, axis]
        for level in range(count):
            left[level, axis] = right[0, axis]
            for i in range(count - 1 - level):
                right[i, axis] = (1.0 - part) * right[i, axis] + part * right[i + 1, axis]


@compiled
def roomy(table: Array, count: int) -> Array:
    """Return a table (n, k) with room for more than `count` rows, the first ones kept."""
    if count < len(table):
        return table
    wider = np.empty((2 * count + 8, table.shape[1]), table.dtype)
    wider[: len(table)] = table
    return wider


@compiled
def cut_evenly(borders: Array, pieces: Array, tolerance: float) -> Array:
    """Cut Bezier pieces (n, degree + 1, 3) between borders (n + 1,) until near their chords.

    Returns a row per part: where it begins (u, x, y), how far it is out, its longest length.  The
    distance from the chord grows with the square of a step, so each step tells the next one; what
    is left at the end of a piece is cut evenly.
    """
    found, count = np.empty((8 * len(borders), 5)), 0
    rest, left, right = np.empty_like(pieces[0]), np.empty_like(pieces[0]), np.empty_like(pieces[0])
    for piece in range(len(pieces)):
        begin, end, grown = borders[piece], borders[piece + 1], False
        rest[:] = pieces[piece]
        step = (end - begin) * min(math.sqrt(_AIM * tolerance / judge(rest)[0]), 1.0)
        while begin < end:
            remaining = end - begin
            part = min(step / remaining, 1.0)
            if part > 0.33:
                part = 1.0 / math.ceil(0.999 / part)
            taken = rest
            if part < 1.0:
                cut_piece(rest, part, left, right)
                taken = left
            far, longest = judge(taken)
            change = math.sqrt(_AIM * tolerance / far)
            if far > tolerance:
                step = part * remaining * min(max(change, 0.2), 0.9)
                continue
            step = part * remaining * min(max(change, 0.5), 2.0)
            if part < 1.0 and change > 1.4 and not grown:
                grown = True
                continue
            grown = False
            found = roomy(found, count)
            found[count, 0], found[count, 3], found[count, 4] = begin, far, longest
            found[count, 1], found[count, 2] = rest[0, 0] / rest[0, 2], rest[0, 1] / rest[0, 2]
            count += 1
            if part == 1.0:
                break
            begin += part * remaining
            rest[:] = right
    return found[:count]


@compiled
def join_straight(
    parts: Array, ends: Array, s: Array, tolerance: float, scale: float
) -> tuple[Indices, float]:
    """Join neighbouring parts to chords; return where chords begin and end, and their error [m].

    ends (m + 1, 2) and s (m + 1,) are the places between parts.  A curve of length L over a chord c
    is at most L t from its one and L (1 - t) from its other end, so by Stewart's theorem its
    distance from the point at share t of the chord is at most sqrt(t (1 - t) (L^2 - c^2)).
    """
    keep, count, error = np.zeros(len(parts) + 1, np.int64), 0, 0.0
    first, longest, far = 0, parts[0, 4], parts[0, 3]
    for i in range(1, len(parts) + 1):
        if i < len(parts):
            longer = longest + parts[i, 4]
            dx, dy = ends[i + 1, 0] - ends[first, 0], ends[i + 1, 1] - ends[first, 1]
            chord = math.sqrt(dx * dx + dy * dy)
            excess = max(longer - chord, 0.0) + _ROUNDING * (scale + longer)
            joined = 0.5 * math.sqrt(excess * (longer + chord))
            if joined <= tolerance or s[i] <= s[first] or s[i + 1] <= s[i]:
                longest, far = longer, joined
                continue
            longest = parts[i, 4]
        error, first, count = max(error, far), i, count + 1
        keep[count] = i
        if i < len(parts):
            far = parts[i, 3]
    return keep[: count + 1], error


@compiled
def inverse_error(
    borders: Array, powers: Array, table_u: Array, table_s: Array, slope: Array
) -> float:
    """Return how far [m] arc lengths may be missed by a cubic Hermite piece per cell.

    The arguments are those of nurbs_kernels.  The inverse is right at both ends of a cell, so it is
    out by at most half a cell's size times what its slope is out.  The slope is looked at in two
    places: where it is out most as long as cells are short.
    """
    worst, span = 0.0, 0
    offsets, rates, work = np.empty(2), np.empty(2), np.empty((6, 2))
    for cell in range(len(table_s) - 1):
        while span < len(powers) - 1 and borders[span + 1] <= table_u[cell]:
            span += 1
        middle = borders[span] + 0.5 * (borders[span + 1] - borders[span])
        size, wide = table_s[cell + 1] - table_s[cell], table_u[cell + 1] - table_u[cell]
        if size <= 0.0:
            continue
        left, right = slope[cell], slope[cell + 1]
        for lane in range(2):
            part = _PLACES[lane]
            rest = 1.0 - part
            u = table_u[cell] + size * part * rest * (rest * left - part * right)
            offsets[lane] = u + wide * part * part * (3.0 - 2.0 * part) - middle
            rate = rest * (rest - 2.0 * part) * left + part * (part - 2.0 * rest) * right
            rates[lane] = rate + 6.0 * part * rest * wide / size
        measure(powers[span], offsets, work)
        for lane in range(2):
            worst = max(worst, 0.5 * size * abs(rates[lane] * work[0, lane] - 1.0))
    return worst
