"""Compiled: whether two cells of a grid are connected.

Decides: which cells belong together.  Must not know: what closes a cell.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import compiled
from coordinator.curves.nurbs import Array
from coordinator.ground.growth import Indices

Flags = npt.NDArray[np.bool_]
Marks = npt.NDArray[np.int8]

_FROM_START: Final = 2
_FROM_GOAL: Final = 3
"""Marks of open cells, which are 1 at first, that one of the ends is connected with."""


@compiled
def _marks(open_cells: Flags, closing: Array) -> Marks:
    """Return 1 for each open cell with its centre in no disc, 0 for the others, with a border of 0.

    Flat, row by row of columns + 2 cells.
    """
    rows, columns = open_cells.shape
    marks = np.zeros((rows + 2, columns + 2), np.int8)
    for row in range(rows):
        for column in range(columns):
            marks[row + 1, column + 1] = open_cells[row, column]
    for k in range(len(closing)):
        x, y, radius = closing[k]
        if radius <= 0.0:
            continue
        for row in range(max(int(y - radius), 0), min(int(y + radius) + 1, rows)):
            half = radius * radius - (row + 0.5 - y) ** 2
            if half > 0.0:
                half = math.sqrt(half)
                first = max(math.ceil(x - half - 0.5), 0)
                last = min(math.floor(x + half - 0.5), columns - 1)
                marks[row + 1, first + 1 : last + 2] = 0
    return marks.ravel()


@compiled
def connected(open_cells: Flags, ends: Indices, closing: Array) -> bool:
    """Return whether cells ends (2, 2: column, row) are connected by open ones, or diagonally.

    open_cells (rows, columns).  Cells with their centre in a disc of closing (k, 3: x, y, radius;
    in cells) are not open.  The ends are.
    """
    width = open_cells.shape[1] + 2
    marks = _marks(open_cells, closing)
    around = np.array((-width - 1, -width, -width + 1, -1, 1, width - 1, width, width + 1))
    start, goal = (ends[:, 1] + 1) * width + ends[:, 0] + 1
    if start == goal:
        return True
    marks[start], marks[goal] = _FROM_START, _FROM_GOAL
    mine, theirs = np.empty(len(marks), np.int32), np.empty(len(marks), np.int32)
    mine[0], theirs[0] = start, goal
    count, other_count, mark = 1, 1, _FROM_START
    while count:
        count -= 1
        cell = mine[count]
        for step in around:
            near = cell + step
            if marks[near] == _FROM_START + _FROM_GOAL - mark:
                return True
            if marks[near] == 1:
                marks[near] = mark
                mine[count] = near
                count += 1
        if count:  # Both ends are searched in turn: the smaller part decides how long it takes.
            mine, theirs, mark = theirs, mine, _FROM_START + _FROM_GOAL - mark
            count, other_count = other_count, count
    return False
