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
import numpy.typing as npt

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

_RUN: Final = 4
"""How many pieces share a box on the lowest level of a tree."""

_LEVELS: Final = 40
_DEEPEST: Final = 2 * _LEVELS


class Needs(NamedTuple):
    """The staircases by robot behind, then ahead: knots first[k] to first[k + 1] of at, need [ms].

    pair_at (n + 1,): where the staircases of each robot behind begin.  turned: the staircases by
    robot ahead, those of robot r from turned_at[r] to turned_at[r + 1].
    """

    pair_at: Indices
    behind: Indices
    ahead: Indices
    turned_at: Indices
    turned: Indices
    first: Indices
    at: npt.NDArray[np.int32]
    need: npt.NDArray[np.int32]


class _Trees(NamedTuple):
    """Boxes (n, 4) around runs of pieces: left, bottom, right, top [m].

    On level 0 of a robot's tree each box is around _RUN pieces, on each higher level around two
    boxes of the level below.  Level k of robot r begins at at[r, k]; its root is on level top[r].
    """

    boxes: Array
    at: Indices
    top: Indices


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
    low, high, time = begin, end, 1000.0 * time
    while low < high:
        middle = (low + high) // 2
        if needs.at[middle] <= time:
            low = middle + 1
        else:
            high = middle
    k = low - 1
    if k < begin:
        return -math.inf
    need = float(needs.need[k])
    if k < end - 1:
        rise = (time - needs.at[k]) / (float(needs.at[k + 1]) - needs.at[k])
        need += rise * (float(needs.need[k + 1]) - need)
    return need / 1000.0


@allocation_free
def _segment_square(ax: float, ay: float, bx: float, by: float) -> float:
    """Return the square of the least distance of the origin from the segment a to b."""
    dx, dy = bx - ax, by - ay
    square, k = dx * dx + dy * dy, 0.0
    if square > 0.0:
        k = min(max(-(ax * dx + ay * dy) / square, 0.0), 1.0)
    x, y = ax + k * dx, ay + k * dy
    return x * x + y * y


@allocation_free
def _keep_apart(
    p: tuple[float, float, float, float], q: tuple[float, float, float, float], enough: float
) -> bool:
    """Return whether two segments (x, y, x, y) are at least a distance [m] apart everywhere."""
    px, py, rx, ry = p
    qx, qy, sx, sy = q
    if (
        min(px, rx) - max(qx, sx) >= enough
        or min(qx, sx) - max(px, rx) >= enough
        or min(py, ry) - max(qy, sy) >= enough
        or min(qy, sy) - max(py, ry) >= enough
    ):
        return True
    square = enough * enough
    if (px - qx) ** 2 + (py - qy) ** 2 < square or (rx - sx) ** 2 + (ry - sy) ** 2 < square:
        return False
    side_q = (sx - qx) * (py - qy) - (sy - qy) * (px - qx)
    side_s = (sx - qx) * (ry - qy) - (sy - qy) * (rx - qx)
    side_p = (rx - px) * (qy - py) - (ry - py) * (qx - px)
    side_r = (rx - px) * (sy - py) - (ry - py) * (sx - px)
    if side_q * side_s < 0.0 and side_p * side_r < 0.0:
        return False
    return bool(
        _segment_square(px - qx, py - qy, px - sx, py - sy) >= square
        and _segment_square(rx - qx, ry - qy, rx - sx, ry - sy) >= square
        and _segment_square(qx - px, qy - py, qx - rx, qy - ry) >= square
        and _segment_square(sx - px, sy - py, sx - rx, sy - ry) >= square
    )


@allocation_free
def _part(piece: Array, begin: float, end: float) -> tuple[float, float, float, float]:
    """Return the segment that a piece drives from one time to another [s]."""
    span = piece[END] - piece[BEGIN]
    low, high = (begin - piece[BEGIN]) / span, (end - piece[BEGIN]) / span
    dx, dy = piece[X1] - piece[X0], piece[Y1] - piece[Y0]
    x, y = piece[X0], piece[Y0]
    return x + low * dx, y + low * dy, x + high * dx, y + high * dy


