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
    """Return 1 for each open cell with its centre in no disc, 0 for the others."""
    rows, columns = open_cells.shape
    marks = open_cells.astype(np.int8)
    for k in range(len(closing)):
        x, y, radius = closing[k]
        if radius <= 0.0:
            continue
        for row in range(max(int(y - radius), 0), min(int(y + radius) + 1, rows)):
            for column in range(max(int(x - radius), 0), min(int(x + radius) + 1, columns)):
                if math.hypot(column + 0.5 - x, row + 0.5 - y) < radius:
                    marks[row, column] = 0
    return marks


@compiled
def connected(open_cells: Flags, ends: Indices, closing: Array) -> bool:
    """Return whether cells ends (2, 2: column, row) are connected by open ones, or diagonally.

    open_cells (rows, columns).  Cells with their centre in a disc of closing (k, 3: x, y, radius;
    in cells) are not open.
    """
    rows, columns = open_cells.shape
    marks = _marks(open_cells, closing)
    mine, theirs, mark = [(ends[0, 0], ends[0, 1])], [(ends[1, 0], ends[1, 1])], _FROM_START
    marks[ends[1, 1], ends[1, 0]] = _FROM_GOAL
    if marks[ends[0, 1], ends[0, 0]] == _FROM_GOAL:
        return True
    marks[ends[0, 1], ends[0, 0]] = _FROM_START
    while mine:
        column, row = mine.pop()
        for r in range(max(row - 1, 0), min(row + 2, rows)):
            for c in range(max(column - 1, 0), min(column + 2, columns)):
                if marks[r, c] == _FROM_START + _FROM_GOAL - mark:
                    return True
                if marks[r, c] == 1:
                    marks[r, c] = mark
                    mine.append((c, r))
        if mine:  # Both ends are searched in turn: the smaller part decides how long it takes.
            mine, theirs, mark = theirs, mine, _FROM_START + _FROM_GOAL - mark
    return False
