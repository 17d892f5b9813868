"""Compiled: the moves between the cells of a mesh over a floor, and the distances along them.

Decides: which moves other robots' starts and goals close.  Must not know: times.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import allocation_free, compiled
from coordinator.curves.nurbs import Array

Codes = npt.NDArray[np.int32]

_FORTH: Final = np.array([(1, 0), (0, 1), (1, 1), (-1, 1), (2, 1), (1, 2), (-1, 2), (-2, 1)])
MOVES: Final = np.concatenate((_FORTH, -_FORTH))
"""Columns and rows of the sixteen moves from a cell; move k + 8 is opposite to move k."""

LENGTHS: Final = np.hypot(MOVES[:, 0], MOVES[:, 1])
"""How long these moves are, in sizes of cells."""

HALF: Final = 8
"""The number of moves without their opposites."""

_RING: Final = 4
"""More steps than the longest move has, in lengths of the shortest one."""

OPEN: Final = -1
CLOSED: Final = -2
"""Codes of moves; other codes are the number of the robot whose start or goal closes the move."""


class Mesh(NamedTuple):
    """Cells of a side of `size` [m]; the middle of the first one is (x, y) [m].

    codes (cells, 16): for each cell, row by row, which of MOVES are open.
    """

    codes: Codes
    x: float
    y: float
    size: float
    columns: int
    rows: int


@allocation_free
def close_near(mesh: Mesh, places: Array, needs: Array) -> None:
    """Close the moves that come nearer to places (n, 2) [m] than needs (n,) [m].

    Place n is that of robot n, which may go there itself.
    """
    codes, size = mesh.codes, mesh.size
    for n in range(len(places)):
        reach = needs[n] + 2.5 * size
        low = max(int((places[n, 0] - reach - mesh.x) / size), 0)
        high = min(int((places[n, 0] + reach - mesh.x) / size) + 1, mesh.columns - 1)
        bottom = max(int((places[n, 1] - reach - mesh.y) / size), 0)
        top = min(int((places[n, 1] + reach - mesh.y) / size) + 1, mesh.rows - 1)
        for row in range(bottom, top + 1):
            for column in range(low, high + 1):
                cell = row * mesh.columns + column
                x = mesh.x + column * size - places[n, 0]
                y = mesh.y + row * size - places[n, 1]
                for k in range(2 * HALF):
                    if codes[cell, k] == CLOSED or codes[cell, k] == n:
                        continue
                    dx, dy = MOVES[k, 0] * size, MOVES[k, 1] * size
                    part = min(max(-(x * dx + y * dy) / (dx * dx + dy * dy), 0.0), 1.0)
                    near_x, near_y = x + part * dx, y + part * dy
                    if near_x * near_x + near_y * near_y < needs[n] * needs[n]:
                        codes[cell, k] = n if codes[cell, k] == OPEN else CLOSED


@compiled
def distances(mesh: Mesh, robot: int, goal: int) -> Array:
    """Return how far [m] each cell (cells,) is from cell `goal` along a robot's moves.

    Infinite where no moves lead to it.
    """
    cells, size = mesh.columns * mesh.rows, mesh.size
    found, done = np.full(cells, math.inf), np.zeros(cells, np.bool_)
    # Cells by distance in steps of the shortest move, in a ring as long as the longest move (Dial
    # 1969).  Entries are linked: `top` of each step, and below each entry the next one.
    cell_of, below = np.empty(2 * HALF * cells, np.int64), np.empty(2 * HALF * cells, np.int64)
    top, step, count, left = np.full(_RING, -1), 0, 1, 1
    found[goal], cell_of[0], below[0], top[0] = 0.0, goal, -1, 0
    while left > 0:
        entry = top[step]
        if entry < 0:
            step = (step + 1) % _RING
            continue
        cell, top[step] = cell_of[entry], below[entry]
        left -= 1
        if done[cell]:
            continue
        done[cell] = True
        for k in range(2 * HALF):
            if mesh.codes[cell, k] != OPEN and mesh.codes[cell, k] != robot:
                continue
            dx, dy = MOVES[k]
            to = cell + dy * mesh.columns + dx
            there = found[cell] + size * LENGTHS[k]
            if there < found[to] - 1e-9:
                found[to] = there
                at = int(there / size) % _RING
                cell_of[count], below[count], top[at] = to, top[at], count
                count, left = count + 1, left + 1
    return found
