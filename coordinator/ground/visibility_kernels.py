"""Compiled: lines of sight between places on a floor whose solid polygons are grown.

Decides: which lines are free.  Must not know: why an edge is there, and what a line is for.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from coordinator.base.compiled import allocation_free, compiled
from coordinator.curves.nurbs import Array
from coordinator.ground.distance_kernels import Solid
from coordinator.ground.grid_kernels import Grid, Segment, cross_each_other, point_gap, segment
from coordinator.ground.growth import Indices

BEGIN, END = range(2)
"""Columns of tables (n, 2) of the two ends of an edge, or of a part of the pool."""


class Sight(NamedTuple):
    """The outline that blocks sight, and the visibility graph of the vertices at which ways turn.

    edges (m, 4), owners, beyond (m, 2): as in growth.Outline, for an outline at the distance
    `reach` [m] from corners (c, 2); grid: which edges are in which cell.  turns, before, after
    (n, 2): as in growth.Outline, for an outline farther out by `room` [m].  Vertex v sees the
    vertices pool[rows[v, BEGIN] : rows[v, END]]; rows[v] is -1 until that has been computed, and
    rows[-1, END] is the used length of the pool.  solid: what no way comes near.
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
    grid: Grid
    solid: Solid


@allocation_free
def _spares(line: Segment, k: int, sight: Sight, spared: Indices) -> bool:
    """Tell whether a line that crosses edge k does so only near a spared corner.

    There the line may cross the part of the edge that extends beyond the grown side of the solid
    polygon, along the tangent polygon of the spared corner.
    """
    edges, owners, beyond = sight.edges, sight.owners, sight.beyond
    cut0, cut1 = 0.0, 0.0
    for corner in spared:
        if corner != owners[k, BEGIN] and corner != owners[k, END]:
            continue
        if owners[k, BEGIN] == corner:
            cut0 = beyond[k, BEGIN]
        if owners[k, END] == corner:
            cut1 = beyond[k, END]
    if cut0 == 0.0 and cut1 == 0.0:
        return False
    ax, ay, bx, by = segment(edges, k)
    length = math.hypot(bx - ax, by - ay)
    if cut0 + cut1 >= length:
        return True
    ux, uy = (bx - ax) / length, (by - ay) / length
    ax, ay, bx, by = ax + cut0 * ux, ay + cut0 * uy, bx - cut1 * ux, by - cut1 * uy
    return not cross_each_other(line, Segment(ax, ay, bx, by))


@allocation_free
def sees(px: float, py: float, qx: float, qy: float, sight: Sight, spared: Indices) -> bool:
    """Tell whether the straight line from p to q crosses no edge.

    At `spared` corners the arc itself blocks the line, not the tangent polygon around it.  The grid
    is walked from cell to cell (Amanatides and Woo 1987).
    """
    for corner in spared:
        x, y = sight.corners[corner, 0], sight.corners[corner, 1]
        if point_gap(x, y, px, py, qx, qy) < sight.reach:
            return False
    line, edges = Segment(px, py, qx, qy), sight.edges
    first, items, (x0, y0, size, columns, rows) = sight.grid
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
            if cross_each_other(line, segment(edges, k)) and not (
                len(spared) and _spares(line, k, sight, spared)
            ):
                return False
        if c == last_c and r == last_r:
            return True
        # Rounding must not lead beyond the column or row of the last cell.
        if r == last_r or (c != last_c and next_c < next_r):
            c += step_c
            next_c += by_c
        else:
            r += step_r
            next_r += by_r
    return True


@allocation_free
def cuts(dx: float, dy: float, v: int, before: Array, after: Array) -> bool:
    """Tell quickly whether a line along (dx, dy) surely cuts into the outline at vertex v.

    before, after (n, 2): the directions along the outline.  `supports` decides the doubtful cases.
    """
    a = dx * before[v, 1] - dy * before[v, 0]
    b = dx * after[v, 1] - dy * after[v, 0]
    slack = 1e-6 * (abs(dx) + abs(dy))
    return bool((a > slack and b < -slack) or (a < -slack and b > slack))


@allocation_free
def supports(dx: float, dy: float, v: int, before: Array, after: Array) -> bool:
    """Tell whether a line along the unit vector (dx, dy) at vertex v does not cut the outline."""
    a = dx * before[v, 1] - dy * before[v, 0]
    b = dx * after[v, 1] - dy * after[v, 0]
    return bool((a >= -1e-7 and b >= -1e-7) or (a <= 1e-7 and b <= 1e-7))


@allocation_free
def look_around(v: int, sight: Sight) -> bool:
    """Enter the vertices that v sees into the pool; return False when the pool is full."""
    turns, before, after = sight.turns, sight.before, sight.after
    begin = sight.rows[-1, END]
    end, nothing = begin, sight.rows[:0, BEGIN]
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
    sight.rows[v, BEGIN], sight.rows[v, END], sight.rows[-1, END] = begin, end, end
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
