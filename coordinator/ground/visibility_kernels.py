"""Compiled: lines of sight on grown ground.

Decides: which lines are free.  Must not know: why an edge is there, and what a line is for.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from coordinator.base.compiled import compiled
from coordinator.curves.nurbs import Array
from coordinator.ground.grid_kernels import cross_each_other, point_gap
from coordinator.ground.growth import Indices


class Sight(NamedTuple):
    """Grown ground (growth.py) in a grid (grid_kernels.py), and what its vertices see.

    turns, before, after (n, 2): vertices that ways turn at; edges (m, 4), owners, beyond (m, 2):
    the outline that blocks, grown by `reach` [m] from corners (c, 2); the vertices lie farther out
    by `room` [m].  What vertex v sees is
    pool[rows[v, 0] : rows[v, 1]], once it has been looked for (-1: not yet); rows[-1, 1] is the
    end of the pool.
    """

    turns: Array
    before: Array
    after: Array
    rows: Indices
    pool: Indices
    edges: Array
    owners: Indices
    beyond: Array
    corners: Array
    reach: float
    room: float
    first: Indices
    items: Indices
    frame: Array


@compiled
def _spares(
    px: float, py: float, qx: float, qy: float, k: int, sight: Sight, spared: Indices
) -> bool:
    """Tell whether p-q crosses edge k only where a spared corner has it beyond its arc."""
    edges, owners, beyond = sight.edges, sight.owners, sight.beyond
    cut0, cut1 = 0.0, 0.0
    for corner in spared:
        if corner != owners[k, 0] and corner != owners[k, 1]:
            continue
        if owners[k, 0] == corner:
            cut0 = beyond[k, 0]
        if owners[k, 1] == corner:
            cut1 = beyond[k, 1]
    if cut0 == 0.0 and cut1 == 0.0:
        return False
    ax, ay, bx, by = edges[k, 0], edges[k, 1], edges[k, 2], edges[k, 3]
    length = math.hypot(bx - ax, by - ay)
    if cut0 + cut1 >= length:
        return True
    ux, uy = (bx - ax) / length, (by - ay) / length
    ax, ay, bx, by = ax + cut0 * ux, ay + cut0 * uy, bx - cut1 * ux, by - cut1 * uy
    return not cross_each_other(px, py, qx, qy, ax, ay, bx, by)


@compiled
def sees(px: float, py: float, qx: float, qy: float, sight: Sight, spared: Indices) -> bool:
    """Tell whether the straight line from p to q crosses no edge.

    Of `spared` corners the arc blocks, not the tangent polygon.
    The grid is walked from cell to cell (Amanatides and Woo 1987).
    """
    for corner in spared:
        x, y = sight.corners[corner, 0], sight.corners[corner, 1]
        if point_gap(x, y, px, py, qx, qy) < sight.reach:
            return False
    first, items, frame, edges = sight.first, sight.items, sight.frame, sight.edges
    x0, y0, size = frame[0], frame[1], frame[2]
    columns, rows = int(frame[3]), int(frame[4])
    c = min(max(int((px - x0) / size), 0), columns - 1)
    r = min(max(int((py - y0) / size), 0), rows - 1)
    last_c = min(max(int((qx - x0) / size), 0), columns - 1)
    last_r = min(max(int((qy - y0) / size), 0), rows - 1)
    dx, dy = qx - px, qy - py
    step_c, step_r = (1 if dx > 0.0 else -1), (1 if dy > 0.0 else -1)
    next_c, next_r, by_c, by_r = math.inf, math.inf, math.inf, math.inf
    if dx != 0.0:
        next_c = (x0 + (c + (1 if dx > 0.0 else 0)) * size - px) / dx
        by_c = size / abs(dx)
    if dy != 0.0:
        next_r = (y0 + (r + (1 if dy > 0.0 else 0)) * size - py) / dy
        by_r = size / abs(dy)
    for _ in range(abs(last_c - c) + abs(last_r - r) + 1):
        cell = r * columns + c
        for i in range(first[cell], first[cell + 1]):
            k = items[i]
            if cross_each_other(
                px, py, qx, qy, edges[k, 0], edges[k, 1], edges[k, 2], edges[k, 3]
            ) and not (len(spared) and _spares(px, py, qx, qy, k, sight, spared)):
                return False
        if c == last_c and r == last_r:
            return True
        # Rounding must not lead past the last cell's column or row.
        if r == last_r or (c != last_c and next_c < next_r):
            c += step_c
            next_c += by_c
        else:
            r += step_r
            next_r += by_r
    return True


@compiled
def cuts(dx: float, dy: float, v: int, before: Array, after: Array) -> bool:
    """Tell quickly that a line along (dx, dy) surely cuts vertex v; `supports` decides the rest."""
    a = dx * before[v, 1] - dy * before[v, 0]
    b = dx * after[v, 1] - dy * after[v, 0]
    slack = 1e-6 * (abs(dx) + abs(dy))
    return bool((a > slack and b < -slack) or (a < -slack and b > slack))


@compiled
def supports(dx: float, dy: float, v: int, before: Array, after: Array) -> bool:
    """Tell whether a line along (dx, dy), a unit vector, touches vertex v without cutting it."""
    a = dx * before[v, 1] - dy * before[v, 0]
    b = dx * after[v, 1] - dy * after[v, 0]
    return bool((a >= -1e-7 and b >= -1e-7) or (a <= 1e-7 and b <= 1e-7))


@compiled
def look_around(v: int, sight: Sight) -> bool:
    """Note in the pool which vertices v sees; rows[v] says where.  False when the pool is full."""
    turns, before, after = sight.turns, sight.before, sight.after
    begin = sight.rows[-1, 1]
    end, nothing = begin, sight.rows[:0, 0]
    for w in range(len(turns)):
        dx, dy = turns[w, 0] - turns[v, 0], turns[w, 1] - turns[v, 1]
        if cuts(dx, dy, v, before, after) or cuts(dx, dy, w, before, after):
            continue
        length = math.hypot(dx, dy)
        if w == v or length == 0.0:
            continue
        dx, dy = dx / length, dy / length
        if not supports(dx, dy, v, before, after) or not supports(dx, dy, w, before, after):
            continue
        if sees(turns[v, 0], turns[v, 1], turns[w, 0], turns[w, 1], sight, nothing):
            if end == len(sight.pool):
                return False
            sight.pool[end] = w
            end += 1
    sight.rows[v, 0], sight.rows[v, 1], sight.rows[-1, 1] = begin, end, end
    return True


@compiled
def corners_within(places: Array, corners: Array, reach: float) -> Indices:
    """Return the corners (n, 2) that are nearer than `reach` [m] to one of the places (k, 2)."""
    found = np.empty(len(corners), dtype=np.int64)
    count = 0
    for i in range(len(corners)):
        for k in range(len(places)):
            dx, dy = corners[i, 0] - places[k, 0], corners[i, 1] - places[k, 1]
            if dx * dx + dy * dy < reach * reach:
                found[count] = i
                count += 1
                break
    return found[:count]
