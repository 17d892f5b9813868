"""Compiled: which stretches of which robots come near, found through a grid of square cells.

A stretch is a few neighbouring chords of one robot, all within `out` of the segment from its first
to its last point.  Each is put into the cells that it touches when it is as wide as its robot's
half of every need; two robots too near meet in a cell, as the place between them is in both.

stretches (g, 5) int64, shapes (g, 6) [m] and frame (5,) have the columns named below.
Vertices of all robots are in one array, robot r from first[r] to first[r + 1].

Decides: which stretches must be looked at together.  Must not know: chords, ellipses, zones.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from coordinator.base.compiled import compiled
from coordinator.curves.nurbs_kernels import Array, Indices

Grid = tuple[Indices, Indices, Indices, Indices, Array]

ROBOT, BEGIN, END, FIRST_CELL, PAST_CELL = range(5)
"""Columns of stretches: robot, first and last vertex, first cell and the one past the last."""

MIDDLE_X, MIDDLE_Y, ALONG_X, ALONG_Y, RADIUS, OUT = range(6)
"""Columns of shapes [m]: the middle, the way from there to the last point, half the length with how
far vertices are out, and how far they are out with the robot's half of a need."""

LEFT, LOW, CELL, COLUMNS, ROWS = range(5)
"""Entries of a frame: least x and y, the size of a cell [m], numbers of columns and rows."""

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
            stretches[count, ROBOT], stretches[count, BEGIN], stretches[count, END] = (
                robot,
                begin,
                end,
            )
            shapes[count, MIDDLE_X] = points[begin, 0] + 0.5 * dx
            shapes[count, MIDDLE_Y] = points[begin, 1] + 0.5 * dy
            shapes[count, ALONG_X], shapes[count, ALONG_Y] = 0.5 * dx, 0.5 * dy
            shapes[count, RADIUS], shapes[count, OUT] = (
                0.5 * math.sqrt(square) + out,
                out + half[robot],
            )
            begin, count = end, count + 1
    return stretches[:count], shapes[:count]


@compiled
def columns_in(
    points: Array, stretch: Indices, pad: float, frame: Array, row: int
) -> tuple[int, int]:
    """Return the columns that a stretch as wide as `pad` may touch in a row: first, last."""
    ax, ay = points[stretch[BEGIN], 0], points[stretch[BEGIN], 1]
    dx, dy = points[stretch[END], 0] - ax, points[stretch[END], 1] - ay
    low, high = 0.0, 1.0
    if abs(dy) > 1e-9:
        below = frame[LOW] + row * frame[CELL] - pad - ay
        above = below + frame[CELL] + 2.0 * pad
        low = max(low, min(below / dy, above / dy) - 1e-9)
        high = min(high, max(below / dy, above / dy) + 1e-9)
    left, right = ax + min(low * dx, high * dx) - pad, ax + max(low * dx, high * dx) + pad
    first = max(math.floor((left - frame[LEFT]) / frame[CELL]), 0)
    return first, min(math.floor((right - frame[LEFT]) / frame[CELL]), int(frame[COLUMNS]) - 1)


@compiled
def lay_out(points: Array, stretches: Indices, shapes: Array, frame: Array) -> Grid:
    """Return the grid: cells, begin, items, slots and the shapes of the items.

    The cells of stretch g are cells[k] from FIRST_CELL to PAST_CELL of its row, which are
    written here.  Cell c holds items[begin[c] : begin[c + 1]], in increasing order; slots[k] is
    the place of g itself among them.
    """
    columns, rows = int(frame[COLUMNS]), int(frame[ROWS])
    begin = np.zeros(columns * rows + 2, np.int64)
    cells, total = np.empty(8 * len(stretches) + 8, np.int64), 0
    for g in range(len(stretches)):
        pad = shapes[g, OUT] + 1e-6
        ay, by = points[stretches[g, BEGIN], 1], points[stretches[g, END], 1]
        low = max(math.floor((min(ay, by) - pad - frame[LOW]) / frame[CELL]), 0)
        high = min(math.floor((max(ay, by) + pad - frame[LOW]) / frame[CELL]), rows - 1)
        stretches[g, FIRST_CELL] = total
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
        stretches[g, PAST_CELL] = total
    for cell in range(columns * rows):
        begin[cell + 2] += begin[cell + 1]
    items, slots = np.empty(total, np.int64), np.empty(total, np.int64)
    shown = np.empty((total, 6))
    for g in range(len(stretches)):
        for at in range(stretches[g, FIRST_CELL], stretches[g, PAST_CELL]):
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
    x, y = other[MIDDLE_X] - one[MIDDLE_X], other[MIDDLE_Y] - one[MIDDLE_Y]
    pad = one[OUT] + other[OUT] + 1e-6
    far = one[RADIUS] + other[RADIUS] + pad
    if x * x + y * y > far * far:
        return True
    turn = abs(one[ALONG_X] * other[ALONG_Y] - one[ALONG_Y] * other[ALONG_X])
    if abs(one[ALONG_X] * y - one[ALONG_Y] * x) > turn + pad * one[RADIUS]:
        return True
    return bool(abs(other[ALONG_X] * y - other[ALONG_Y] * x) > turn + pad * other[RADIUS])


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
        for at in range(stretches[g, FIRST_CELL], stretches[g, PAST_CELL]):
            # Stretches before one's own are those of robots that come before.
            start = slots[at] + 1 if everybody else begin[cells[at]]
            for k in range(start, begin[cells[at] + 1]):
                if are_apart(shapes[g], shown[k]):
                    continue
                h = items[k]
                other = stretches[h, ROBOT]
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
