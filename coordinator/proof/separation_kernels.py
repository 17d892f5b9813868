"""Compiled: how near straight pieces of motion come, for all times no more than tau apart.

`keep` (n,) [m] is each robot's part of a pair's need; slack is the distance less the need.

Decides: which pairs of pieces come near.  Must not know: curves, or what is enough.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import allocation_free, compiled

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

BEGIN, END, X0, Y0, X1, Y1, DEVIATION = range(7)
"""Columns of pieces (m, 7): begin and end [s], the places there [m], and the greatest distance [m]
of the robot from a point that drives the piece at constant speed."""

LOW, HIGH, TIME_A, TIME_B = range(4)
"""Columns of candidates (m, 4), one per pair of pieces: bounds [m] of the pair's least slack, and
the times [s] at which the distance of the points on the pieces is least."""

_LEFT, _BOTTOM, _RIGHT, _TOP = range(4)
"""Columns of boxes (n, 4) [m]."""


class Motions(NamedTuple):
    """Pieces (m, 7) of all robots, those of robot r from first[r] to first[r + 1]; `keep` (n,).

    asked (n,): only pairs with at least one robot that is asked for are looked at.
    """

    pieces: Array
    first: Indices
    keep: Array
    asked: npt.NDArray[np.bool_]


class Nearest(NamedTuple):
    """The least distance [m] of points that drive two pieces, and the time [s] on each piece."""

    distance: float
    t_a: float
    t_b: float


class _Edge(NamedTuple):
    """Pairs of times (t_a + rate_a * k, t_b + rate_b * k) [s] for 0 <= k <= most."""

    t_a: float
    t_b: float
    rate_a: float
    rate_b: float
    most: float


@compiled
def _nearer(a: Array, b: Array, edge: _Edge, best: Nearest) -> Nearest:
    """Return what is nearer: `best` or the nearest points of two pieces (7,) on an edge."""
    t_a, t_b, rate_a, rate_b, most = edge
    if most < 0.0:
        return best
    span_a, span_b = a[END] - a[BEGIN], b[END] - b[BEGIN]
    part_a, part_b = (t_a - a[BEGIN]) / span_a, (t_b - b[BEGIN]) / span_b
    ax, ay, bx, by = a[X1] - a[X0], a[Y1] - a[Y0], b[X1] - b[X0], b[Y1] - b[Y0]
    x = a[X0] + part_a * ax - b[X0] - part_b * bx
    y = a[Y0] + part_a * ay - b[Y0] - part_b * by
    dx = rate_a * ax / span_a - rate_b * bx / span_b
    dy = rate_a * ay / span_a - rate_b * by / span_b
    square, k = dx * dx + dy * dy, 0.0
    if square > 0.0:
        k = min(max(-(x * dx + y * dy) / square, 0.0), most)
    x, y = x + k * dx, y + k * dy
    distance = math.sqrt(x * x + y * y)
    if distance < best.distance:
        return Nearest(distance, t_a + rate_a * k, t_b + rate_b * k)
    return best


@compiled
def nearest(a: Array, b: Array, tau: float) -> Nearest:
    """Return where two pieces (7,) are nearest, among all times no more than tau [s] apart.

    The distance is infinite if there are no such times.  The vector between the two points is
    linear in both times, so its length is least where it vanishes, or on one of the at most six
    edges of the allowed pairs of times.
    """
    best = Nearest(math.inf, math.nan, math.nan)
    a0, a1, b0, b1 = a[BEGIN], a[END], b[BEGIN], b[END]
    if b0 - tau > a1 or a0 - tau > b1:
        return best
    ax, ay = (a[X1] - a[X0]) / (a1 - a0), (a[Y1] - a[Y0]) / (a1 - a0)
    bx, by = (b[X1] - b[X0]) / (b1 - b0), (b[Y1] - b[Y0]) / (b1 - b0)
    cross = ax * by - ay * bx
    if cross != 0.0:
        x, y = b[X0] - a[X0], b[Y0] - a[Y0]
        t_a, t_b = a0 + (x * by - y * bx) / cross, b0 + (x * ay - y * ax) / cross
        if a0 <= t_a <= a1 and b0 <= t_b <= b1 and abs(t_a - t_b) <= tau:
            best = _nearer(a, b, _Edge(t_a, t_b, 0.0, 0.0, 0.0), best)
    for time in (a0, a1):
        low, high = max(b0, time - tau), min(b1, time + tau)
        best = _nearer(a, b, _Edge(time, low, 0.0, 1.0, high - low), best)
    for time in (b0, b1):
        low, high = max(a0, time - tau), min(a1, time + tau)
        best = _nearer(a, b, _Edge(low, time, 1.0, 0.0, high - low), best)
    for shift in (-tau, tau):
        low, high = max(a0, b0 - shift), min(a1, b1 - shift)
        best = _nearer(a, b, _Edge(low, low + shift, 1.0, 1.0, high - low), best)
    return best


@allocation_free
def _box_distance(a: Array, b: Array) -> float:
    """Return the distance [m] of the boxes around two pieces, a lower bound of their distance."""
    x = max(min(b[X0], b[X1]) - max(a[X0], a[X1]), min(a[X0], a[X1]) - max(b[X0], b[X1]), 0.0)
    y = max(min(b[Y0], b[Y1]) - max(a[Y0], a[Y1]), min(a[Y0], a[Y1]) - max(b[Y0], b[Y1]), 0.0)
    return math.sqrt(x * x + y * y)


class _Found(NamedTuple):
    """Pairs (m, 2) of pieces and their candidates (m, 4), of which the first `size` are in use."""

    pairs: Indices
    candidates: Array
    size: int


@compiled
def _nothing() -> _Found:
    return _Found(np.empty((1024, 2), np.int64), np.empty((1024, 4)), 0)


@compiled
def _compare(
    rows: Array, range_a: Indices, range_b: Indices, need: float, tau: float, limit: float,
    found: _Found,
) -> tuple[_Found, float]:  # fmt: skip
    """Append the pairs of pieces from two ranges that may have the least slack, up to `limit` [m].

    Also returns the limit or the least upper bound of the slack, whichever is smaller.
    """
    pairs, candidates, count = found
    first = count
    for p in range(range_a[0], range_a[1]):
        a = rows[p]
        for q in range(range_b[0], range_b[1]):
            b = rows[q]
            free = need + a[DEVIATION] + b[DEVIATION]
            if b[BEGIN] - tau > a[END] or a[BEGIN] - tau > b[END]:
                continue
            if _box_distance(a, b) - free > limit:
                continue
            best = nearest(a, b, tau)
            low = best.distance - free
            if low > limit:
                continue
            if count == len(candidates):
                pairs = np.concatenate((pairs, np.empty_like(pairs)))
                candidates = np.concatenate((candidates, np.empty_like(candidates)))
            pairs[count, 0], pairs[count, 1] = p, q
            high = best.distance - need + a[DEVIATION] + b[DEVIATION]
            candidates[count, LOW], candidates[count, HIGH] = low, high
            candidates[count, TIME_A], candidates[count, TIME_B] = best.t_a, best.t_b
            limit = min(limit, high)
            count += 1
    kept = first
    for row in range(first, count):
        if candidates[row, LOW] <= limit:
            pairs[kept], candidates[kept] = pairs[row], candidates[row]
            kept += 1
    return _Found(pairs, candidates, kept), limit


@compiled
def _boxes(
    rows: Array, first: Indices, keep: Array, begin: float, end: float, ranges: Indices
) -> Array:
    """Return the boxes (n, 4) that hold each robot's disc of radius `keep` from `begin` to `end`.

    Sets ranges (n, 2) to each robot's pieces in that time.  On entry, ranges[:, 0] has to be pieces
    of the robots from which the search can start: none of them later than `begin`.
    """
    boxes = np.empty((len(keep), 4))
    for robot in range(len(keep)):
        p, last = ranges[robot, 0], first[robot + 1]
        while p < last - 1 and rows[p, END] < begin:
            p += 1
        ranges[robot, 0] = p
        x0 = y0 = math.inf
        x1 = y1 = -math.inf
        while p < last and (p == ranges[robot, 0] or rows[p, BEGIN] <= end):
            row, wide = rows[p], keep[robot] + rows[p, DEVIATION]
            for time in (begin, end):
                part = min(max((time - row[BEGIN]) / (row[END] - row[BEGIN]), 0.0), 1.0)
                x = row[X0] + part * (row[X1] - row[X0])
                y = row[Y0] + part * (row[Y1] - row[Y0])
                x0, y0 = min(x0, x - wide), min(y0, y - wide)
                x1, y1 = max(x1, x + wide), max(y1, y + wide)
            p += 1
        ranges[robot, 1] = p
        boxes[robot, _LEFT], boxes[robot, _BOTTOM] = x0, y0
        boxes[robot, _RIGHT], boxes[robot, _TOP] = x1, y1
    return boxes


@compiled
def near_pairs(
    motions: Motions, tau: float, block: float, limit: float, each: bool
) -> tuple[Indices, Array]:
    """Return the pairs of pieces (m, 2) that may have the least slack, if it is below a limit [m].

    block [s]: time is divided into blocks of this length, and in each a sweep along x compares the
    boxes that robots cover.  `each`: look for the least slack of each pair of robots, not for the
    least of all.  A pair of pieces may be returned more than once, or without having the least
    slack.  Also returns the candidates (m, 4).
    """
    rows, first, keep, asked = motions
    found = _nothing()
    ranges = np.empty((len(keep), 2), np.int64)
    ranges[:, 0] = first[:-1]
    spare = 0.5 * tau + 1e-6
    for number in range(int(rows[:, BEGIN].min() / block), int(rows[-1, END] / block) + 1):
        begin, end = number * block - spare, (number + 1) * block + spare
        boxes = _boxes(rows, first, keep, begin, end, ranges)
        order = np.argsort(boxes[:, _LEFT])
        for i in range(len(order)):
            a = order[i]
            for j in range(i + 1, len(order)):
                b = order[j]
                if boxes[b, _LEFT] - boxes[a, _RIGHT] > limit:
                    break
                if not (asked[a] or asked[b]):
                    continue
                if boxes[b, _BOTTOM] - boxes[a, _TOP] > limit:
                    continue
                if boxes[a, _BOTTOM] - boxes[b, _TOP] > limit:
                    continue
                one, other = (a, b) if a < b else (b, a)
                need = keep[a] + keep[b]
                found, least = _compare(rows, ranges[one], ranges[other], need, tau, limit, found)
                if not each:
                    limit = least
    return found.pairs[: found.size], found.candidates[: found.size]


@compiled
def finer_pairs(
    rows: Array, parents: Indices, parts: Indices, needs: Array, tau: float, limits: Array
) -> tuple[Indices, Array]:
    """Return the pairs of finer pieces that may have the least slack, if below a limit [m].

    rows (k, 7): the finer pieces, of which those from parts[p] to parts[p + 1] replace piece p.
    parents (n, 2): pairs of replaced pieces, each with its need and its limit: needs (n,) [m],
    limits (n,) [m].  Also returns the candidates (m, 4).
    """
    found = _nothing()
    for row in range(len(parents)):
        p, q = parents[row, 0], parents[row, 1]
        its, others = parts[p : p + 2], parts[q : q + 2]
        found, _ = _compare(rows, its, others, needs[row], tau, limits[row], found)
    return found.pairs[: found.size], found.candidates[: found.size]
