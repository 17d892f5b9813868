"""Compiled: a curve cut into chords whose deviation is proven from its control points.

A Bezier piece with positive weights lies in the convex hull of its control points and is no longer
than its control polygon.  The inner control points together have a share of at most
m W / (m W + (1 - m) e) in each of its points, with m = 1 - 2^(1 - degree), W the largest inner and
e the least outer weight.  The distance of the piece from its chord is at most this share of the
distance of the farthest control point.

Decides: where a curve is cut and how far its chords deviate.  Must not know: what chords are for.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from coordinator.base.compiled import compiled
from coordinator.curves.nurbs_kernels import (
    SPEED,
    ArcTable,
    Array,
    Indices,
    Series,
    W,
    X,
    Y,
    measure,
)

START, START_X, START_Y, DEVIATION, LONGEST = range(5)
"""Columns of the parts that `cut_evenly` returns: the parameter and place [m] where a part begins,
its greatest deviation [m] from a chord driven at constant speed, and its greatest length [m]."""

_ROUNDING: Final = 1e-15
"""Rounding error of a sum of lengths, as a share of it."""
_AIM: Final = 0.95
"""The deviation that a step aims at, as a share of the tolerance."""
_PLACES: Final = (0.21132486540518713, 0.7886751345948129)
"""Where in a cell, as a share of it, the slope of a cubic Hermite polynomial is worst."""


@compiled
def deviation_and_length(piece: Array) -> tuple[float, float]:
    """Return upper bounds of a Bezier piece's deviation and length [m]; piece is (degree + 1, 3).

    The deviation is the distance from a point that drives the chord at constant speed.  Across the
    chord it follows from the control points; along the chord it is at most the difference of the
    lengths of piece and chord.
    """
    degree = len(piece) - 1
    x, y = piece[0, X] / piece[0, W], piece[0, Y] / piece[0, W]
    along = piece[degree, X] / piece[degree, W] - x
    across = piece[degree, Y] / piece[degree, W] - y
    square = along * along + across * across
    far = heaviest = polygon = last_x = last_y = 0.0
    for i in range(1, degree + 1):
        dx, dy = piece[i, X] / piece[i, W] - x, piece[i, Y] / piece[i, W] - y
        polygon += math.sqrt((dx - last_x) * (dx - last_x) + (dy - last_y) * (dy - last_y))
        last_x, last_y = dx, dy
        if i < degree:
            part = (dx * along + dy * across) / square if square > 0.0 else 0.0
            part = min(max(part, 0.0), 1.0)
            dx, dy = dx - part * along, dy - part * across
            far = max(far, dx * dx + dy * dy)
            heaviest = max(heaviest, piece[i, W])
    inner = (1.0 - 0.5 ** (degree - 1)) * heaviest
    outer = 0.5 ** (degree - 1) * min(piece[0, W], piece[degree, W])
    far *= (inner / (inner + outer)) ** 2
    longer = max(polygon - math.sqrt(square), 0.0)
    return math.sqrt(far + longer * longer), polygon


@compiled
def cut_piece(piece: Array, part: float, left: Array, right: Array) -> None:
    """Write both parts of a Bezier piece, cut at the parameter `part`, to `left` and `right`.

    All are (degree + 1, 3); the parameter of each runs from 0 to 1.  De Casteljau's algorithm.
    """
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
    """Return a table (n, k) with more than `count` rows: this one, or a longer copy."""
    if count < len(table):
        return table
    wider = np.empty((2 * count + 8, table.shape[1]), table.dtype)
    wider[: len(table)] = table
    return wider


@compiled
def cut_evenly(borders: Array, pieces: Array, tolerance: float) -> Array:
    """Cut a curve's Bezier pieces (n, degree + 1, 3) into parts that deviate by <= tolerance [m].

    borders (n + 1,): the parameters where pieces begin and end.  Returns a row (5,) per part, with
    the columns named above.  The deviation grows with the square of the step, so the size of each
    step follows from the deviation of the one before.  The rest of a piece is cut evenly.
    """
    found, count = np.empty((8 * len(borders), 5)), 0
    rest, left, right = np.empty_like(pieces[0]), np.empty_like(pieces[0]), np.empty_like(pieces[0])
    for piece in range(len(pieces)):
        begin, end, grown = borders[piece], borders[piece + 1], False
        rest[:] = pieces[piece]
        step = (end - begin) * min(math.sqrt(_AIM * tolerance / deviation_and_length(rest)[0]), 1.0)
        while begin < end:
            remaining = end - begin
            part = min(step / remaining, 1.0)
            if part > 0.33:
                part = 1.0 / math.ceil(0.999 / part)
            taken = rest
            if part < 1.0:
                cut_piece(rest, part, left, right)
                taken = left
            far, longest = deviation_and_length(taken)
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
            found[count, START] = begin
            found[count, START_X] = rest[0, X] / rest[0, W]
            found[count, START_Y] = rest[0, Y] / rest[0, W]
            found[count, DEVIATION], found[count, LONGEST] = far, longest
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
    """Join neighbouring parts (m, 5) to longer chords that deviate by at most `tolerance` [m].

    ends (m + 1, 2) [m] and s (m + 1,) [m]: places and arc lengths between parts; scale [m]: the
    largest coordinate.  Returns the indices of the ends that are kept, and the greatest deviation
    [m].  At the share t of its length a curve of length L is at most L t from its start and
    L (1 - t) from its end.  By Stewart's theorem its distance from the point at the share t of its
    chord c is then at most sqrt(t (1 - t) (L^2 - c^2)).
    """
    keep, count, error = np.zeros(len(parts) + 1, np.int64), 0, 0.0
    first, longest, far = 0, parts[0, LONGEST], parts[0, DEVIATION]
    for i in range(1, len(parts) + 1):
        if i < len(parts):
            longer = longest + parts[i, LONGEST]
            dx, dy = ends[i + 1, 0] - ends[first, 0], ends[i + 1, 1] - ends[first, 1]
            chord = math.sqrt(dx * dx + dy * dy)
            excess = max(longer - chord, 0.0) + _ROUNDING * (scale + longer)
            joined = 0.5 * math.sqrt(excess * (longer + chord))
            if joined <= tolerance or s[i] <= s[first] or s[i + 1] <= s[i]:
                longest, far = longer, joined
                continue
            longest = parts[i, LONGEST]
        error, first, count = max(error, far), i, count + 1
        keep[count] = i
        if i < len(parts):
            far = parts[i, DEVIATION]
    return keep[: count + 1], error


@compiled
def inverse_error(curve: Series, table: ArcTable) -> float:
    """Return an estimate of the greatest error [m] of `parameters_at`, as an arc length.

    The interpolation is exact at both ends of a cell, so its error is at most half the length of
    the cell times the error of its slope.  That error is computed at two places of each cell: those
    where it is greatest in the limit of short cells.
    """
    (borders, powers), (table_u, table_s, slope) = curve, table
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
            worst = max(worst, 0.5 * size * abs(rates[lane] * work[SPEED, lane] - 1.0))
    return worst
