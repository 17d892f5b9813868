"""Compiled: where two robots on a pair of chords are too near, and a zone as rows for one robot.

Robot "me" is at p + x d, 0 <= x <= length, and the other one at q + y e: both linear in their arc
lengths.  |p - q + x d - y e| <= reach is an ellipse in (x, y), a strip when the chords are
parallel; cut by the rectangle of the two chords it is convex.

Decides: the extents of that set.  Must not know: fleets, nor times.
"""

from __future__ import annotations

import math
from typing import Final

from coordinator.base.compiled import compiled
from coordinator.curves.nurbs_kernels import Array, Indices

SLACK: Final = 1e-9
"""What every reach is widened by [m], so that rounding misses nothing."""

NEAR, LEFT, BOTTOM = 1, 2, 4
"""A pair of chords: near at all; near with me at my chord's begin, with the other at theirs."""


@compiled
def is_near(px: float, py: float, dx: float, dy: float, square: float, reach: float) -> bool:
    """Tell whether a point p from a segment's begin is near the segment d; squares of lengths."""
    along = px * dx + py * dy
    if along <= 0.0:
        return px * px + py * py <= reach
    if along >= square:
        px, py = px - dx, py - dy
        return px * px + py * py <= reach
    across = px * dy - py * dx
    return across * across <= reach * square


@compiled
def sides_near(p: Array, i: int, q: Array, j: int, square: float) -> int:
    """Return NEAR and the sides of the rectangle of chords i and j that hold a conflict, or 0.

    `square` is that of the reach.  Chords are near when one's end is near the other, or they cross.
    """
    dx, dy = p[i + 1, 0] - p[i, 0], p[i + 1, 1] - p[i, 1]
    ex, ey = q[j + 1, 0] - q[j, 0], q[j + 1, 1] - q[j, 1]
    ax, ay = p[i, 0] - q[j, 0], p[i, 1] - q[j, 1]
    dd, ee = dx * dx + dy * dy, ex * ex + ey * ey
    sides = LEFT if is_near(ax, ay, ex, ey, ee, square) else 0
    if is_near(-ax, -ay, dx, dy, dd, square):
        sides |= BOTTOM
    if sides != 0:
        return sides | NEAR
    bx, by, cx, cy = ax + dx, ay + dy, ex - ax, ey - ay
    if is_near(bx, by, ex, ey, ee, square) or is_near(cx, cy, dx, dy, dd, square):
        return NEAR
    parted = (ax * ey - ay * ex > 0.0) != (bx * ey - by * ex > 0.0)
    if parted and (ay * dx - ax * dy > 0.0) != (cx * dy - cy * dx > 0.0):
        return NEAR
    return 0


@compiled
def extent_in(
    ax: float, ay: float, dx: float, dy: float, ex: float, ey: float, reach: float
) -> tuple[float, float]:
    """Return the least and greatest x of |a + x d - y e| <= reach, 0 <= y <= 1.

    There must be such a place.  For fixed y the least x is convex in y: it is least at the
    ellipse's own leftmost y, or at the end of [0, 1] nearer to it.
    """
    dd, ee = dx * dx + dy * dy, ex * ex + ey * ey
    if dd == 0.0:
        return -math.inf, math.inf
    turn, low, high = dx * ey - dy * ex, 0.0, 0.0
    if ee > 0.0:
        dot = (dx * ex + dy * ey) / ee
        begin = (ax * ex + ay * ey) / ee
        if turn != 0.0:
            middle, half = (ay * ex - ax * ey) / turn, reach * math.sqrt(ee) / abs(turn)
            low, high = begin + dot * (middle - half), begin + dot * (middle + half)
            low, high = min(max(low, 0.0), 1.0), min(max(high, 0.0), 1.0)
        else:
            low, high = (0.0, 1.0) if dot > 0.0 else (1.0, 0.0)
    square = reach * reach * dd
    bx, by, cx, cy = ax - low * ex, ay - low * ey, ax - high * ex, ay - high * ey
    left, right = bx * dy - by * dx, cx * dy - cy * dx
    left = bx * dx + by * dy + math.sqrt(max(square - left * left, 0.0))
    right = cx * dx + cy * dy - math.sqrt(max(square - right * right, 0.0))
    return -left / dd, -right / dd


@compiled
def direction(s: Array, p: Array, i: int) -> tuple[float, float]:
    """Return how chord i goes on per metre of arc length; zeros for one without length."""
    size = s[i + 1] - s[i]
    if size <= 0.0:
        return 0.0, 0.0
    return (p[i + 1, 0] - p[i, 0]) / size, (p[i + 1, 1] - p[i, 1]) / size