@allocation_free
def _time_nearest(piece: Array, begin: float, end: float, x: float, y: float) -> float:
    """Return when a piece is nearest to a place [m], from one time to another [s]."""
    ax, ay, bx, by = _part(piece, begin, end)
    dx, dy = bx - ax, by - ay
    square = dx * dx + dy * dy
    if square == 0.0:
        return end
    return begin + (end - begin) * min(max(((x - ax) * dx + (y - ay) * dy) / square, 0.0), 1.0)


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
        if p0 >= p1 or _keep_apart(_part(p, p0, p1), _part(q, begin, end), enough):
            continue
        if end - begin < SHORTEST:
            x, y, _, _ = _part(q, begin, end)
            return _time_nearest(p, p0, p1, x, y), begin
        middle = 0.5 * (begin + end)
        stack[depth, 0], stack[depth, 1] = middle, end
        stack[depth + 1, 0], stack[depth + 1, 1] = begin, middle
        depth += 2
    return math.inf, math.inf


@compiled
def _trees(pieces: Array, first: Indices) -> _Trees:
    """Return the trees of all robots; boxes are wide enough for the deviations of their pieces."""
    count = len(first) - 1
    at, top = np.zeros((count, _LEVELS), np.int64), np.zeros(count, np.int64)
    total = 0
    for robot in range(count):
        size, level = (first[robot + 1] - first[robot] + _RUN - 1) // _RUN, 0
        while True:
            at[robot, level], total = total, total + size
            if size <= 1:
                break
            size, level = (size + 1) // 2, level + 1
        top[robot] = level
    boxes = np.empty((total, 4))
    for robot in range(count):
        begin, end = first[robot], first[robot + 1]
        for level in range(top[robot] + 1):
            size = ((end - begin + _RUN - 1) // _RUN + 2**level - 1) // 2**level
            for k in range(size):
                x0 = y0 = math.inf
                x1 = y1 = -math.inf
                if level == 0:
                    for p in range(begin + k * _RUN, min(begin + (k + 1) * _RUN, end)):
                        piece, wide = pieces[p], pieces[p, DEVIATION]
                        x0 = min(x0, min(piece[X0], piece[X1]) - wide)
                        y0 = min(y0, min(piece[Y0], piece[Y1]) - wide)
                        x1 = max(x1, max(piece[X0], piece[X1]) + wide)
                        y1 = max(y1, max(piece[Y0], piece[Y1]) + wide)
                else:
                    below, past = at[robot, level - 1], at[robot, level]
                    for part in range(below + 2 * k, min(below + 2 * k + 2, past)):
                        x0, y0 = min(x0, boxes[part, 0]), min(y0, boxes[part, 1])
                        x1, y1 = max(x1, boxes[part, 2]), max(y1, boxes[part, 3])
                box = boxes[at[robot, level] + k]
                box[0], box[1], box[2], box[3] = x0, y0, x1, y1
    return _Trees(boxes, at, top)


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
def _may_be_near(rows: Array, p: int, q: int, distance: float) -> bool:
    """Return whether the boxes of two pieces are less than a distance [m] apart."""
    ax, ay, cx, cy = rows[p, X0], rows[p, Y0], rows[p, X1], rows[p, Y1]
    bx, by, dx, dy = rows[q, X0], rows[q, Y0], rows[q, X1], rows[q, Y1]
    return bool(
        min(ax, cx) - max(bx, dx) < distance
        and min(bx, dx) - max(ax, cx) < distance
        and min(ay, cy) - max(by, dy) < distance
        and min(by, dy) - max(ay, cy) < distance
    )


@allocation_free
def _open_in_runs(
    rows: Array, ahead: tuple[int, int], behind: tuple[int, int], keep: float, needs: Needs,
    pair: int, tau: float, spans: Array,
) -> tuple[float, float]:  # fmt: skip
    """Return what `_open_times` does, for the first two pieces of two runs that are open."""
    for q in range(behind[0], behind[1]):
        need, latest = need_at(needs, pair, rows[q, BEGIN]), rows[q, END] - tau
        for p in range(ahead[0], ahead[1]):
            if rows[p, END] <= need or rows[p, BEGIN] >= latest:
                continue
            enough = keep + rows[p, DEVIATION] + rows[q, DEVIATION]
            if not _may_be_near(rows, p, q, enough):
                continue
            t_p, t_q = _open_times(rows[p], rows[q], enough, needs, pair, tau, spans)
            if t_q < math.inf:
                return t_p, t_q
    return math.inf, math.inf


@allocation_free
def _open_in_pair(
    motions: Motions, trees: _Trees, a: int, b: int, needs: Needs, pairs: tuple[int, int],
    tau: float, nodes: Indices, spans: Array,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Return plan times [s] of conflicts of two motions that stay open, else inf.

    The first two are times of a, ahead, and of b; the others of b, ahead, and of a.  pairs: the
    staircases of b behind a and of a behind b, -1 without one.  nodes (_DEEPEST, 4) and spans
    (_DEEPEST, 2) are memory for nodes of both trees (level and number) and for spans of time.
    """
    rows, first, keeps, _ = motions
    keep = keeps[a] + keeps[b]
    ahead_a = ahead_b = behind_a = behind_b = math.inf
    nodes[0, 0], nodes[0, 1], nodes[0, 2], nodes[0, 3] = trees.top[a], 0, trees.top[b], 0
    depth = 1
    while depth > 0 and (math.isinf(behind_a) or math.isinf(behind_b)):
        depth -= 1
        up_a, node_a, up_b, node_b = nodes[depth]
        box_a, box_b = trees.at[a, up_a] + node_a, trees.at[b, up_b] + node_b
        if _are_apart(trees.boxes[box_a], trees.boxes[box_b], keep):
            continue
        p0, p1 = first[a] + ((node_a * _RUN) << up_a), first[a] + (((node_a + 1) * _RUN) << up_a)
        q0, q1 = first[b] + ((node_b * _RUN) << up_b), first[b] + (((node_b + 1) * _RUN) << up_b)
        p1, q1 = min(p1, first[a + 1]), min(q1, first[b + 1])
        begin_a, end_a = rows[p0, BEGIN], rows[p1 - 1, END]
        begin_b, end_b = rows[q0, BEGIN], rows[q1 - 1, END]
        is_open = math.isinf(behind_b) and begin_a < end_b - tau
        is_open = is_open and end_a > need_at(needs, pairs[0], begin_b)
        is_open_turned = math.isinf(behind_a) and begin_b < end_a - tau
        is_open_turned = is_open_turned and end_b > need_at(needs, pairs[1], begin_a)
        if not (is_open or is_open_turned):
            continue
        if up_a > 0 and up_a >= up_b:
            below = trees.at[a, up_a] - trees.at[a, up_a - 1]
            for part in range(min(2 * node_a + 1, below - 1), 2 * node_a - 1, -1):
                nodes[depth, 0], nodes[depth, 1] = up_a - 1, part
                nodes[depth, 2], nodes[depth, 3] = up_b, node_b
                depth += 1
        elif up_b > 0:
            below = trees.at[b, up_b] - trees.at[b, up_b - 1]
            for part in range(min(2 * node_b + 1, below - 1), 2 * node_b - 1, -1):
                nodes[depth, 0], nodes[depth, 1] = up_a, node_a
                nodes[depth, 2], nodes[depth, 3] = up_b - 1, part
                depth += 1
        else:
            if is_open:
                ahead_a, behind_b = _open_in_runs(
                    rows, (p0, p1), (q0, q1), keep, needs, pairs[0], tau, spans
                )
            if is_open_turned:
                ahead_b, behind_a = _open_in_runs(
                    rows, (q0, q1), (p0, p1), keep, needs, pairs[1], tau, spans
                )
    return ahead_a, behind_b, ahead_b, behind_a


@compiled
def uncovered(motions: Motions, needs: Needs, tau: float, begin: int, end: int) -> list[Uncovered]:
    """Return a conflict of each ordered pair of robots that has one which no staircase covers.

    Only pairs whose first robot is one from `begin` to `end` are looked at.  `keep` of motions [m]:
    each robot's part of the least distance that is enough.
    """
    found = [Uncovered(0, 0, 0.0, 0.0) for _ in range(0)]
    pieces, first, keep, asked = motions
    count, trees = len(keep), _trees(pieces, first)
    nodes, spans = np.empty((_DEEPEST, 4), np.int64), np.empty((_DEEPEST, 2))
    for a in range(begin, end):
        before_a, behind_a = np.full(count, -1, np.int64), np.full(count, -1, np.int64)
        for pair in range(needs.pair_at[a], needs.pair_at[a + 1]):
            before_a[needs.ahead[pair]] = pair
        for pair in needs.turned[needs.turned_at[a] : needs.turned_at[a + 1]]:
            behind_a[needs.behind[pair]] = pair
        for b in range(a + 1, count):
            if not (asked[a] or asked[b]):
                continue
            ahead, behind, ahead_turned, behind_turned = _open_in_pair(
                motions, trees, a, b, needs, (behind_a[b], before_a[b]), tau, nodes, spans
            )
            if behind < math.inf:
                found.append(Uncovered(a, b, ahead, behind))
            if behind_turned < math.inf:
                found.append(Uncovered(b, a, ahead_turned, behind_turned))
    return found
