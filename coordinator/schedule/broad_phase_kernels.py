"""Compiled: which stretches of which robots come near, found through a grid of square cells.

A stretch is a few neighbouring chords of one robot, all within `out` of the segment from its first
to its last point.  Each is put into the cells that it touches when it is as wide as its robot's
half of every need; two robots too near meet in a cell, as the place between them is in both.

stretches (g, 5) int64: robot, first and last vertex, cells from and to.  shapes (g, 6) [m]: middle
x, y, the way from there to the last point x, y, half length with `out`, `out` with the robot's half
of a need.  Vertices of all robots are in one array, robot r from first[r] to first[r + 1].

Decides: which stretches must be looked at together.  Must not know: chords, ellipses, zones.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from coordinator.base.compiled import compiled
from coordinator.curves.nurbs_kernels import Array, Indices

Grid = tuple[Indices, Indices, Indices, Indices, Array]

MOST_CHORDS: Final = 8
"""Chords in a stretch at most."""


@compiled
def stretches_of(first: Indices, points: Array, half: Array, size: float) -> tuple[Indices, Array]:
    """Return stretches and shapes: chords are joined up to about `size` [m]."""
    stretches = np.empty((len(points), 5), np.int64)
    shapes, count = np.empty((len(points), 6)), 0
    for robot in range(len(first) - 1):
        begin = first[robot]
        while begin < first[robot + 1] - 1:
            end = begin + 1
            while end < first[robot + 1] - 1 and end - begin < MOST_CHORDS:
                dx = points[end + 1, 0] - points[begin, 0]
                dy = points[end + 1, 1] - points[begin, 1]
                if dx * dx + dy * dy > size * size:
                    break
                end += 1
            out = 0.0
            dx, dy = points[end, 0] - points[begin, 0], points[end, 1] - points[begin, 1]
            square = dx * dx + dy * dy
            for i in range(begin + 1, end):
                ax, ay = points[i, 0] - points[begin, 0], points[i, 1] - points[begin, 1]
                part = (ax * dx + ay * dy) / square if square > 0.0 else 0.0
                part = min(max(part, 0.0), 1.0)
                out = max(out, math.hypot(ax - part * dx, ay - part * dy))
            stretches[count, 0], stretches[count, 1], stretches[count, 2] = robot, begin, end
            shapes[count, 0] = points[begin, 0] + 0.5 * dx
            shapes[count, 1] = points[begin, 1] + 0.5 * dy
            shapes[count, 2], shapes[count, 3] = 0.5 * dx, 0.5 * dy
            shapes[count, 4], shapes[count, 5] = 0.5 * math.sqrt(square) + out, out + half[robot]
            begin, count = end, count + 1
    return stretches[:count], shapes[:count]


@compiled
def columns_in(
    points: Array, stretch: Indices, pad: float, frame: Array, row: int
) -> tuple[int, int]:
    """Return the columns that a stretch as wide as `pad` may touch in a row: first, last.

    frame (5,) is x0, y0, the size of a cell [m], columns and rows.
    """
    ax, ay = points[stretch[1], 0], points[stretch[1], 1]
    dx, dy = points[stretch[2], 0] - ax, points[stretch[2], 1] - ay
    low, high = 0.0, 1.0
    if abs(dy) > 1e-9:
        below = frame[1] + row * frame[2] - pad - ay
        above = below + frame[2] + 2.0 * pad
        low = max(low, min(below / dy, above / dy) - 1e-9)
        high = min(high, max(below / dy, above / dy) + 1e-9)
    left, right = ax + min(low * dx, high * dx) - pad, ax + max(low * dx, high * dx) + pad
    first = max(math.floor((left - frame[0]) / frame[2]), 0)
    return first, min(math.floor((right - frame[0]) / frame[2]), int(frame[3]) - 1)


@compiled
def lay_out(points: Array, stretches: Indices, shapes: Array, frame: Array) -> Grid:
    """Return the grid: cells, begin, items, slots and the shapes of the items.

    The cells of stretch g are cells[k] for stretches[g, 3] <= k < stretches[g, 4], which is written
    here.  Cell c holds items[begin[c] : begin[c + 1]], in increasing order; slots[k] is the place
    of g itself among them.
    """
    columns, rows = int(frame[3]), int(frame[4])
    begin = np.zeros(columns * rows + 2, np.int64)
    cells, total = np.empty(8 * len(stretches) + 8, np.int64), 0
    for g in range(len(stretches)):
        pad = shapes[g, 5] + 1e-6
        ay, by = points[stretches[g, 1], 1], points[stretches[g, 2], 1]
        low = max(math.floor((min(ay, by) - pad - frame[1]) / frame[2]), 0)
        high = min(math.floor((max(ay, by) + pad - frame[1]) / frame[2]), rows - 1)
        stretches[g, 3] = total
        for row in range(low, high + 1):
            c0, c1 = columns_in(points, stretches[g], pad, frame, row)
            if total + c1 - c0 >= len(cells):
                wider = np.empty(2 * (total + c1 - c0), np.int64)
                wider[:total] = cells[:total]
                cells = wider
            for column in range(c0, c1 + 1):
                cells[total] = row * columns + column
                begin[cells[total] + 2] += 1
                total += 1
        stretches[g, 4] = total
    for cell in range(columns * rows):
        begin[cell + 2] += begin[cell + 1]
    items, slots = np.empty(total, np.int64), np.empty(total, np.int64)
    shown = np.empty((total, 6))
    for g in range(len(stretches)):
        for at in range(stretches[g, 3], stretches[g, 4]):
            slot = begin[cells[at] + 1]
            items[slot] = g
            begin[cells[at] + 1] += 1
            slots[at] = slot
            for k in range(6):
                shown[slot, k] = shapes[g, k]
    return cells[:total], begin[:-1], items, slots, shown


@compiled
def are_apart(one: Array, other: Array) -> bool:
    """Tell whether circles around two stretches, or a line along one, show that they are apart."""
    x, y = other[0] - one[0], other[1] - one[1]
    pad = one[5] + other[5] + 1e-6
    far = one[4] + other[4] + pad
    if x * x + y * y > far * far:
        return True
    turn = abs(one[2] * other[3] - one[3] * other[2])
    if abs(one[2] * y - one[3] * x) > turn + pad * one[4]:
        return True
    return bool(abs(other[2] * y - other[3] * x) > turn + pad * other[4])


@compiled
def near_stretches(
    robot: int,
    mine: tuple[int, int],
    stretches: Indices,
    shapes: Array,
    grid: Grid,
    asked: Indices,
    everybody: bool,
    stamps: Indices,
    found: Indices,
) -> tuple[Indices, int]:
    """Return pairs of a robot's stretches and others that may be near, (n, 3), and how many.

    `mine` are the robot's first stretch and the one past its last, `grid` is the answer of
    `lay_out`.  Left out are robots before this one that are asked themselves (asked[r] == 1);
    `everybody`: all are.  Rows of the answer: the two stretches and the other robot; it is `found`
    or a larger array.  stamps (g,) hold no stretch of this robot yet.
    """
    cells, begin, items, slots, shown = grid
    count = 0
    for g in range(mine[0], mine[1]):
        for at in range(stretches[g, 3], stretches[g, 4]):
            # Stretches before one's own are those of robots that come before.
            start = slots[at] + 1 if everybody else begin[cells[at]]
            for k in range(start, begin[cells[at] + 1]):
                if are_apart(shapes[g], shown[k]):
                    continue
                h = items[k]
                other = stretches[h, 0]
                if stamps[h] == g or other == robot or (other < robot and asked[other]):
                    continue
                stamps[h] = g
                if count == len(found):
                    wider = np.empty((2 * count + 8, 3), np.int64)
                    wider[:count] = found
                    found = wider
                found[count, 0], found[count, 1], found[count, 2] = g, h, other
                count += 1
    return found, count


@compiled
def sort_up(values: Indices) -> None:
    """Sort in place: Shell's method, quick when few are out of order."""
    gap = 1
    while gap < len(values) // 3:
        gap = 3 * gap + 1
    while gap > 0:
        for i in range(gap, len(values)):
            value, at = values[i], i
            while at >= gap and values[at - gap] > value:
                values[at] = values[at - gap]
                at -= gap
            values[at] = value
        gap //= 3
