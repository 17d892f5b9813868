"""Compiled: the search for all places at which two curves come within a tolerance of each other.

Algorithm 1 of the paper, made to find all: where two local convex hulls meet, knots are inserted
half-way (a rational Bezier piece is halved), until a pair of pieces is decided:

- hulls, or the strips along their chords, farther apart than the tolerance: nothing there;
- cones of tangents without a common line: at most one crossing, and Newton's method finds it;
- both rise along one axis and are within twice the tolerance of each other wherever both are: they
  run together.  Different irreducible curves of degrees k and l meet in at most k l points, so
  k l + 1 places are looked at.

The source of the algorithm is Moerken, Reimers and Schulz 2009.  Whatever is left at the size of
the tolerance counts as running together, so every pair is decided.

Decides: which pairs of pieces meet.  Must not know: which of the answers are the same place.
"""

from __future__ import annotations

import math
from typing import Final

from coordinator.base.compiled import compiled
from coordinator.curves.bezier_kernels import (
    CHORD_X,
    CHORD_Y,
    LEAST_SLOPE,
    LENGTH,
    MOST_SLOPE,
    SIZE,
    Array,
    Pieces,
    beside,
    boxes_apart,
    cones_apart,
    facing,
    foot,
    place,
    rises,
    survey,
)
from coordinator.curves.pair_stack_kernels import (
    NEIGHBOURS,
    ROOM,
    SAME,
    STRANGERS,
    Desk,
    cut,
    lay_out,
    settle,
)

APART: Final = 0
CROSS: Final = 1
RUN: Final = 2
CUT: Final = 3

_STEPS: Final = 16
_FLAT: Final = 0.05
"""Sine of the angle between chords below which pieces may run together."""
_BUDGET: Final = 300_000
"""Looks at pairs of pieces that two curves may take ..."""
_FAIR: Final = 200
"""... and those that each pair of whole pieces whose boxes meet may take besides."""


@compiled
def _gap_at(
    desk: Desk, top: int, degrees: tuple[int, int], ex: float, ey: float, at: float
) -> float:
    """Return how far apart two pieces are across e at a place along e; leaves both t in found."""
    t, x, y = foot(desk.lifted[top, 0], degrees[0], ex, ey, at, desk.work)
    other, its_x, its_y = foot(desk.lifted[top, 1], degrees[1], ex, ey, at, desk.work)
    desk.found[0], desk.found[1] = t, other
    return abs(ex * (its_y - y) - ey * (its_x - x))


@compiled
def _alongside(desk: Desk, top: int, degrees: tuple[int, int], tolerance: float) -> int:
    """Decide two pieces by what they do along their common direction: APART, RUN or CUT."""
    a, b = desk.shape[0], desk.shape[1]
    sense = 1.0 if a[CHORD_X] * b[CHORD_X] + a[CHORD_Y] * b[CHORD_Y] >= 0.0 else -1.0
    ex, ey = a[CHORD_X] + sense * b[CHORD_X], a[CHORD_Y] + sense * b[CHORD_Y]
    size = math.sqrt(ex * ex + ey * ey)
    ex, ey = ex / size, ey / size
    if not (rises(a, ex, ey) and rises(b, sense * ex, sense * ey)):
        return CUT
    if sense > 0.0 and desk.relation[top] == NEIGHBOURS:
        return APART
    p, q = desk.corners[0], desk.corners[1]
    first, last = (0, degrees[1]) if sense > 0.0 else (degrees[1], 0)
    low = max(p[0, 0] * ex + p[0, 1] * ey, q[first, 0] * ex + q[first, 1] * ey)
    high = min(p[degrees[0], 0] * ex + p[degrees[0], 1] * ey, q[last, 0] * ex + q[last, 1] * ey)
    if high - low <= tolerance:
        middle = 0.5 * (low + high)
        near = high - low >= -tolerance
        near = near and _gap_at(desk, top, degrees, ex, ey, middle) <= 2.0 * tolerance
        desk.found[2], desk.found[3] = desk.found[1], desk.found[1]
        desk.found[1] = desk.found[0]
        return RUN if near and desk.relation[top] == STRANGERS else APART
    part = 0.41
    for _ in range(degrees[0] * degrees[1] + 1):
        if _gap_at(desk, top, degrees, ex, ey, low + part * (high - low)) > 2.0 * tolerance:
            return CUT
        part = (part + 0.618033988749895) % 1.0
    if _gap_at(desk, top, degrees, ex, ey, high) > 2.0 * tolerance:
        return CUT
    end, its_end = desk.found[0], desk.found[1]
    if _gap_at(desk, top, degrees, ex, ey, low) > 2.0 * tolerance:
        return CUT
    begin, its_begin = desk.found[0], desk.found[1]
    desk.found[0], desk.found[1], desk.found[2], desk.found[3] = begin, end, its_begin, its_end
    return RUN


