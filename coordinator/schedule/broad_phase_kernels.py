"""Compiled: which stretches of which robots come near each other, found through a grid of cells.

A stretch is a few consecutive chords of one robot.  It is grown by the robot's share of every need,
its radius plus half the margin plus the error of its chords, and entered into all square cells that
it then touches.  Where two robots are nearer than both shares together, some place between them
lies in both grown stretches, so they share a cell.

The vertices of all robots are in one array, those of robot r from first[r] to first[r + 1].

Decides: which stretches must be looked at together.  Must not know: chords, ellipses, zones.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import allocation_free, compiled
from coordinator.curves.nurbs_kernels import Array, Indices

ROBOT, BEGIN, END, FIRST_CELL, PAST_CELL = range(5)
"""Columns of stretches (g, 5): the robot, the first and last vertex, and where in Grid.cells the
cells of the stretch begin and end."""

MIDDLE_X, MIDDLE_Y, ALONG_X, ALONG_Y, RADIUS, OUT = range(6)
"""Columns of shapes (g, 6) [m] of stretches: the middle of the segment from the first to the last
vertex, the vector from there to the last vertex, the radius of a circle around the middle that
holds all vertices, and the greatest distance of a vertex from the segment plus the robot's share of
every need."""

MINE, THEIRS, OTHER = range(3)
"""Columns of pairs (n, 3) of near stretches: one's own, another robot's, and that robot."""

MOST_CHORDS: Final = 8
"""A stretch has at most this many chords."""


class Frame(NamedTuple):
    """The square cells of a grid: its least x and y [m], the side of a cell [m], columns and rows.

    Cells are numbered row after row.
    """

    left: float
    low: float
    cell: float
    columns: int
    rows: int


class Grid(NamedTuple):
    """The stretches of a fleet, and the cells that each touches.

    Stretch g touches cells[k] for k from FIRST_CELL to PAST_CELL of its row.  Cell c is touched by
    items[begin[c] : begin[c + 1]], in increasing order; slots[k] is the index in `items` of
    the entry of stretch g in cells[k].  shown (items, 6): the shapes of the items, in their order.
    """

    stretches: Indices
    shapes: Array
    cells: Indices
    begin: Indices
    items: Indices
    slots: Indices
    shown: Array


@compiled
def stretches_of(first: Indices, points: Array, half: Array, size: float) -> tuple[Indices, Array]:
    """Return the stretches of all robots and their shapes.

    Up to MOST_CHORDS chords make one stretch, while the segment from its first to its last vertex
    is no longer than `size` [m].  half (robots,) [m]: each robot's share of every need.
    """
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


@allocation_free
def columns_in(
    points: Array, stretch: Indices, pad: float, frame: Frame, row: int
) -> tuple[int, int]:
    """Return the first and last column that a stretch grown by `pad` [m] may touch in a row."""
    ax, ay = points[stretch[BEGIN], 0], points[stretch[BEGIN], 1]
    dx, dy = points[stretch[END], 0] - ax, points[stretch[END], 1] - ay
    low, high = 0.0, 1.0
    if abs(dy) > 1e-9:
        below = frame.low + row * frame.cell - pad - ay
        above = below + frame.cell + 2.0 * pad
        low = max(low, min(below / dy, above / dy) - 1e-9)
        high = min(high, max(below / dy, above / dy) + 1e-9)
    left, right = ax + min(low * dx, high * dx) - pad, ax + max(low * dx, high * dx) + pad
    first = max(math.floor((left - frame.left) / frame.cell), 0)
    return first, min(math.floor((right - frame.left) / frame.cell), frame.columns - 1)


@allocation_free
def _rows_in(points: Array, stretch: Indices, pad: float, frame: Frame) -> tuple[int, int]:
    """Return the first and last row that a stretch grown by `pad` [m] may touch."""
    ay, by = points[stretch[BEGIN], 1], points[stretch[END], 1]
    first = max(math.floor((min(ay, by) - pad - frame.low) / frame.cell), 0)
    last = math.floor((max(ay, by) + pad - frame.low) / frame.cell)
    return first, min(last, frame.rows - 1)


@compiled
def _touched(
    points: Array, stretches: Indices, shapes: Array, asked: Indices, frame: Frame
) -> npt.NDArray[np.bool_]:
    """Tell of each cell whether a robot that is asked for touches it."""
    found = np.full(frame.columns * frame.rows, bool(asked.all()))
    if found[0]:
        return found
    for g in range(len(stretches)):
        if not asked[stretches[g, ROBOT]]:
            continue
        pad = shapes[g, OUT] + 1e-6
        low, high = _rows_in(points, stretches[g], pad, frame)
        for row in range(low, high + 1):
            c0, c1 = columns_in(points, stretches[g], pad, frame, row)
            found[row * frame.columns + c0 : row * frame.columns + c1 + 1] = True
    return found


@compiled
def lay_out(points: Array, stretches: Indices, shapes: Array, asked: Indices, frame: Frame) -> Grid:
    """Return stretches in a grid, and write their FIRST_CELL and PAST_CELL.

    Only cells that a robot touches with asked[r] == 1 have entries: no other cell is looked up.
    """
    columns, rows = frame.columns, frame.rows
    begin = np.zeros(columns * rows + 2, np.int64)
    wanted = _touched(points, stretches, shapes, asked, frame)
    cells, total = np.empty(8 * len(stretches) + 8, np.int64), 0
    for g in range(len(stretches)):
        pad = shapes[g, OUT] + 1e-6
        low, high = _rows_in(points, stretches[g], pad, frame)
        stretches[g, FIRST_CELL] = total
        for row in range(low, high + 1):
            c0, c1 = columns_in(points, stretches[g], pad, frame, row)
            if total + c1 - c0 >= len(cells):
                wider = np.empty(2 * (total + c1 - c0), np.int64)
                wider[:total] = cells[:total]
                cells = wider
            for column in range(c0, c1 + 1):
                if not wanted[row * columns + column]:
                    continue
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
    return Grid(stretches, shapes, cells[:total], begin[:-1], items, slots, shown)


@allocation_free
def are_apart(one: Array, other: Array) -> bool:
    """Tell whether two grown stretches, given by their shapes, surely have no point in common.

    Either their circles are apart, or a line parallel to one of their segments separates them.
    """
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
    grid: Grid,
    asked: Indices,
    everybody: bool,
    stamps: Indices,
    found: Indices,
) -> tuple[Indices, int]:
    """Return pairs of a robot's stretches and others that may be near them, and how many.

    The robot's own stretches are those from mine[0] to mine[1] - 1.  Robots of lower number whose
    pairs are wanted too (asked[r] == 1) are left out, because the same pairs are found for them;
    `everybody`: whether the pairs of all robots are wanted.  The pairs are written into `found`
    (n, 3) or, if it is too small, into a larger copy of it.
    stamps (stretches,) is used to find each pair once; none of its values may be a stretch of this
    robot.
    """
    stretches, shapes, cells, begin, items, slots, shown = grid
    count = 0
    for g in range(mine[0], mine[1]):
        for at in range(stretches[g, FIRST_CELL], stretches[g, PAST_CELL]):
            # Stretches of lower number than g belong to this robot or to robots of lower number.
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
                found[count, MINE], found[count, THEIRS], found[count, OTHER] = g, h, other
                count += 1
    return found, count


@allocation_free
def sort_up(values: Indices) -> None:
    """Sort in place by Shell's method, which is quick when few values are out of order."""
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
