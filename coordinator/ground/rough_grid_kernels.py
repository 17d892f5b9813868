"""Compiled: whether two cells of a grid are connected.

Decides: which cells belong together.  Must not know: what closes a cell.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import compiled
from coordinator.curves.nurbs import Array
from coordinator.ground.growth import Indices

Flags = npt.NDArray[np.bool_]


@compiled
def connected(open_cells: Flags, ends: Indices, closing: Array) -> bool:
    """Return whether cells ends (2, 2: column, row) are connected by open ones, or diagonally.

    open_cells (rows, columns).  Cells with their centre in a disc of closing (k, 3: x, y, radius;
    in cells) are not open.
    """
    rows, columns = open_cells.shape
    left = open_cells.copy()
    for k in range(len(closing)):
        x, y, radius = closing[k]
        if radius <= 0.0:
            continue
        for row in range(max(int(y - radius), 0), min(int(y + radius) + 1, rows)):
            for column in range(max(int(x - radius), 0), min(int(x + radius) + 1, columns)):
                if math.hypot(column + 0.5 - x, row + 0.5 - y) < radius:
                    left[row, column] = False
    column, row = ends[0]
    goal_column, goal_row = ends[1]
    left[goal_row, goal_column] = True
    queue = [(column, row)]
    while queue:
        column, row = queue.pop()
        if column == goal_column and row == goal_row:
            return True
        for r in range(max(row - 1, 0), min(row + 2, rows)):
            for c in range(max(column - 1, 0), min(column + 2, columns)):
                if left[r, c]:
                    left[r, c] = False
                    queue.append((c, r))
    return False
