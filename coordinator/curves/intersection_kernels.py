"""Compiled: the search for all places at which two curves come within a tolerance of each other.

Algorithm 1 of the paper, extended to find all such places.  Where the local convex hulls of two
pieces meet, knots are inserted half-way (a rational Bezier piece is halved), until each pair of
pieces is decided by one of these rules:

- The hulls, or the strips along the chords, are farther apart than the tolerance: no intersection.
- No tangent of one piece is parallel to one of the other: at most one crossing, which Newton's
  method finds.
- Both are monotonic in one direction and within twice the tolerance of each other: they run
  together.  Different irreducible curves of degrees k and l meet in at most k l points, so it is
  enough to compare them in k l + 1 places.

The source of the algorithm is Moerken, Reimers and Schulz 2009.  Pieces as small as the tolerance
that are still near each other count as running together, so every pair is decided.

Decides: which pairs of pieces meet.  Must not know: which results belong to one intersection.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from coordinator.base.compiled import compiled
from coordinator.curves.bezier_kernels import (
    CHORD_X,
    CHORD_Y,
    LEAST_SLOPE,
    LENGTH,
    MOST_SLOPE,
    SIZE,
    Array,
    CurvePair,
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
    U0,
    U1,
    V0,
    V1,
    PairStack,
    append_found,
    halve_top,
    start,
)

APART: Final = 0
CROSS: Final = 1
RUN: Final = 2
CUT: Final = 3
"""Verdicts on a pair of pieces: they are apart, cross once, run together, or have to be halved."""

_STEPS: Final = 16
_FLAT: Final = 0.05
"""Sine of the angle between chords below which pieces may run together."""
_BUDGET: Final = 300_000
"""A limited search for two curves examines at most this many pairs of pieces ..."""
_FAIR: Final = 200
"""... plus this many for each pair of whole pieces whose boxes meet."""


class _Gap(NamedTuple):
    """The distance [m] between a piece's point at t and the other piece's point at its_t."""

    size: float
    t: float
    its_t: float


@compiled
def _gap_at(
    stack: PairStack, top: int, degrees: tuple[int, int], ex: float, ey: float, at: float
) -> _Gap:
    """Return the gap of two pieces across the unit vector e, where both have p . e = `at`."""
    mine = foot(stack.lifted[top, 0], degrees[0], ex, ey, at, stack.work)
    its = foot(stack.lifted[top, 1], degrees[1], ex, ey, at, stack.work)
    return _Gap(abs(ex * (its.y - mine.y) - ey * (its.x - mine.x)), mine.t, its.t)


@compiled
def _remember(stack: PairStack, begin: _Gap, end: _Gap) -> None:
    """Write to `found` where the two pieces on top run together."""
    stack.found[U0], stack.found[U1] = begin.t, end.t
    stack.found[V0], stack.found[V1] = begin.its_t, end.its_t


@compiled
def _alongside(stack: PairStack, top: int, degrees: tuple[int, int], tolerance: float) -> int:
    """Decide a pair by comparing the pieces along the mean direction of their chords.

    Returns APART, CUT, or RUN; for RUN, writes to `found` where they run together.
    """
    a, b = stack.shape[0], stack.shape[1]
    sense = 1.0 if a[CHORD_X] * b[CHORD_X] + a[CHORD_Y] * b[CHORD_Y] >= 0.0 else -1.0
    ex, ey = a[CHORD_X] + sense * b[CHORD_X], a[CHORD_Y] + sense * b[CHORD_Y]
    size = math.sqrt(ex * ex + ey * ey)
    ex, ey = ex / size, ey / size
    if not (rises(a, ex, ey) and rises(b, sense * ex, sense * ey)):
        return CUT
    if sense > 0.0 and stack.relation[top] == NEIGHBOURS:
        return APART
    p, q = stack.corners[0], stack.corners[1]
    first, last = (0, degrees[1]) if sense > 0.0 else (degrees[1], 0)
    low = max(p[0, 0] * ex + p[0, 1] * ey, q[first, 0] * ex + q[first, 1] * ey)
    high = min(p[degrees[0], 0] * ex + p[degrees[0], 1] * ey, q[last, 0] * ex + q[last, 1] * ey)
    if high - low <= tolerance:
        if high - low < -tolerance or stack.relation[top] != STRANGERS:
            return APART
        gap = _gap_at(stack, top, degrees, ex, ey, 0.5 * (low + high))
        _remember(stack, gap, gap)
        return RUN if gap.size <= 2.0 * tolerance else APART
    part = 0.41
    for _ in range(degrees[0] * degrees[1] + 1):
        if _gap_at(stack, top, degrees, ex, ey, low + part * (high - low)).size > 2.0 * tolerance:
            return CUT
        part = (part + 0.618033988749895) % 1.0
    end = _gap_at(stack, top, degrees, ex, ey, high)
    if end.size > 2.0 * tolerance:
        return CUT
    begin = _gap_at(stack, top, degrees, ex, ey, low)
    if begin.size > 2.0 * tolerance:
        return CUT
    _remember(stack, begin, end)
    return RUN


@compiled
def _touch(stack: PairStack, top: int, degrees: tuple[int, int], tolerance: float) -> int:
    """Decide pieces that cross only if extended: RUN if they come within tolerance, else APART.

    Starts from the parameters in `found` and projects each piece's point on the other in turn.
    """
    a, b, found = stack.lifted[top, 0], stack.lifted[top, 1], stack.found
    s, t = min(max(found[U0], 0.0), 1.0), min(max(found[V0], 0.0), 1.0)
    gap = math.inf
    for _ in range(4):
        x, y, dx, dy = place(a, degrees[0], s, stack.work)
        its_x, its_y, its_dx, its_dy = place(b, degrees[1], t, stack.work)
        rate = its_dx * its_dx + its_dy * its_dy
        if rate > 0.0:
            t -= ((its_x - x) * its_dx + (its_y - y) * its_dy) / rate
            t = min(max(t, 0.0), 1.0)
        its_x, its_y, its_dx, its_dy = place(b, degrees[1], t, stack.work)
        rate = dx * dx + dy * dy
        if rate > 0.0:
            s += ((its_x - x) * dx + (its_y - y) * dy) / rate
            s = min(max(s, 0.0), 1.0)
        x, y, dx, dy = place(a, degrees[0], s, stack.work)
        gap = math.sqrt((its_x - x) ** 2 + (its_y - y) ** 2)
    found[U0], found[U1], found[V0], found[V1] = s, s, t, t
    return RUN if gap <= tolerance else APART


@compiled
def _cross(stack: PairStack, top: int, degrees: tuple[int, int], tolerance: float) -> int:
    """Find the only crossing of two pieces, extended straight at their ends, by Newton's method.

    Returns CROSS, RUN, APART, or CUT if the method fails; for CROSS and RUN, writes to `found`
    where the pieces meet.
    """
    a, b = stack.lifted[top, 0], stack.lifted[top, 1]
    s = t = 0.5
    for step in range(_STEPS):
        x, y, dx, dy = place(a, degrees[0], s, stack.work)
        its_x, its_y, its_dx, its_dy = place(b, degrees[1], t, stack.work)
        if step == 0:
            mine, its = stack.shape[0], stack.shape[1]
            dx, dy = mine[CHORD_X] * mine[LENGTH], mine[CHORD_Y] * mine[LENGTH]
            its_dx, its_dy = its[CHORD_X] * its[LENGTH], its[CHORD_Y] * its[LENGTH]
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
    stack.found[U0], stack.found[U1], stack.found[V0], stack.found[V1] = s, s, t, t
    if out == 0.0 and its_out == 0.0:
        return CROSS
    return _touch(stack, top, degrees, tolerance) if out + its_out < 1e4 * tolerance else APART


@compiled
def _examine(stack: PairStack, top: int, degrees: tuple[int, int], tolerance: float) -> int:
    """Return the verdict on the pair on top; for CROSS and RUN, write to `found` where it meets."""
    relation, a, b = stack.relation[top], stack.shape[0], stack.shape[1]
    survey(stack.lifted[top, 0], degrees[0], stack.corners[0], a)
    survey(stack.lifted[top, 1], degrees[1], stack.corners[1], b)
    p, q = stack.corners[0], stack.corners[1]
    if relation == STRANGERS and (
        boxes_apart(a, b, tolerance)
        or beside(a, p, q, degrees[1], tolerance)
        or beside(b, q, p, degrees[0], tolerance)
    ):
        return APART
    if top + 4 > ROOM or max(a[SIZE], b[SIZE]) <= 0.5 * tolerance:
        stack.found[:] = 0.5
        return RUN if relation == STRANGERS else APART
    if relation == SAME:
        return APART if a[MOST_SLOPE] < math.inf else CUT
    if min(a[LEAST_SLOPE], b[LEAST_SLOPE]) < -1.0 or max(a[MOST_SLOPE], b[MOST_SLOPE]) > 1.0:
        return CUT
    disjoint = cones_apart(a, b)
    if not disjoint or abs(a[CHORD_X] * b[CHORD_Y] - a[CHORD_Y] * b[CHORD_X]) < _FLAT:
        verdict = _alongside(stack, top, degrees, tolerance)
        if verdict != CUT:
            return verdict
    if disjoint:
        return APART if relation == NEIGHBOURS else _cross(stack, top, degrees, tolerance)
    return CUT


@compiled
def search(
    pair: CurvePair, tolerance: float, limited: bool, stack: PairStack, rows: Array
) -> tuple[Array, int]:
    """Find where two curves, or a curve and itself, come within the tolerance [m] of each other.

    Returns a table with the columns U0, U1, V0, V1 and KIND, and how many of its rows are results.
    `rows` is the table that is used until it is full.  A limited search that takes too long gives
    up and returns -1: the curves then run beside each other at little more than the tolerance.
    """
    pieces, one, other = pair
    degrees, count, budget = (pieces.degree[one], pieces.degree[other]), 0, _BUDGET
    begin, end, its_begin, its_end = facing(pair, tolerance, stack.found)
    for i in range(begin, end):
        for j in range(i if one == other else its_begin, its_end):
            if boxes_apart(pieces.boxes[i], pieces.boxes[j], tolerance):
                continue
            start(pair, i, j, degrees, stack)
            top, budget = 0, budget + _FAIR
            while top >= 0:
                budget -= 1
                if limited and budget < 0:
                    return rows, -1
                verdict = _examine(stack, top, degrees, tolerance)
                if verdict == CUT:
                    top = halve_top(stack, top, degrees)
                    continue
                if verdict != APART:
                    rows = append_found(stack, top, verdict, rows, count)
                    count += 1
                top -= 1
    return rows, count
