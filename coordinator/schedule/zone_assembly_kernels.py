"""Compiled: the near chords of two robots joined to zones.

Two neighbouring pairs of chords belong to one zone when the edge between them holds a conflict:
one robot at the point where two of its chords meet, the other one on its chord.  Each pair's own
conflict is convex, so zones are exactly the connected pieces.

Vertices of all robots are in one array, s (v,) and points (v, 2); chord v runs from vertex v to
the next.  A table of pairs (n, 4) int64 holds chord of a, chord of b, sides (zone_kernels.py) and
the pair it is joined to, itself when it is the first of its zone.

Decides: which chords are one zone, and its extent.  Must not know: how they were found.
"""

from __future__ import annotations

import math

import numpy as np

from coordinator.base.compiled import compiled
from coordinator.curves.nurbs_kernels import Array, Indices
from coordinator.schedule.broad_phase_kernels import BEGIN, END, MIDDLE_X, MIDDLE_Y, RADIUS
from coordinator.schedule.zone_kernels import BOTTOM, LEFT, extent_of, sides_near


@compiled
def near_chords(
    keys: Indices,
    stretches: Indices,
    shapes: Array,
    points: Array,
    middles: Array,
    reach: float,
    pairs: Indices,
) -> tuple[Indices, int]:
    """Return the pairs of near chords in pairs of stretches, and how many, in increasing order.

    keys (k,) increase and hold two stretches each, g * len(stretches) + h; middles (v, 3) are those
    of chords, and half their lengths.  The answer is `pairs` or a larger table.
    """
    count, first, base, square = 0, 0, len(stretches), reach * reach
    while first < len(keys):
        g, last = keys[first] // base, first
        while last < len(keys) and keys[last] < (g + 1) * base:
            last += 1
        for i in range(stretches[g, BEGIN], stretches[g, END]):
            x, y, far = middles[i, 0], middles[i, 1], middles[i, 2] + reach + 1e-9
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
                    dx, dy, wide = middles[j, 0] - x, middles[j, 1] - y, far + middles[j, 2]
                    if dx * dx + dy * dy > wide * wide:
                        continue
                    sides = sides_near(points, i, points, j, square)
                    if sides == 0:
                        continue
                    if count == len(pairs):
                        wider = np.empty((2 * count + 8, 4), np.int64)
                        wider[:count] = pairs
                        pairs = wider
                    pairs[count, 0], pairs[count, 1], pairs[count, 2] = i, j, sides
                    count += 1
        first = last
    return pairs, count


@compiled
def _root(pairs: Indices, k: int) -> int:
    """Return the first pair of the zone of pair k, and remember a shorter way there."""
    while pairs[k, 3] != k:
        pairs[k, 3] = pairs[pairs[k, 3], 3]
        k = pairs[k, 3]
    return k


@compiled
def _unite(pairs: Indices, k: int, m: int) -> None:
    """Make the zones of two pairs one: the earlier first pair stays."""
    k, m = _root(pairs, k), _root(pairs, m)
    pairs[max(k, m), 3] = min(k, m)


@compiled
def join_pairs(pairs: Indices) -> None:
    """Join neighbouring pairs (n, 4), which are in increasing order, into zones."""
    row = before = 0
    for k in range(len(pairs)):
        i, j = pairs[k, 0], pairs[k, 1]
        pairs[k, 3] = k
        if pairs[row, 0] != i:
            before, row = row, k
        if pairs[k, 2] & BOTTOM and k > row and pairs[k - 1, 1] == j - 1:
            _unite(pairs, k - 1, k)
        if pairs[k, 2] & LEFT and pairs[before, 0] == i - 1:
            while before < row and pairs[before, 0] == i - 1 and pairs[before, 1] < j:
                before += 1
            if before < row and pairs[before, 0] == i - 1 and pairs[before, 1] == j:
                _unite(pairs, before, k)
    for k in range(len(pairs)):
        pairs[k, 3] = _root(pairs, k)


@compiled
def extents_of(pairs: Indices, s: Array, points: Array, reach: float, extents: Array) -> None:
    """Write a0, a1, b0, b1 [m] of every zone into the row of its first pair; pairs are joined.

    First what the sides of pairs tell, then what pairs that reach farther hold inside.
    """
    for k in range(len(pairs)):
        i, j, zone = pairs[k, 0], pairs[k, 1], pairs[k, 3]
        if zone == k:
            extents[k, 0] = extents[k, 2] = math.inf
            extents[k, 1] = extents[k, 3] = -math.inf
        if pairs[k, 2] & LEFT:
            extents[zone, 0] = min(extents[zone, 0], s[i])
            extents[zone, 1] = max(extents[zone, 1], s[i])
        if pairs[k, 2] & BOTTOM:
            extents[zone, 2] = min(extents[zone, 2], s[j])
            extents[zone, 3] = max(extents[zone, 3], s[j])
    for k in range(len(pairs)):
        i, j, zone = pairs[k, 0], pairs[k, 1], pairs[k, 3]
        if s[i] < extents[zone, 0] or s[i + 1] > extents[zone, 1]:
            low, high = extent_of(s, points, i, points, j, reach)
            extents[zone, 0] = min(extents[zone, 0], low)
            extents[zone, 1] = max(extents[zone, 1], high)
        if s[j] < extents[zone, 2] or s[j + 1] > extents[zone, 3]:
            low, high = extent_of(s, points, j, points, i, reach)
            extents[zone, 2] = min(extents[zone, 2], low)
            extents[zone, 3] = max(extents[zone, 3], high)


@compiled
def _comes_before(extents: Array, k: int, m: int) -> bool:
    """Tell whether the extent in row k is the lesser one."""
    for side in range(4):
        if extents[k, side] != extents[m, side]:
            return bool(extents[k, side] < extents[m, side])
    return k < m


@compiled
def zones_in_order(pairs: Indices, extents: Array, order: Indices) -> int:
    """Write the first pairs of all zones into `order`, by extent; return how many there are."""
    count = 0
    for k in range(len(pairs)):
        if pairs[k, 3] != k:
            continue
        at = count
        while at > 0 and _comes_before(extents, k, order[at - 1]):
            order[at] = order[at - 1]
            at -= 1
        order[at] = k
        count += 1
    return count