@compiled
def _touch(desk: Desk, top: int, degrees: tuple[int, int], tolerance: float) -> int:
    """Look whether pieces whose only crossing is off their ends still come within tolerance."""
    a, b, found = desk.lifted[top, 0], desk.lifted[top, 1], desk.found
    s, t = min(max(found[0], 0.0), 1.0), min(max(found[2], 0.0), 1.0)
    gap = math.inf
    for _ in range(4):
        x, y, dx, dy = place(a, degrees[0], s, desk.work)
        its_x, its_y, its_dx, its_dy = place(b, degrees[1], t, desk.work)
        rate = its_dx * its_dx + its_dy * its_dy
        if rate > 0.0:
            t -= ((its_x - x) * its_dx + (its_y - y) * its_dy) / rate
            t = min(max(t, 0.0), 1.0)
        its_x, its_y, its_dx, its_dy = place(b, degrees[1], t, desk.work)
        rate = dx * dx + dy * dy
        if rate > 0.0:
            s += ((its_x - x) * dx + (its_y - y) * dy) / rate
            s = min(max(s, 0.0), 1.0)
        x, y, dx, dy = place(a, degrees[0], s, desk.work)
        gap = math.sqrt((its_x - x) ** 2 + (its_y - y) ** 2)
    found[0], found[1], found[2], found[3] = s, s, t, t
    return RUN if gap <= tolerance else APART


@compiled
def _cross(desk: Desk, top: int, degrees: tuple[int, int], tolerance: float) -> int:
    """Find the only crossing of two pieces, prolonged straight: CROSS, APART, or CUT if unsure."""
    a, b = desk.lifted[top, 0], desk.lifted[top, 1]
    s = t = 0.5
    for step in range(_STEPS):
        x, y, dx, dy = place(a, degrees[0], s, desk.work)
        its_x, its_y, its_dx, its_dy = place(b, degrees[1], t, desk.work)
        if step == 0:
            dx, dy = (
                desk.shape[0, CHORD_X] * desk.shape[0, LENGTH],
                desk.shape[0, CHORD_Y] * desk.shape[0, LENGTH],
            )
            its_dx, its_dy = (
                desk.shape[1, CHORD_X] * desk.shape[1, LENGTH],
                desk.shape[1, CHORD_Y] * desk.shape[1, LENGTH],
            )
        x, y = its_x - x, its_y - y
        det = dy * its_dx - dx * its_dy
        if det == 0.0:
            return CUT
        ds, dt = (its_dx * y - its_dy * x) / det, (dx * y - dy * x) / det
        s, t = s + ds, t + dt
        if step > 0 and abs(ds) + abs(dt) < 1e-9:
            break
    else:
        return CUT
    out = max(-s, s - 1.0, 0.0) * math.sqrt(dx * dx + dy * dy)
    its_out = max(-t, t - 1.0, 0.0) * math.sqrt(its_dx * its_dx + its_dy * its_dy)
    desk.found[0], desk.found[1], desk.found[2], desk.found[3] = s, s, t, t
    if out == 0.0 and its_out == 0.0:
        return CROSS
    return _touch(desk, top, degrees, tolerance) if out + its_out < 1e4 * tolerance else APART


@compiled
def _examine(desk: Desk, top: int, degrees: tuple[int, int], tolerance: float) -> int:
    """Decide the pair on top: APART, CROSS or RUN (where, is left in found), or CUT."""
    relation, a, b = desk.relation[top], desk.shape[0], desk.shape[1]
    survey(desk.lifted[top, 0], degrees[0], desk.corners[0], a)
    survey(desk.lifted[top, 1], degrees[1], desk.corners[1], b)
    p, q = desk.corners[0], desk.corners[1]
    if relation == STRANGERS and (
        boxes_apart(a, b, tolerance)
        or beside(a, p, q, degrees[1], tolerance)
        or beside(b, q, p, degrees[0], tolerance)
    ):
        return APART
    if top + 4 > ROOM or max(a[SIZE], b[SIZE]) <= 0.5 * tolerance:
        desk.found[:] = 0.5
        return RUN if relation == STRANGERS else APART
    if relation == SAME:
        return APART if a[MOST_SLOPE] < math.inf else CUT
    if min(a[LEAST_SLOPE], b[LEAST_SLOPE]) < -1.0 or max(a[MOST_SLOPE], b[MOST_SLOPE]) > 1.0:
        return CUT
    disjoint = cones_apart(a, b)
    if not disjoint or abs(a[CHORD_X] * b[CHORD_Y] - a[CHORD_Y] * b[CHORD_X]) < _FLAT:
        verdict = _alongside(desk, top, degrees, tolerance)
        if verdict != CUT:
            return verdict
    if disjoint:
        return APART if relation == NEIGHBOURS else _cross(desk, top, degrees, tolerance)
    return CUT


@compiled
def search(
    pieces: Pieces, one: int, other: int, tolerance: float, limited: bool, desk: Desk, rows: Array
) -> tuple[Array, int]:
    """Find where two curves (or, the same one twice, a curve and itself) come together.

    Returns rows (kind, u0, u1, v0, v1) and how many count, -1 when that takes longer than is fair:
    the curves then run beside each other at little more than the tolerance.
    """
    degrees, count, budget = (pieces.degree[one], pieces.degree[other]), 0, _BUDGET
    begin, end, its_begin, its_end = facing(pieces, one, other, tolerance, desk.found)
    for i in range(begin, end):
        for j in range(i if one == other else its_begin, its_end):
            if boxes_apart(pieces.boxes[i], pieces.boxes[j], tolerance):
                continue
            lay_out(pieces, i, j, degrees, one == other, desk)
            top, budget = 0, budget + _FAIR
            while top >= 0:
                budget -= 1
                if limited and budget < 0:
                    return rows, -1
                verdict = _examine(desk, top, degrees, tolerance)
                if verdict == CUT:
                    top = cut(desk, top, degrees)
                    continue
                if verdict != APART:
                    rows = settle(desk, top, verdict, rows, count)
                    count += 1
                top -= 1
    return rows, count
