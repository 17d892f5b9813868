"""Compiled: points and overlaps, made from what the search for intersections finds.

Wherever two curves stay within a tolerance of each other, they have one intersection.  It is an
overlap if both curves coincide from one border of a piece to another, as irreducible curves do.
Otherwise it is a point: the crossing, or the place where the tangents are parallel.

Decides: which results of the search belong to one intersection, and of what kind it is.  Must not
know: how the search works.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import compiled
from coordinator.curves.bezier_kernels import Array, CurvePair, Indices, Pieces
from coordinator.curves.crossing_kernels import (
    PAIR,
    PLACE_X,
    PLACE_Y,
    U,
    V,
    is_trivial,
    point_at,
    project,
    touch_in,
)
from coordinator.curves.intersection_kernels import CROSS, search
from coordinator.curves.pair_stack_kernels import KIND, U0, U1, V0, V1, PairStack, make_stack

_COARSE: Final = 1e-4
"""Below this tolerance [m] a search that takes too long is repeated with a tenfold tolerance."""
_REACH: Final = 0.03
"""Results farther apart [m] belong to one intersection only if an overlap joins them."""
_SAME: Final = 1e-7
"""Crossings of one intersection count as one if they are nearer than this [m]; if they are farther
apart, the curves touch between them, and the touch is the intersection."""
_SHORTEST: Final = 1e-6
"""Least length [m] of an overlap that begins and ends at borders of pieces ..."""
_LONG: Final = 0.25
"""... and of any other overlap."""


class IntersectionTables(NamedTuple):
    """The intersections of many pairs of curves.

    points (n, 5) have the columns U, V, PLACE_X, PLACE_Y, PAIR; overlaps (m, 5) have U0, U1, V0,
    V1, PAIR.  tolerances [m], one per pair: the tolerance that was used, which is coarser than
    the given one if the search took too long.
    """

    points: Array
    overlaps: Array
    tolerances: Array


class _Results(NamedTuple):
    """What the search found for a pair of curves, sorted by least x.

    rows (n, 5): ranges and kinds.  ends (n, 2, 2) [m]: the first curve's places at U0 and U1.
    group (n,): disjoint sets of results that belong to one intersection; each entry is the index of
    another member, or the result's own index if it is the root of its set.  overlap (n,): at a
    root, whether the set is an overlap.
    """

    rows: Array
    ends: Array
    group: Indices
    overlap: npt.NDArray[np.bool_]


class _Point(NamedTuple):
    """Parameters u and v on two curves, and the place x, y [m] there."""

    u: float
    v: float
    x: float
    y: float


@compiled
def find_all(pieces: Pieces, pairs: Indices, tolerance: float) -> IntersectionTables:
    """Return the intersections of each pair (m, 2) of curves, to a tolerance [m]."""
    stack = make_stack(int(np.max(pieces.degree)) + 1)
    rows, points, overlaps = np.empty((64, 5)), np.empty((64, 5)), np.empty((16, 5))
    used = np.full(len(pairs), tolerance)
    found = over = 0
    for number in range(len(pairs)):
        pair, fine = CurvePair(pieces, pairs[number, 0], pairs[number, 1]), tolerance
        rows, count = search(pair, fine, fine < _COARSE, stack, rows)
        while count < 0:
            fine *= 10.0
            rows, count = search(pair, fine, fine < _COARSE, stack, rows)
        used[number] = fine
        if count == 0:
            continue
        new, new_over = _sort_out(pair, fine, stack, rows[:count])
        new[:, PAIR], new_over[:, PAIR] = number, number
        points = _with_room(points, found + len(new))
        overlaps = _with_room(overlaps, over + len(new_over))
        points[found : found + len(new)] = new
        overlaps[over : over + len(new_over)] = new_over
        found, over = found + len(new), over + len(new_over)
    return IntersectionTables(points[:found], overlaps[:over], used)


@compiled
def _with_room(values: Array, count: int) -> Array:
    """Return a table with at least `count` rows: this one, or a longer copy."""
    if count <= len(values):
        return values
    longer = np.empty((2 * count, values.shape[1]))
    longer[: len(values)] = values
    return longer


@compiled
def _sort_out(
    pair: CurvePair, tolerance: float, stack: PairStack, rows: Array
) -> tuple[Array, Array]:
    """Return points (n, 5) and overlaps (m, 5) from the search rows of a pair; no PAIR column."""
    count, far = len(rows), 2.0 * tolerance
    ends, least = np.empty((count, 2, 2)), np.empty(count)
    for i in range(count):
        for k in range(2):
            place = point_at(pair.pieces, pair.one, rows[i, U0 + k], stack)
            ends[i, k, 0], ends[i, k, 1] = place.x, place.y
        least[i] = min(ends[i, 0, 0], ends[i, 1, 0])
    order = np.argsort(least)
    results = _Results(rows[order], ends[order], np.arange(count), np.zeros(count, np.bool_))
    _unite(pair, results, True, far, stack)
    overlaps = _overlaps(pair, results)
    _unite(pair, results, False, far, stack)
    return _points(pair, results, tolerance, stack), overlaps


@compiled
def _unite(
    pair: CurvePair, results: _Results, stretches: bool, far: float, stack: PairStack
) -> None:
    """Unite the groups of results between which the curves stay within `far` [m] of each other.

    With `stretches`, only stretches are united, and only if the curves run in the same direction
    along both of them or in opposite directions along both.  Otherwise results of any kind are
    united, except two overlaps; a group that is united with an overlap becomes part of it.
    """
    rows, ends, group, overlap = results
    for i in range(len(rows)):
        reach = max(ends[i, 0, 0], ends[i, 1, 0]) + _REACH
        for j in range(i + 1, len(rows)):
            if min(ends[j, 0, 0], ends[j, 1, 0]) > reach:
                break
            here, there = _root(group, i), _root(group, j)
            if here == there or (overlap[here] and overlap[there]):
                continue
            if stretches and _sense(rows[i]) * _sense(rows[j]) <= 0.0:
                continue
            if _connected(pair, results, i, j, far, stack):
                if overlap[there]:
                    here, there = there, here
                group[there] = here


@compiled
def _connected(
    pair: CurvePair, results: _Results, i: int, j: int, far: float, stack: PairStack
) -> bool:
    """Tell whether the curves stay within `far` [m] of each other between results i and j."""
    rows, ends = results.rows, results.ends
    for k in range(2):
        for m in range(2):
            dx, dy = ends[i, k, 0] - ends[j, m, 0], ends[i, k, 1] - ends[j, m, 1]
            if max(abs(dx), abs(dy)) > _REACH:
                continue
            close = True
            for step in range(1, 4):
                u = rows[i, U0 + k] + 0.25 * step * (rows[j, U0 + m] - rows[i, U0 + k])
                v = rows[i, V0 + k] + 0.25 * step * (rows[j, V0 + m] - rows[i, V0 + k])
                close = close and project(pair, u, v, stack).gap <= far
            if close:
                return True
    return False


@compiled
def _sense(row: Array) -> float:
    """Return 1 if the curves run in the same direction along a result, -1 if not, 0 in a point."""
    return float(np.sign((row[U1] - row[U0]) * (row[V1] - row[V0])))


@compiled
def _root(group: Indices, i: int) -> int:
    """Return the root of the set that i belongs to, and shorten the way to it (path halving)."""
    while group[i] != i:
        group[i] = group[group[i]]
        i = group[i]
    return i


@compiled
def _overlaps(pair: CurvePair, results: _Results) -> Array:
    """Return the overlaps (m, 5) among the groups of stretches, and mark them in `overlap`."""
    rows, ends, group, overlap = results
    count = len(rows)
    whole, inner = _empty_ranges(count), _empty_ranges(count)
    length, inner_length = np.zeros(count), np.zeros(count)
    for i in range(count):
        head = _root(group, i)
        for k in range(2):
            u, v = rows[i, U0 + k], rows[i, V0 + k]
            _extend(whole[head], u, v)
            if _is_border(pair.pieces, pair.one, u) or _is_border(pair.pieces, pair.other, v):
                _extend(inner[head], u, v)
    for i in range(count):
        head = _root(group, i)
        dx, dy = ends[i, 1, 0] - ends[i, 0, 0], ends[i, 1, 1] - ends[i, 0, 1]
        size = math.sqrt(dx**2 + dy**2)
        length[head] += size
        low, high = min(rows[i, U0], rows[i, U1]), max(rows[i, U0], rows[i, U1])
        if inner[head, U0] <= low <= high <= inner[head, U1]:
            inner_length[head] += size
    found, total = np.empty((count, 5)), 0
    for head in range(count):
        if inner_length[head] > _SHORTEST or length[head] > _LONG:
            found[total] = inner[head] if inner_length[head] > _SHORTEST else whole[head]
            overlap[head] = True
            total += 1
    return found[:total]


@compiled
def _is_border(pieces: Pieces, curve: int, u: float) -> bool:
    """Tell whether a piece of a curve begins or ends at a parameter."""
    for k in range(pieces.first[curve], pieces.first[curve + 1]):
        if u == pieces.borders[k, 0] or u == pieces.borders[k, 1]:
            return True
    return False


@compiled
def _empty_ranges(count: int) -> Array:
    """Return ranges (count, 5), columns U0, U1, V0, V1 and one for PAIR, that hold nothing yet."""
    ranges = np.zeros((count, 5))
    ranges[:, U0], ranges[:, U1] = math.inf, -math.inf
    return ranges


@compiled
def _extend(span: Array, u: float, v: float) -> None:
    """Extend a range so that it holds u; V0 and V1 are the v at its least and greatest u."""
    if u < span[U0]:
        span[U0], span[V0] = u, v
    if u > span[U1]:
        span[U1], span[V1] = u, v


@compiled
def _points(pair: CurvePair, results: _Results, tolerance: float, stack: PairStack) -> Array:
    """Return the points (n, 5) among the groups of results that are no overlaps."""
    rows, ends, group, overlap = results
    count = len(rows)
    whole, found, total = _empty_ranges(count), np.empty((count, 5)), 0
    start, follow = np.full(count, -1), np.full(count, -1)
    for i in range(count - 1, -1, -1):
        head = _root(group, i)
        follow[i], start[head] = start[head], i
    for head in range(count):
        i, begin = start[head], total
        if i < 0 or overlap[head]:
            continue
        while i >= 0:
            for k in range(2):
                _extend(whole[head], rows[i, U0 + k], rows[i, V0 + k])
            if rows[i, KIND] == CROSS:
                crossing = _Point(rows[i, U0], rows[i, V0], ends[i, 0, 0], ends[i, 0, 1])
                total = _add(found, begin, total, crossing)
            i = follow[i]
        if total != begin + 1:
            touch = touch_in(pair, whole[head], stack)
            if touch.gap <= (2.0 * tolerance if total > begin else tolerance):
                place = point_at(pair.pieces, pair.one, touch.u, stack)
                point = _Point(touch.u, touch.v, place.x, place.y)
                total = _add(found, begin, begin, point)
        itself = pair.one == pair.other
        if itself and total > begin and is_trivial(pair.pieces, pair.one, found[begin], stack):
            total = begin
    return found[:total]


@compiled
def _add(found: Array, begin: int, total: int, point: _Point) -> int:
    """Add a point to found[begin:total] unless it is among them; return the new total."""
    for k in range(begin, total):
        if max(abs(found[k, PLACE_X] - point.x), abs(found[k, PLACE_Y] - point.y)) <= _SAME:
            return total
    found[total, U], found[total, V] = point.u, point.v
    found[total, PLACE_X], found[total, PLACE_Y] = point.x, point.y
    return total + 1
