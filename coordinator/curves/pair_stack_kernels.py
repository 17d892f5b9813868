"""Compiled: the workspace of the search for intersections, a stack of pairs of curve pieces.

Decides: the layout of this workspace (the desk), and which pairs replace a pair that is halved.
Must not know: which pairs meet.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from coordinator.base.compiled import compiled
from coordinator.curves.bezier_kernels import (
    SIZE,
    Array,
    Indices,
    Pieces,
    halve,
)

STRANGERS: Final = 0
NEIGHBOURS: Final = 1
"""The second piece begins where the first one ends: that common point is no intersection."""
SAME: Final = 2

ROOM: Final = 256
"""Pairs that can wait: halving both pieces leaves three, and 2^-80 of a piece is no piece."""


class Desk(NamedTuple):
    """Room to work in: waiting pairs (their control points, parameters, relation), and scratch."""

    lifted: Array
    spans: Array
    relation: Indices
    halves: Array
    corners: Array
    shape: Array
    work: Array
    found: Array


@compiled
def make_desk(corners: int) -> Desk:
    """Return a desk for pieces with up to this many control points."""
    return Desk(
        np.empty((ROOM, 2, corners, 3)),
        np.empty((ROOM, 4)),
        np.empty(ROOM, np.int64),
        np.empty((2, 2, corners, 3)),
        np.empty((2, corners, 2)),
        np.empty((2, 12)),
        np.empty((corners, 3)),
        np.empty(4),
    )


@compiled
def lay_out(
    pieces: Pieces, i: int, j: int, degrees: tuple[int, int], same: bool, desk: Desk
) -> None:
    """Put a pair of whole pieces on the desk."""
    for side, piece in ((0, i), (1, j)):
        for k in range(degrees[side] + 1):
            desk.lifted[0, side, k] = pieces.control[pieces.start[piece] + k]
        for k in range(2):
            desk.spans[0, 2 * side + k] = pieces.borders[piece, k]
    desk.relation[0] = max(SAME - (j - i), STRANGERS) if same else STRANGERS


@compiled
def cut(desk: Desk, top: int, degrees: tuple[int, int]) -> int:
    """Put the halves of the pair on top in its place, of the longer piece or both; the new top."""
    relation, span = desk.relation[top], desk.spans[top].copy()
    parts = np.ones(2, np.int64)
    for side in range(2):
        if desk.shape[side, SIZE] >= 0.5 * desk.shape[1 - side, SIZE]:
            parts[side] = 2
            halve(desk.lifted[top, side], degrees[side], desk.halves[side])
        else:
            desk.halves[side, 0] = desk.lifted[top, side]
    top -= 1
    for i in range(parts[0]):
        for j in range(parts[1]):
            if relation == SAME and i > j:
                continue
            top += 1
            desk.relation[top] = STRANGERS
            if relation == SAME:
                desk.relation[top] = SAME if i == j else NEIGHBOURS
            elif relation == NEIGHBOURS and i == parts[0] - 1 and j == 0:
                desk.relation[top] = NEIGHBOURS
            for side, half in ((0, i), (1, j)):
                desk.lifted[top, side] = desk.halves[side, half]
                begin, end = span[2 * side], span[2 * side + 1]
                if parts[side] == 2:
                    middle = 0.5 * (begin + end)
                    begin, end = (begin, middle) if half == 0 else (middle, end)
                desk.spans[top, 2 * side], desk.spans[top, 2 * side + 1] = begin, end
    return top


@compiled
def settle(desk: Desk, top: int, verdict: int, rows: Array, count: int) -> Array:
    """Append what was found on top to the rows, which may move."""
    if count == len(rows):
        longer = np.empty((2 * count, 5))
        longer[:count] = rows
        rows = longer
    rows[count, 0] = verdict
    for k in range(4):
        begin, end = desk.spans[top, k // 2 * 2], desk.spans[top, k // 2 * 2 + 1]
        t = desk.found[k]
        rows[count, 1 + k] = end if t == 1.0 else begin + t * (end - begin)
    return rows
