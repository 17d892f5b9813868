"""Compiled: where two robots on a pair of chords are too near, and a zone as rows for one robot.

Along a chord a position is linear in the arc length: one robot is at p + x d, the other at q + y e.
The pairs (x, y) with |p - q + x d - y e| <= reach fill an ellipse, or a strip when the chords are
parallel.  The part of it within both chords is convex.

Decides: the extents of that set.  Must not know: fleets, nor times.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from coordinator.base.compiled import allocation_free
from coordinator.curves.nurbs_kernels import Array, Indices

SLACK: Final = 1e-9
"""What every reach is widened by [m], so that rounding misses nothing."""

NEAR, LEFT, BOTTOM = 1, 2, 4
"""Flags of a pair of chords: the robots can be too near at all; they can while the first one is at
the beginning of its chord (the left side of the rectangle of both), while the second one is at the
beginning of its own (the bottom side)."""

CELL_NUMBER, LOW, HIGH = range(3)
"""Columns of rows: the number of a cell, and the least and greatest arc length [m] of the other
robot in conflict with it."""


class Polyline(NamedTuple):
    """Paths as chords: the arc lengths s (n,) [m] of their vertices, and points (n, 2) [m].

    Chord i leads from vertex i to vertex i + 1.
    """

    s: Array
    points: Array


@allocation_free
def is_near(px: float, py: float, dx: float, dy: float, square: float, reach: float) -> bool:
    """Tell whether p is within a distance of the segment from the origin to d.

    `square` is the square of the segment's length, `reach` the square of the distance.
    """
    along = px * dx + py * dy
    if along <= 0.0:
        return px * px + py * py <= reach
    if along >= square:
        px, py = px - dx, py - dy
        return px * px + py * py <= reach
    across = px * dy - py * dx
    return across * across <= reach * square


@allocation_free
def sides_near(p: Array, i: int, q: Array, j: int, square: float) -> int:
    """Return the flags above for chord i of the points p and chord j of the points q; 0 if apart.

    `square` is the square of the reach.  Two chords are near when an end of one is near the other
    one, or when they cross.
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


@allocation_free
def extent_in(
    ax: float, ay: float, dx: float, dy: float, ex: float, ey: float, reach: float
) -> tuple[float, float]:
    """Return the least and greatest x with |a + x d - y e| <= reach for some y from 0 to 1.

    There must be such an x.  The least x for a given y is a convex function of y.  So its minimum
    is at the leftmost point of the ellipse, or at the end of [0, 1] that is nearer to that point.
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


@allocation_free
def direction(s: Array, p: Array, i: int) -> tuple[float, float]:
    """Return the derivative of the position on chord i by arc length; zeros if it has no length."""
    size = s[i + 1] - s[i]
    if size <= 0.0:
        return 0.0, 0.0
    return (p[i + 1, 0] - p[i, 0]) / size, (p[i + 1, 1] - p[i, 1]) / size


@allocation_free
def extent_of(s: Array, p: Array, i: int, q: Array, j: int, reach: float) -> tuple[float, float]:
    """Return the least and greatest arc length [m] on chord i of s, p in conflict with chord j."""
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


@allocation_free
def zone_rows(
    me: Polyline,
    other: Polyline,
    pairs: Indices,
    side: int,
    reach: float,
    cell: float,
    rows: Array,
    spans: Array,
) -> int:
    """Write one zone as rows (n, 3) for the robot `me`; return how many there are.

    pairs (m, 2): the zone's pairs of chords, those of `me` in column `side`.  `reach` [m]: the need
    plus the errors of both paths.  A row tells that while the arc length of `me` lies in cell k,
    from k to k + 1 times `cell` [m], the arc lengths of the other robot in conflict are those from
    LOW to HIGH, exactly.  When `rows` has too little room, none is written and minus the number of
    rows is returned; there is none if the pairs keep the reach.  `spans` (m, 2) is memory for the
    extent of each pair.
    """
    (s, p), q = me, other.points
    reach = reach + SLACK
    least, greatest = math.inf, -math.inf
    for pair in range(len(pairs)):
        i, j = pairs[pair, side], pairs[pair, 1 - side]
        low, high = extent_of(s, p, i, q, j, reach)
        spans[pair, 0], spans[pair, 1] = low, high
        least, greatest = min(least, low), max(greatest, high)
    if least > greatest:
        return 0
    base = math.floor(least / cell)
    count = int(math.floor(greatest / cell) - base) + 1
    if count > len(rows):
        return -count
    for row in range(count):
        rows[row, CELL_NUMBER], rows[row, LOW], rows[row, HIGH] = base + row, math.inf, -math.inf
    for pair in range(len(pairs)):
        i, j = pairs[pair, side], pairs[pair, 1 - side]
        _widen_rows(me, i, other, j, reach, cell, rows, (spans[pair, 0], spans[pair, 1]))
    return count


@allocation_free
def _place(begin: float, end: float, y: float) -> float:
    """Return the arc length `begin` + y [m], limited to the chord from `begin` to `end`.

    An arc length at the end is returned exactly: a robot stays at its goal for ever, but passes any
    place before it, however near, in a moment.
    """
    if y <= 0.0:
        return begin
    return min(begin + y, end) if y < end - begin else end


@allocation_free
def _widen_rows(
    me: Polyline, i: int, other: Polyline, j: int, reach: float, cell: float, rows: Array,
    extent: tuple[float, float],
) -> None:  # fmt: skip
    """Widen LOW to HIGH of the rows by the conflict between chord i of `me` and chord j of `other`.

    The rows are those of consecutive cells.  extent: what `extent_of` returns for the chords.
    """
    (s, p), (t, q) = me, other
    begin, end = extent
    ax, ay = p[i, 0] - q[j, 0], p[i, 1] - q[j, 1]
    dx, dy = direction(s, p, i)
    ex, ey = direction(t, q, j)
    ee, base = ex * ex + ey * ey, rows[0, CELL_NUMBER]
    first, last = int(math.floor(begin / cell) - base), int(math.floor(end / cell) - base)
    if ee == 0.0:
        for row in range(first, last + 1):
            rows[row, LOW] = min(rows[row, LOW], t[j])
            rows[row, HIGH] = max(rows[row, HIGH], t[j + 1])
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
        rows[row, LOW] = min(rows[row, LOW], _place(t[j], t[j + 1], least))
        rows[row, HIGH] = max(rows[row, HIGH], _place(t[j], t[j + 1], greatest))
    dd = dx * dx + dy * dy
    if turn == 0.0 or dd == 0.0:
        return
    # Where the other robot's arc length is least or greatest, the line between both robots is at
    # right angles to chord i.
    centre, wide = (ax * dy - ay * dx) / (ex * dy - ey * dx), reach * math.sqrt(dd) / abs(turn * ee)
    for sign in (-1.0, 1.0):
        y = centre + sign * wide
        x = s[i] - ((ax - y * ex) * dx + (ay - y * ey) * dy) / dd
        if begin <= x <= end:
            row, y = int(math.floor(x / cell) - base), _place(t[j], t[j + 1], y)
            rows[row, LOW], rows[row, HIGH] = min(rows[row, LOW], y), max(rows[row, HIGH], y)
