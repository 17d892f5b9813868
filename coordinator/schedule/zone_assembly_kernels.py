"""Compiled: near pairs of chords of two robots joined into zones.

A pair (i, j) of chords is the rectangle of arc lengths at which the first robot is on chord i and
the second one on chord j.  Two pairs that share a side are in one zone when that side holds a
conflict.  The conflict in one rectangle is convex, so these zones are the connected components.

Decides: which pairs of chords are one zone, and its extent.  Must not know: how they were found.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from coordinator.base.compiled import allocation_free, compiled
from coordinator.curves.nurbs_kernels import Array, Indices
from coordinator.schedule.broad_phase_kernels import BEGIN, END, MIDDLE_X, MIDDLE_Y, RADIUS, Grid
from coordinator.schedule.zone_kernels import BOTTOM, LEFT, Polyline, extent_of, sides_near

CHORD_A, CHORD_B, SIDES, JOINED = range(4)
"""Columns of pairs of chords (n, 4): the chords of both robots, named by the vertices where they
begin; the flags of zone_kernels.py; and the row of another pair in the same zone, which after
`join_pairs` is the first pair of the zone."""

BEGIN_A, END_A, BEGIN_B, END_B = range(4)
"""Columns of extents (n, 4) [m]: the arc lengths where a zone begins and ends on both paths."""

HALF_LENGTH: Final = 2
"""Column of middles (v, 3) [m] of chords, after x and y: half the length of the chord."""


@compiled
def near_chords(
    keys: Indices,
    grid: Grid,
    points: Array,
    middles: Array,
    reach: float,
    pairs: Indices,
) -> tuple[Indices, int]:
    """Return the pairs of near chords in some pairs of stretches, in increasing order; how many.

    A key g * len(grid.stretches) + h stands for the stretches g and h; keys (k,) increase.  points
    (v, 2), middles (v, 3) [m]: the vertices and chords of all robots; `reach` [m]: the distance
    that is too near.  CHORD_A, CHORD_B and SIDES are written into `pairs` or, if it is too small,
    into a larger copy of it.
    """
    stretches, shapes = grid.stretches, grid.shapes
    count, first, base, square = 0, 0, len(stretches), reach * reach
    while first < len(keys):
        g, last = keys[first] // base, first
        while last < len(keys) and keys[last] < (g + 1) * base:
            last += 1
        for i in range(stretches[g, BEGIN], stretches[g, END]):
            x, y, far = middles[i, 0], middles[i, 1], middles[i, HALF_LENGTH] + reach + 1e-9
            for k in range(first, last):
                h = keys[k] - g * base
                dx, dy, wide = (
                    shapes[h, MIDDLE_X] - x,
                    shapes[h, MIDDLE_Y] - y,
                    far + shapes[h, RADIUS],
                )
                if dx * dx + dy * dy > wide * wide:
                    continue
                for j in range(stretches[h, BEGIN], stretches[h, END]):
                    dx, dy = middles[j, 0] - x, middles[j, 1] - y
                    wide = far + middles[j, HALF_LENGTH]
                    if dx * dx + dy * dy > wide * wide:
                        continue
                    sides = sides_near(points, i, points, j, square)
                    if sides == 0:
                        continue
                    if count == len(pairs):
                        wider = np.empty((2 * count + 8, 4), np.int64)
                        wider[:count] = pairs
                        pairs = wider
                    pairs[count, CHORD_A], pairs[count, CHORD_B] = i, j
                    pairs[count, SIDES] = sides
                    count += 1
        first = last
    return pairs, count


@allocation_free
def _root(pairs: Indices, k: int) -> int:
    """Return the first pair of the zone of pair k; halve the path there for later look-ups."""
    while pairs[k, JOINED] != k:
        pairs[k, JOINED] = pairs[pairs[k, JOINED], JOINED]
        k = pairs[k, JOINED]
    return k


@allocation_free
def _unite(pairs: Indices, k: int, m: int) -> None:
    """Make the zones of two pairs one."""
    k, m = _root(pairs, k), _root(pairs, m)
    pairs[max(k, m), JOINED] = min(k, m)


@allocation_free
def join_pairs(pairs: Indices) -> None:
    """Join pairs (n, 4), which are in increasing order, into zones: write JOINED."""
    row = before = 0
    for k in range(len(pairs)):
        i, j = pairs[k, CHORD_A], pairs[k, CHORD_B]
        pairs[k, JOINED] = k
        if pairs[row, CHORD_A] != i:
            before, row = row, k
        if pairs[k, SIDES] & BOTTOM and k > row and pairs[k - 1, CHORD_B] == j - 1:
            _unite(pairs, k - 1, k)
        if pairs[k, SIDES] & LEFT and pairs[before, CHORD_A] == i - 1:
            while before < row and pairs[before, CHORD_A] == i - 1 and pairs[before, CHORD_B] < j:
                before += 1
            if before < row and pairs[before, CHORD_A] == i - 1 and pairs[before, CHORD_B] == j:
                _unite(pairs, before, k)
    for k in range(len(pairs)):
        pairs[k, JOINED] = _root(pairs, k)


@allocation_free
def extents_of(pairs: Indices, line: Polyline, reach: float, extents: Array) -> None:
    """Write the extent of each zone into the row of its first pair.

    The sides of pairs are looked at first; then only the pairs that reach beyond these.
    """
    s, points = line
    for k in range(len(pairs)):
        i, j, zone = pairs[k, CHORD_A], pairs[k, CHORD_B], pairs[k, JOINED]
        if zone == k:
            extents[k, BEGIN_A] = extents[k, BEGIN_B] = math.inf
            extents[k, END_A] = extents[k, END_B] = -math.inf
        if pairs[k, SIDES] & LEFT:
            extents[zone, BEGIN_A] = min(extents[zone, BEGIN_A], s[i])
            extents[zone, END_A] = max(extents[zone, END_A], s[i])
        if pairs[k, SIDES] & BOTTOM:
            extents[zone, BEGIN_B] = min(extents[zone, BEGIN_B], s[j])
            extents[zone, END_B] = max(extents[zone, END_B], s[j])
    for k in range(len(pairs)):
        i, j, zone = pairs[k, CHORD_A], pairs[k, CHORD_B], pairs[k, JOINED]
        if s[i] < extents[zone, BEGIN_A] or s[i + 1] > extents[zone, END_A]:
            low, high = extent_of(s, points, i, points, j, reach)
            extents[zone, BEGIN_A] = min(extents[zone, BEGIN_A], low)
            extents[zone, END_A] = max(extents[zone, END_A], high)
        if s[j] < extents[zone, BEGIN_B] or s[j + 1] > extents[zone, END_B]:
            low, high = extent_of(s, points, j, points, i, reach)
            extents[zone, BEGIN_B] = min(extents[zone, BEGIN_B], low)
            extents[zone, END_B] = max(extents[zone, END_B], high)


@allocation_free
def _comes_before(extents: Array, k: int, m: int) -> bool:
    """Tell whether the extent in row k comes before that in row m, by its columns in order."""
    for side in (BEGIN_A, END_A, BEGIN_B, END_B):
        if extents[k, side] != extents[m, side]:
            return bool(extents[k, side] < extents[m, side])
    return k < m


@allocation_free
def zones_in_order(pairs: Indices, extents: Array, order: Indices) -> int:
    """Write the first pairs of all zones into `order`, by extent; return how many there are."""
    count = 0
    for k in range(len(pairs)):
        if pairs[k, JOINED] != k:
            continue
        at = count
        while at > 0 and _comes_before(extents, k, order[at - 1]):
            order[at] = order[at - 1]
            at -= 1
        order[at] = k
        count += 1
    return count
