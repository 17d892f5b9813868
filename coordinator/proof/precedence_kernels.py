"""Compiled: a conflict that no staircase covers, found by halving pieces of motion.

For an ordered pair, a conflict at plan times t_i < t_j - tau is covered when t_i is at most the
need at t_j.  Two pieces are done when the part of the first that is not covered keeps apart from
the second; otherwise the second is halved.  One shorter than SHORTEST that is still open is a
conflict that no staircase covers.

Decides: which conflicts are covered.  Must not know: how staircases were found.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from coordinator.base.compiled import allocation_free, compiled
from coordinator.proof.separation_kernels import (
    BEGIN,
    DEVIATION,
    END,
    X0,
    X1,
    Y0,
    Y1,
    Array,
    Indices,
    Motions,
)

SHORTEST: Final = 2.5e-4
"""Pieces shorter than this [s] are not halved again."""

_GROUP: Final = 8
"""Pieces whose common box is looked at first."""

_DEEPEST: Final = 64


class Needs(NamedTuple):
    """The staircases by robot behind, then ahead: knots first[k] to first[k + 1] of at, need [s].

    pair_at (n + 1,): where the staircases of each robot behind begin.
    """

    pair_at: Indices
    ahead: Indices
    first: Indices
    at: Array
    need: Array


class Uncovered(NamedTuple):
    """A conflict that no staircase covers: robots ahead and behind, and their plan times [s]."""

    ahead: int
    behind: int
    t_ahead: float
    t_behind: float


@allocation_free
def need_at(needs: Needs, pair: int, time: float) -> float:
    """Return the need [s] of a staircase at a plan time [s]; -inf without one (pair < 0)."""
    if pair < 0:
        return -math.inf
    begin, end = needs.first[pair], needs.first[pair + 1]
    k = begin + int(np.searchsorted(needs.at[begin:end], time, side="right")) - 1
    if k < begin:
        return -math.inf
    if k == end - 1:
        return float(needs.need[k])
    rise = (time - needs.at[k]) / (needs.at[k + 1] - needs.at[k])
    return float(needs.need[k] + rise * (needs.need[k + 1] - needs.need[k]))


@allocation_free
def _segment_gap(ax: float, ay: float, bx: float, by: float) -> float:
    """Return the least distance of the origin from the segment a to b."""
    dx, dy = bx - ax, by - ay
    square, k = dx * dx + dy * dy, 0.0
    if square > 0.0:
        k = min(max(-(ax * dx + ay * dy) / square, 0.0), 1.0)
    x, y = ax + k * dx, ay + k * dy
    return math.sqrt(x * x + y * y)


@allocation_free
def _gap(p: tuple[float, float, float, float], q: tuple[float, float, float, float]) -> float:
    """Return the least distance [m] of two segments (x, y, x, y)."""
    px, py, rx, ry = p
    qx, qy, sx, sy = q
    side_q = (sx - qx) * (py - qy) - (sy - qy) * (px - qx)
    side_s = (sx - qx) * (ry - qy) - (sy - qy) * (rx - qx)
    side_p = (rx - px) * (qy - py) - (ry - py) * (qx - px)
    side_r = (rx - px) * (sy - py) - (ry - py) * (sx - px)
    if side_q * side_s < 0.0 and side_p * side_r < 0.0:
        return 0.0
    return min(
        min(_segment_gap(px - qx, py - qy, px - sx, py - sy),
            _segment_gap(rx - qx, ry - qy, rx - sx, ry - sy)),
        min(_segment_gap(qx - px, qy - py, qx - rx, qy - ry),
            _segment_gap(sx - px, sy - py, sx - rx, sy - ry)),
    )  # fmt: skip


@allocation_free
def _part(piece: Array, begin: float, end: float) -> tuple[float, float, float, float]:
    """Return the segment that a piece drives from one time to another [s]."""
    span = piece[END] - piece[BEGIN]
    low, high = (begin - piece[BEGIN]) / span, (end - piece[BEGIN]) / span
    dx, dy = piece[X1] - piece[X0], piece[Y1] - piece[Y0]
    x, y = piece[X0], piece[Y0]
    return x + low * dx, y + low * dy, x + high * dx, y + high * dy


@allocation_free
def _open_times(
    p: Array, q: Array, enough: float, needs: Needs, pair: int, tau: float, stack: Array
) -> tuple[float, float]:
    """Return times [s] on the pieces p of the robot ahead and q of the one behind that stay open.

    inf, inf when there are none.  stack (_DEEPEST, 2) is memory for spans of time.
    """
    stack[0, 0], stack[0, 1] = q[BEGIN], q[END]
    depth = 1
    while depth > 0:
        depth -= 1
        begin, end = stack[depth]
        p0, p1 = max(p[BEGIN], need_at(needs, pair, begin)), min(p[END], end - tau)
        if p0 >= p1 or _gap(_part(p, p0, p1), _part(q, begin, end)) >= enough:
            continue
        if end - begin < SHORTEST:
            return p1, begin
        middle = 0.5 * (begin + end)
        stack[depth, 0], stack[depth, 1] = middle, end
        stack[depth + 1, 0], stack[depth + 1, 1] = begin, middle
        depth += 2
    return math.inf, math.inf


@compiled
def _boxes(pieces: Array) -> Array:
    """Return the box (x, y, x, y) of each group of pieces, wide enough for their deviations."""
    boxes = np.empty(((len(pieces) + _GROUP - 1) // _GROUP, 4))
    for group in range(len(boxes)):
        x0 = y0 = math.inf
        x1 = y1 = -math.inf
        for piece in pieces[group * _GROUP : (group + 1) * _GROUP]:
            wide = piece[DEVIATION]
            x0 = min(x0, min(piece[X0], piece[X1]) - wide)
            y0 = min(y0, min(piece[Y0], piece[Y1]) - wide)
            x1 = max(x1, max(piece[X0], piece[X1]) + wide)
            y1 = max(y1, max(piece[Y0], piece[Y1]) + wide)
        boxes[group, 0], boxes[group, 1], boxes[group, 2], boxes[group, 3] = x0, y0, x1, y1
    return boxes


@allocation_free
def _are_apart(a: Array, b: Array, distance: float) -> bool:
    """Return whether two boxes are at least a distance [m] apart along x or y."""
    return bool(
        a[0] - b[2] >= distance
        or b[0] - a[2] >= distance
        or a[1] - b[3] >= distance
        or b[1] - a[3] >= distance
    )


@allocation_free
def _may_be_near(a: Array, p: int, b: Array, q: int, distance: float) -> bool:
    """Return whether the boxes of pieces p of a and q of b are less than a distance [m] apart."""
    ax, ay, cx, cy = a[p, X0], a[p, Y0], a[p, X1], a[p, Y1]
    bx, by, dx, dy = b[q, X0], b[q, Y0], b[q, X1], b[q, Y1]
    return bool(
        min(ax, cx) - max(bx, dx) < distance
        and min(bx, dx) - max(ax, cx) < distance
        and min(ay, cy) - max(by, dy) < distance
        and min(by, dy) - max(ay, cy) < distance
    )


@allocation_free
def _open_in_pair(
    ahead: Array, behind: Array, boxes: tuple[Array, Array], keep: float, needs: Needs, pair: int,
    tau: float, stack: Array,
) -> tuple[float, float]:  # fmt: skip
    """Return plan times [s] of a conflict of two motions (m, 7) that stays open, else inf."""
    for g in range(len(boxes[0])):
        first_p, end_p = g * _GROUP, min((g + 1) * _GROUP, len(ahead))
        for h in range(len(boxes[1])):
            first_q, end_q = h * _GROUP, min((h + 1) * _GROUP, len(behind))
            if behind[end_q - 1, END] - tau <= ahead[first_p, BEGIN]:
                continue
            if _are_apart(boxes[0][g], boxes[1][h], keep):
                continue
            if ahead[end_p - 1, END] <= need_at(needs, pair, behind[first_q, BEGIN]):
                continue
            for q in range(first_q, end_q):
                need, latest = need_at(needs, pair, behind[q, BEGIN]), behind[q, END] - tau
                for p in range(first_p, end_p):
                    if ahead[p, END] <= need or ahead[p, BEGIN] >= latest:
                        continue
                    enough = keep + ahead[p, DEVIATION] + behind[q, DEVIATION]
                    if not _may_be_near(ahead, p, behind, q, enough):
                        continue
                    t_p, t_q = _open_times(ahead[p], behind[q], enough, needs, pair, tau, stack)
                    if t_q < math.inf:
                        return t_p, t_q
    return math.inf, math.inf


@compiled
def uncovered(motions: Motions, needs: Needs, tau: float) -> list[Uncovered]:
    """Return a conflict of each ordered pair of robots that has one which no staircase covers.

    `keep` of motions [m]: each robot's part of the least distance that is enough.
    """
    found = [Uncovered(0, 0, 0.0, 0.0) for _ in range(0)]
    pieces, first, keep, asked = motions
    count, stack = len(keep), np.empty((_DEEPEST, 2))
    boxes = [_boxes(pieces[first[r] : first[r + 1]]) for r in range(count)]
    around = np.empty((count, 4))
    for r in range(count):
        around[r, 0], around[r, 1] = boxes[r][:, 0].min(), boxes[r][:, 1].min()
        around[r, 2], around[r, 3] = boxes[r][:, 2].max(), boxes[r][:, 3].max()
    for behind in range(count):
        pair_of = np.full(count, -1, np.int64)
        for pair in range(needs.pair_at[behind], needs.pair_at[behind + 1]):
            pair_of[needs.ahead[pair]] = pair
        his = pieces[first[behind] : first[behind + 1]]
        for ahead in range(count):
            apart = keep[ahead] + keep[behind]
            if ahead == behind or not (asked[ahead] or asked[behind]):
                continue
            if _are_apart(around[ahead], around[behind], apart):
                continue
            its = pieces[first[ahead] : first[ahead + 1]]
            t_ahead, t_behind = _open_in_pair(
                its, his, (boxes[ahead], boxes[behind]), apart, needs, pair_of[ahead], tau, stack
            )  # fmt: skip
            if t_behind < math.inf:
                found.append(Uncovered(ahead, behind, t_ahead, t_behind))
    return found
