"""Compiled: the meetings of curves, made of the rows that the search finds.

A meeting is a place at which two curves are within a tolerance of each other; one stretch of that
kind is one meeting.  It is an overlap when pieces of both curves lie on one another from a border
of one of their pieces to another, as irreducible curves do; otherwise it is a point: the crossing,
or where the tangents are parallel.

Decides: which of the places that the search finds are the same, and what kind they are.  Must not
know: how they are searched for.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import compiled
from coordinator.curves.bezier_kernels import Array, Indices, Pieces
from coordinator.curves.crossing_kernels import compare, is_trivial, point_at, touch_in
from coordinator.curves.intersection_kernels import CROSS, search
from coordinator.curves.pair_stack_kernels import Desk, make_desk

_COARSE: Final = 1e-4
"""Up to this tolerance [m] a search that takes too long is made again, ten times coarser."""
_REACH: Final = 0.03
"""Places farther apart [m] are never one meeting, unless an overlap joins them."""
_SAME: Final = 1e-7
"""Crossings of one stretch that are nearer [m] are one; others bound a touch."""
_SHORTEST: Final = 1e-6
_LONG: Final = 0.25
"""Overlaps are longer [m]; those that do not begin and end at borders, longer than that."""


@compiled
def find_all(pieces: Pieces, pairs: Indices, tolerance: float) -> tuple[Array, Array, Array]:
    """Return points (pair, u, v, x, y), overlaps (pair, u0, u1, v0, v1), tolerances (pairs,) [m].

    The tolerance of a pair is coarser than what is asked for when its search took too long.
    """
    desk = make_desk(int(np.max(pieces.degree)) + 1)
    rows, points, overlaps = np.empty((64, 5)), np.empty((64, 5)), np.empty((16, 5))
    used = np.full(len(pairs), tolerance)
    found = over = 0
    for pair in range(len(pairs)):
        one, other, fine = pairs[pair, 0], pairs[pair, 1], tolerance
        rows, count = search(pieces, one, other, fine, fine < _COARSE, desk, rows)
        while count < 0:
            fine *= 10.0
            rows, count = search(pieces, one, other, fine, fine < _COARSE, desk, rows)
        used[pair] = fine
        if count == 0:
            continue
        new, new_over = _sort_out(pieces, one, other, fine, desk, rows[:count])
        points = _with_room(points, found + len(new))
        overlaps = _with_room(overlaps, over + len(new_over))
        for k in range(len(new)):
            points[found + k, 0], points[found + k, 1:] = pair, new[k]
        for k in range(len(new_over)):
            overlaps[over + k, 0], overlaps[over + k, 1:] = pair, new_over[k]
        found, over = found + len(new), over + len(new_over)
    return points[:found], overlaps[:over], used


@compiled
def _with_room(values: Array, count: int) -> Array:
    """Return the values, in a longer array when they have no room for so many."""
    if count <= len(values):
        return values
    longer = np.empty((2 * count, values.shape[1]))
    longer[: len(values)] = values
    return longer


@compiled
def _sort_out(
    pieces: Pieces, one: int, other: int, tolerance: float, desk: Desk, rows: Array
) -> tuple[Array, Array]:
    """Return points (n, 4), u, v, x, y, and overlaps (m, 4) that rows of a search amount to."""
    count, far = len(rows), 2.0 * tolerance
    ends, least = np.empty((count, 4)), np.empty(count)
    for i in range(count):
        ends[i, 0], ends[i, 1], _, _ = point_at(pieces, one, rows[i, 1], desk)
        ends[i, 2], ends[i, 3], _, _ = point_at(pieces, one, rows[i, 2], desk)
        least[i] = min(ends[i, 0], ends[i, 2])
    order = np.argsort(least)
    rows, ends = rows[order], ends[order]
    group, part = np.arange(count), np.zeros(count, np.bool_)
    _gather(pieces, one, other, rows, ends, group, part, True, far, desk)
    overlaps = _overlaps(pieces, one, other, rows, ends, group, part)
    _gather(pieces, one, other, rows, ends, group, part, False, far, desk)
    return _points(pieces, one, other, tolerance, desk, rows, ends, group, part), overlaps


@compiled
def _gather(
    pieces: Pieces,
    one: int,
    other: int,
    rows: Array,
    ends: Array,
    group: Indices,
    part: npt.NDArray[np.bool_],
    stretches: bool,
    far: float,
    desk: Desk,
) -> None:
    """Unite the groups of rows, sorted by least x, that are one meeting.

    Either of stretches that run the same way, or of whatever is no part of an overlap; what is
    one with an overlap becomes part of it.
    """
    for i in range(len(rows)):
        reach = max(ends[i, 0], ends[i, 2]) + _REACH
        for j in range(i + 1, len(rows)):
            if min(ends[j, 0], ends[j, 2]) > reach:
                break
            here, there = _root(group, i), _root(group, j)
            if here == there or (part[here] and part[there]):
                continue
            if stretches and _way(rows, i) * _way(rows, j) <= 0.0:
                continue
            if _joined(pieces, one, other, rows, ends, i, j, far, desk):
                if part[there]:
                    here, there = there, here
                group[there] = here


@compiled
def _joined(
    pieces: Pieces,
    one: int,
    other: int,
    rows: Array,
    ends: Array,
    i: int,
    j: int,
    far: float,
    desk: Desk,
) -> bool:
    """Tell whether between two rows the curves stay within a distance of each other."""
    for k in range(2):
        for m in range(2):
            dx, dy = ends[i, 2 * k] - ends[j, 2 * m], ends[i, 2 * k + 1] - ends[j, 2 * m + 1]
            if max(abs(dx), abs(dy)) > _REACH:
                continue
            close = True
            for step in range(1, 4):
                u = rows[i, 1 + k] + 0.25 * step * (rows[j, 1 + m] - rows[i, 1 + k])
                v = rows[i, 3 + k] + 0.25 * step * (rows[j, 3 + m] - rows[i, 3 + k])
                close = close and compare(pieces, one, other, u, v, desk)[1] <= far
            if close:
                return True
    return False


@compiled
def _way(rows: Array, i: int) -> float:
    """Return 1 or -1 for a stretch that runs with or against the other curve, 0 for a point."""
    return float(np.sign((rows[i, 2] - rows[i, 1]) * (rows[i, 4] - rows[i, 3])))


@compiled
def _root(group: Indices, i: int) -> int:
    """Return what stands for a group, the way to it shortened."""
    while group[i] != i:
        group[i] = group[group[i]]
        i = group[i]
    return i


@compiled
def _overlaps(
    pieces: Pieces,
    one: int,
    other: int,
    rows: Array,
    ends: Array,
    group: Indices,
    part: npt.NDArray[np.bool_],
) -> Array:
    """Return the overlaps (m, 4) among groups of stretches; marks what stands for such a group."""
    count = len(rows)
    whole, inner, sizes = _ranges(count), _ranges(count), np.zeros((count, 3))
    for i in range(count):
        head = _root(group, i)
        for k in range(2):
            u, v = rows[i, 1 + k], rows[i, 3 + k]
            _stretch(whole[head], u, v)
            if _is_border(pieces, one, u) or _is_border(pieces, other, v):
                _stretch(inner[head], u, v)
    for i in range(count):
        head = _root(group, i)
        size = math.sqrt((ends[i, 2] - ends[i, 0]) ** 2 + (ends[i, 3] - ends[i, 1]) ** 2)
        sizes[head, 0] += size
        if (
            inner[head, 0]
            <= min(rows[i, 1], rows[i, 2])
            <= max(rows[i, 1], rows[i, 2])
            <= inner[head, 1]
        ):
            sizes[head, 1] += size
    found, total = np.empty((count, 4)), 0
    for head in range(count):
        if sizes[head, 1] > _SHORTEST or sizes[head, 0] > _LONG:
            found[total] = inner[head] if sizes[head, 1] > _SHORTEST else whole[head]
            part[head] = True
            total += 1
    return found[:total]


@compiled
def _is_border(pieces: Pieces, curve: int, u: float) -> bool:
    """Tell whether a parameter is where a piece of a curve begins or ends."""
    for k in range(pieces.first[curve], pieces.first[curve + 1]):
        if u == pieces.borders[k, 0] or u == pieces.borders[k, 1]:
            return True
    return False


@compiled
def _ranges(count: int) -> Array:
    """Return ranges (count, 4) that hold nothing yet: least u, greatest u, v there."""
    ranges = np.zeros((count, 4))
    ranges[:, 0], ranges[:, 1] = math.inf, -math.inf
    return ranges


@compiled
def _stretch(range_of: Array, u: float, v: float) -> None:
    """Make a range (least u, greatest u, v there) take in a place."""
    if u < range_of[0]:
        range_of[0], range_of[2] = u, v
    if u > range_of[1]:
        range_of[1], range_of[3] = u, v


@compiled
def _points(
    pieces: Pieces,
    one: int,
    other: int,
    tolerance: float,
    desk: Desk,
    rows: Array,
    ends: Array,
    group: Indices,
    part: npt.NDArray[np.bool_],
) -> Array:
    """Return the points (n, 4), u, v, x, y, that groups of rows amount to."""
    count = len(rows)
    whole, found, total = _ranges(count), np.empty((count, 4)), 0
    start, follow = np.full(count, -1), np.full(count, -1)
    for i in range(count - 1, -1, -1):
        head = _root(group, i)
        follow[i], start[head] = start[head], i
    for head in range(count):
        i, begin = start[head], total
        if i < 0 or part[head]:
            continue
        while i >= 0:
            for k in range(2):
                _stretch(whole[head], rows[i, 1 + k], rows[i, 3 + k])
            if rows[i, 0] == CROSS:
                total = _add(found, begin, total, rows[i, 1], rows[i, 3], ends[i])
            i = follow[i]
        if total != begin + 1:
            u, v, gap = touch_in(pieces, one, other, whole[head], desk)
            if gap <= (2.0 * tolerance if total > begin else tolerance):
                x, y, _, _ = point_at(pieces, one, u, desk)
                total = _add(found, begin, begin, u, v, np.array([x, y]))
        if one == other and total > begin and is_trivial(pieces, one, found[begin], desk):
            total = begin
    return found[:total]


@compiled
def _add(found: Array, begin: int, total: int, u: float, v: float, at: Array) -> int:
    """Add a point to those found since `begin`, unless it is among them; how many there are."""
    for k in range(begin, total):
        if max(abs(found[k, 2] - at[0]), abs(found[k, 3] - at[1])) <= _SAME:
            return total
    found[total, 0], found[total, 1], found[total, 2], found[total, 3] = u, v, at[0], at[1]
    return total + 1
