"""Compiled: how near straight pieces of motion come, for all times no more than tau apart.

A piece is a row of flight.Pieces: from when to when, from x, y to x, y, deviation.  `keep` (n,) [m]
is each robot's part of a pair's need; slack is the distance less the need.
Candidates are rows (low, high, t_a, t_b): the least slack of a pair of pieces lies in [low, high],
and near the times t_a, t_b.

Decides: which pairs of pieces come near.  Must not know: curves, or what is enough.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import compiled

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]


@compiled
def _on_edge(
    a: Array, b: Array, t_a: float, t_b: float, rate_a: float, rate_b: float, most: float,
    best: Array,
) -> None:  # fmt: skip
    """Leave in `best` (3,) what is nearer at times (t_a + rate_a k, t_b + rate_b k), k <= most."""
    if most < 0.0:
        return
    span_a, span_b = a[1] - a[0], b[1] - b[0]
    part_a, part_b = (t_a - a[0]) / span_a, (t_b - b[0]) / span_b
    ax, ay, bx, by = a[4] - a[2], a[5] - a[3], b[4] - b[2], b[5] - b[3]
    x = a[2] + part_a * ax - b[2] - part_b * bx
    y = a[3] + part_a * ay - b[3] - part_b * by
    dx = rate_a * ax / span_a - rate_b * bx / span_b
    dy = rate_a * ay / span_a - rate_b * by / span_b
    square, k = dx * dx + dy * dy, 0.0
    if square > 0.0:
        k = min(max(-(x * dx + y * dy) / square, 0.0), most)
    x, y = x + k * dx, y + k * dy
    distance = math.sqrt(x * x + y * y)
    if distance < best[0]:
        best[0], best[1], best[2] = distance, t_a + rate_a * k, t_b + rate_b * k


@compiled
def nearest(a: Array, b: Array, tau: float, best: Array) -> None:
    """Leave in `best` (3,) the least distance [m] of two pieces at times <= tau apart, and when.

    The difference of places is linear in both times, so its length is least where it vanishes or
    on the border of the allowed times, of at most six edges.  inf where no times are allowed.
    """
    best[0] = math.inf
    a0, a1, b0, b1 = a[0], a[1], b[0], b[1]
    if b0 - tau > a1 or a0 - tau > b1:
        return
    ax, ay = (a[4] - a[2]) / (a1 - a0), (a[5] - a[3]) / (a1 - a0)
    bx, by = (b[4] - b[2]) / (b1 - b0), (b[5] - b[3]) / (b1 - b0)
    cross = ax * by - ay * bx
    if cross != 0.0:
        x, y = b[2] - a[2], b[3] - a[3]
        t_a, t_b = a0 + (x * by - y * bx) / cross, b0 + (x * ay - y * ax) / cross
        if a0 <= t_a <= a1 and b0 <= t_b <= b1 and abs(t_a - t_b) <= tau:
            _on_edge(a, b, t_a, t_b, 0.0, 0.0, 0.0, best)
    for time in (a0, a1):
        low, high = max(b0, time - tau), min(b1, time + tau)
        _on_edge(a, b, time, low, 0.0, 1.0, high - low, best)
    for time in (b0, b1):
        low, high = max(a0, time - tau), min(a1, time + tau)
        _on_edge(a, b, low, time, 1.0, 0.0, high - low, best)
    for shift in (-tau, tau):
        low, high = max(a0, b0 - shift), min(a1, b1 - shift)
        _on_edge(a, b, low, low + shift, 1.0, 1.0, high - low, best)


@compiled
def _apart(a: Array, b: Array) -> float:
    """Return a bound [m] below the distance of the lines of two pieces, from their boxes."""
    x = max(min(b[2], b[4]) - max(a[2], a[4]), min(a[2], a[4]) - max(b[2], b[4]), 0.0)
    y = max(min(b[3], b[5]) - max(a[3], a[5]), min(a[3], a[5]) - max(b[3], b[5]), 0.0)
    return math.sqrt(x * x + y * y)


@compiled
def _compare(
    rows: Array, range_a: Indices, range_b: Indices, need: float, tau: float, limit: float,
    pairs: Indices, found: Array, count: int,
) -> tuple[Indices, Array, int, float]:  # fmt: skip
    """Append the pairs of pieces in two ranges that may have the least slack up to a limit [m].

    Returns pairs, found, their count, and the limit or the least `high`, whichever is smaller.
    """
    first, best = count, np.empty(3)
    for p in range(range_a[0], range_a[1]):
        a = rows[p]
        for q in range(range_b[0], range_b[1]):
            b = rows[q]
            free = need + a[6] + b[6]
            if b[0] - tau > a[1] or a[0] - tau > b[1] or _apart(a, b) - free > limit:
                continue
            nearest(a, b, tau, best)
            low = best[0] - free
            if low > limit:
                continue
            if count == len(found):
                pairs = np.concatenate((pairs, np.empty_like(pairs)))
                found = np.concatenate((found, np.empty_like(found)))
            pairs[count, 0], pairs[count, 1] = p, q
            found[count, 0], found[count, 1] = low, best[0] - need + a[6] + b[6]
            found[count, 2], found[count, 3] = best[1], best[2]
            limit = min(limit, found[count, 1])
            count += 1
    kept = first
    for row in range(first, count):
        if found[row, 0] <= limit:
            pairs[kept], found[kept] = pairs[row], found[row]
            kept += 1
    return pairs, found, kept, limit


@compiled
def _boxes(
    rows: Array, first: Indices, keep: Array, begin: float, end: float, ranges: Indices
) -> Array:
    """Return least x, y, greatest x, y of each robot's disc `keep` from `begin` to `end`, (n, 4).

    Moves ranges (n, 2) on to the pieces of that time; they have to begin at earlier ones.
    """
    boxes = np.empty((len(keep), 4))
    for robot in range(len(keep)):
        p, last = ranges[robot, 0], first[robot + 1]
        while p < last - 1 and rows[p, 1] < begin:
            p += 1
        ranges[robot, 0] = p
        x0 = y0 = math.inf
        x1 = y1 = -math.inf
        while p < last and (p == ranges[robot, 0] or rows[p, 0] <= end):
            row, wide = rows[p], keep[robot] + rows[p, 6]
            for time in (begin, end):
                part = min(max((time - row[0]) / (row[1] - row[0]), 0.0), 1.0)
                x = row[2] + part * (row[4] - row[2])
                y = row[3] + part * (row[5] - row[3])
                x0, y0 = min(x0, x - wide), min(y0, y - wide)
                x1, y1 = max(x1, x + wide), max(y1, y + wide)
            p += 1
        ranges[robot, 1] = p
        boxes[robot, 0], boxes[robot, 1], boxes[robot, 2], boxes[robot, 3] = x0, y0, x1, y1
    return boxes


@compiled
def near_pairs(
    rows: Array, first: Indices, keep: Array, tau: float, block: float, limit: float, each: bool
) -> tuple[Indices, Array]:
    """Return the pairs of pieces (m, 2) that may have the least slack, if below a limit [m].

    `first` (n + 1,): where the pieces of each robot begin.  `each`: for every pair of robots
    instead of all pairs together; pieces beyond a pair's least may be included.  Time is divided
    into blocks; in each block a sweep compares the boxes that robots cover.  A pair may occur more
    than once.  Also returns the candidates (m, 4) of the pairs.
    """
    pairs, found, count = np.empty((1024, 2), np.int64), np.empty((1024, 4)), 0
    ranges = np.empty((len(keep), 2), np.int64)
    ranges[:, 0] = first[:-1]
    spare = 0.5 * tau + 1e-6
    for number in range(int(rows[-1, 1] / block) + 1):
        begin, end = number * block - spare, (number + 1) * block + spare
        boxes = _boxes(rows, first, keep, begin, end, ranges)
        order = np.argsort(boxes[:, 0])
        for i in range(len(order)):
            a = order[i]
            for j in range(i + 1, len(order)):
                b = order[j]
                if boxes[b, 0] - boxes[a, 2] > limit:
                    break
                if boxes[b, 1] - boxes[a, 3] > limit or boxes[a, 1] - boxes[b, 3] > limit:
                    continue
                one, other = (a, b) if a < b else (b, a)
                pairs, found, count, least = _compare(
                    rows, ranges[one], ranges[other], keep[a] + keep[b], tau, limit,
                    pairs, found, count,
                )  # fmt: skip
                if not each:
                    limit = least
    return pairs[:count], found[:count]


@compiled
def finer_pairs(
    rows: Array, parents: Indices, parts: Indices, needs: Array, tau: float, limits: Array
) -> tuple[Indices, Array]:
    """Return the pairs of parts that may have the least slack below a limit of their own [m].

    parents (m, 2): pairs of pieces, each now the parts from parts[piece] up to parts[piece + 1];
    needs (m,) [m]: the least distance allowed; limits (m,).  Also returns their candidates.
    """
    pairs, found, count = np.empty((1024, 2), np.int64), np.empty((1024, 4)), 0
    for row in range(len(parents)):
        p, q = parents[row, 0], parents[row, 1]
        pairs, found, count, _ = _compare(
            rows, parts[p : p + 2], parts[q : q + 2], needs[row], tau, limits[row],
            pairs, found, count,
        )  # fmt: skip
    return pairs[:count], found[:count]
