"""Compiled: the stack of pairs of curve pieces that the search for intersections has to decide.

Decides: the layout of the stack, and which pairs replace a pair that is halved.  Must not know:
which pairs meet.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from coordinator.base.compiled import compiled
from coordinator.curves.bezier_kernels import SIZE, Array, CurvePair, Indices, halve

STRANGERS: Final = 0
NEIGHBOURS: Final = 1
"""The second piece begins where the first one ends: this common point is no intersection."""
SAME: Final = 2

U0, U1, V0, V1, KIND = range(5)
"""Entries of a range: the parameters where it begins and ends, on the first curve (U0, U1) and on
the second (V0, V1).  Results of the search are rows of these and a kind, CROSS or RUN."""

ROOM: Final = 256
"""Size of the stack.  Halving both pieces adds three pairs at most, so there is room for pieces as
small as 2^-80 of the first one."""


class PairStack(NamedTuple):
    """The pairs that wait to be decided, and scratch arrays for the pair on top.

    Of each pair: lifted (ROOM, 2, degree + 1, 3), the homogeneous control points of both pieces;
    spans (ROOM, 4), their parameters U0, U1, V0, V1; relation (ROOM,), one of STRANGERS, NEIGHBOURS
    and SAME.  Of both pieces on top: halves (2, 2, degree + 1, 3); corners (2, degree + 1, 2) [m],
    their control points; shape (2, 12), written by `survey`; found (4,), where they meet, as shares
    of their spans.  work (degree + 1, 3) is for de Casteljau's algorithm.
    """

    lifted: Array
    spans: Array
    relation: Indices
    halves: Array
    corners: Array
    shape: Array
    work: Array
    found: Array


@compiled
def make_stack(corners: int) -> PairStack:
    """Return a stack for pieces with up to `corners` control points."""
    return PairStack(
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
def start(pair: CurvePair, i: int, j: int, degrees: tuple[int, int], stack: PairStack) -> None:
    """Make pieces i and j of two curves the only pair on the stack."""
    pieces = pair.pieces
    for side, piece in ((0, i), (1, j)):
        for k in range(degrees[side] + 1):
            stack.lifted[0, side, k] = pieces.control[pieces.start[piece] + k]
        for k in range(2):
            stack.spans[0, 2 * side + k] = pieces.borders[piece, k]
    same = pair.one == pair.other
    stack.relation[0] = max(SAME - (j - i), STRANGERS) if same else STRANGERS


@compiled
def halve_top(stack: PairStack, top: int, degrees: tuple[int, int]) -> int:
    """Halve the longer piece on top, or both; replace the pair by the new ones, return the new top.

    Both are halved if neither is more than twice as large as the other.
    """
    relation, span = stack.relation[top], stack.spans[top].copy()
    parts = np.ones(2, np.int64)
    for side in range(2):
        if stack.shape[side, SIZE] >= 0.5 * stack.shape[1 - side, SIZE]:
            parts[side] = 2
            halve(stack.lifted[top, side], degrees[side], stack.halves[side])
        else:
            stack.halves[side, 0] = stack.lifted[top, side]
    top -= 1
    for i in range(parts[0]):
        for j in range(parts[1]):
            if relation == SAME and i > j:
                continue
            top += 1
            stack.relation[top] = STRANGERS
            if relation == SAME:
                stack.relation[top] = SAME if i == j else NEIGHBOURS
            elif relation == NEIGHBOURS and i == parts[0] - 1 and j == 0:
                stack.relation[top] = NEIGHBOURS
            for side, half in ((0, i), (1, j)):
                stack.lifted[top, side] = stack.halves[side, half]
                begin, end = span[2 * side], span[2 * side + 1]
                if parts[side] == 2:
                    middle = 0.5 * (begin + end)
                    begin, end = (begin, middle) if half == 0 else (middle, end)
                stack.spans[top, 2 * side], stack.spans[top, 2 * side + 1] = begin, end
    return top


@compiled
def append_found(stack: PairStack, top: int, kind: int, rows: Array, count: int) -> Array:
    """Append to `count` rows where the pair on top meets; return the rows or a longer copy."""
    if count == len(rows):
        longer = np.empty((2 * count, 5))
        longer[:count] = rows
        rows = longer
    rows[count, KIND] = kind
    for side in range(2):
        begin, end = stack.spans[top, 2 * side], stack.spans[top, 2 * side + 1]
        for k in range(2 * side, 2 * side + 2):
            t = stack.found[k]
            rows[count, k] = end if t == 1.0 else begin + t * (end - begin)
    return rows