@compiled
def extent_of(s: Array, p: Array, i: int, q: Array, j: int, reach: float) -> tuple[float, float]:
    """Return the least and greatest arc length on chord i in conflict with chord j."""
    low, high = extent_in(
        p[i, 0] - q[j, 0],
        p[i, 1] - q[j, 1],
        p[i + 1, 0] - p[i, 0],
        p[i + 1, 1] - p[i, 1],
        q[j + 1, 0] - q[j, 0],
        q[j + 1, 1] - q[j, 1],
        reach,
    )
    size = s[i + 1] - s[i]
    low = s[i] + low * size if low > 0.0 else s[i]
    high = s[i] + high * size if high < 1.0 else s[i + 1]
    return min(low, s[i + 1]), max(high, s[i])


@compiled
def zone_rows(
    s_me: Array,
    p_me: Array,
    s_other: Array,
    p_other: Array,
    pairs: Indices,
    side: int,
    reach: float,
    cell: float,
    rows: Array,
) -> int:
    """Write one zone as rows (k, low, high) for one robot; return how many, or -needed if too many.

    s (n + 1,) and p (n + 1, 2) are both robots' chords, pairs (m, 2) the zone's, `me` in column
    `side`; reach [m] is the need and both errors.  While my arc length is from k to k + 1 times
    `cell` [m], that of the other robot in conflict runs from low to high [m], exactly.
    """
    reach = reach + SLACK
    least, greatest = math.inf, -math.inf
    for pair in range(len(pairs)):
        i, j = pairs[pair, side], pairs[pair, 1 - side]
        low, high = extent_of(s_me, p_me, i, p_other, j, reach)
        least, greatest = min(least, low), max(greatest, high)
    base = math.floor(least / cell)
    count = int(math.floor(greatest / cell) - base) + 1
    if count > len(rows):
        return -count
    for row in range(count):
        rows[row, 0], rows[row, 1], rows[row, 2] = base + row, math.inf, -math.inf
    for pair in range(len(pairs)):
        i, j = pairs[pair, side], pairs[pair, 1 - side]
        _add_rows(s_me, p_me, i, s_other, p_other, j, reach, cell, rows)
    return count


@compiled
def _place(begin: float, end: float, y: float) -> float:
    """Return the arc length y [m] after a chord's begin, where beyond an end just that end.

    A robot stays at its goal for ever, and a rounding before it only for a moment.
    """
    if y <= 0.0:
        return begin
    return min(begin + y, end) if y < end - begin else end


@compiled
def _add_rows(
    s: Array, p: Array, i: int, t: Array, q: Array, j: int, reach: float, cell: float, rows: Array
) -> None:
    """Widen the rows by what chords i and j have in conflict; rows[0, 0] is the first cell."""
    begin, end = extent_of(s, p, i, q, j, reach)
    ax, ay = p[i, 0] - q[j, 0], p[i, 1] - q[j, 1]
    dx, dy = direction(s, p, i)
    ex, ey = direction(t, q, j)
    ee, base = ex * ex + ey * ey, rows[0, 0]
    first, last = int(math.floor(begin / cell) - base), int(math.floor(end / cell) - base)
    if ee == 0.0:
        for row in range(first, last + 1):
            rows[row, 1], rows[row, 2] = min(rows[row, 1], t[j]), max(rows[row, 2], t[j + 1])
        return
    start, slope = (ax * ex + ay * ey) / ee, (dx * ex + dy * ey) / ee
    across, turn = (ax * ey - ay * ex) / ee, (dx * ey - dy * ex) / ee
    square = reach * reach / ee
    x = begin - s[i]
    middle, far = start + slope * x, across + turn * x
    half = math.sqrt(max(square - far * far, 0.0))
    low, high = middle - half, middle + half
    for row in range(first, last + 1):
        x = min((base + row + 1.0) * cell, end) - s[i]
        middle, far = start + slope * x, across + turn * x
        half = math.sqrt(max(square - far * far, 0.0))
        least, greatest = min(low, middle - half), max(high, middle + half)
        low, high = middle - half, middle + half
        rows[row, 1] = min(rows[row, 1], _place(t[j], t[j + 1], least))
        rows[row, 2] = max(rows[row, 2], _place(t[j], t[j + 1], greatest))
    dd = dx * dx + dy * dy
    if turn == 0.0 or dd == 0.0:
        return
    # Where the other robot's arc length is least and greatest, mine is at right angles.
    centre, wide = (ax * dy - ay * dx) / (ex * dy - ey * dx), reach * math.sqrt(dd) / abs(turn * ee)
    for sign in (-1.0, 1.0):
        y = centre + sign * wide
        x = s[i] - ((ax - y * ex) * dx + (ay - y * ey) * dy) / dd
        if begin <= x <= end:
            row, y = int(math.floor(x / cell) - base), _place(t[j], t[j + 1], y)
            rows[row, 1], rows[row, 2] = min(rows[row, 1], y), max(rows[row, 2], y)
