"""Compiled: the shortest way, by A* that computes lines of sight only where the search gets.

Decides: which way is the shortest.  Must not know: what the discs to keep out of stand for.
"""

from __future__ import annotations

import heapq
import math
from typing import Final

import numpy as np

from coordinator.base.compiled import allocation_free, compiled
from coordinator.curves.nurbs import Array
from coordinator.ground.distance_kernels import RADIUS, keeping
from coordinator.ground.grid_kernels import point_gap
from coordinator.ground.growth import Indices
from coordinator.ground.visibility_kernels import (
    BEGIN,
    END,
    Sight,
    cuts,
    look_around,
    sees,
    supports,
)

SIDES: Final = 8
"""Sides of the tangent polygon that a way around a disc follows."""

_TOUCHING: Final = 1e-6
"""Ways pass discs this much farther out [m] than they must."""


@allocation_free
def clear_of_discs(px: float, py: float, qx: float, qy: float, discs: Array) -> bool:
    """Tell whether p-q keeps out of discs (k, 3): x, y, radius [m]."""
    for k in range(len(discs)):
        if point_gap(discs[k, 0], discs[k, 1], px, py, qx, qy) < discs[k, RADIUS]:
            return False
    return True


@compiled
def search(
    ends: Array, most: int, longest: float, discs: Array, sight: Sight, spared: Indices
) -> Array:
    """Return the shortest way (n, 2) [m] from ends[0] to ends[1]; empty when there is none.

    It keeps out of discs (k, 3) and is no longer than `longest` [m].  After `most` places the
    search gives up and returns a single row of NaN.  spared: the corners whose arcs decide, as in
    `sees`.

    Places are numbered: 0 is the start, 1 the goal, then come the vertices around discs, then those
    of `turns` that a way of at most `longest` [m] can reach.  The queue of the A* search holds
    steps; the line of sight of a step is tested only when the step is taken from the queue.  If all
    of `turns` take part, what a vertex sees is kept for later searches.
    """
    turns, rows, pool = sight.turns, sight.rows, sight.pool
    more, more_before, more_after = _around(discs)
    extra = 2 + len(more)
    chosen = _within_ellipse(turns, ends, longest)
    every, all_chosen = len(chosen) == len(turns), np.arange(len(chosen))
    places = np.concatenate((ends, more, turns[chosen]))
    backward = np.concatenate((np.zeros((2, 2)), more_before, sight.before[chosen]))
    forward = np.concatenate((np.zeros((2, 2)), more_after, sight.after[chosen]))
    # From an end inside the tangent polygon of an arc, a taut way may cut that polygon's vertices.
    loose = len(spared) > 0 or len(discs) > 0 or sight.room > 0.0
    none = spared[:0]
    cost = np.full(len(places), math.inf)
    parent = np.full(len(places), -1)
    _close(places, discs, extra, sight, parent)
    gx, gy = ends[1, 0], ends[1, 1]
    heap = [(math.hypot(ends[0, 0] - gx, ends[0, 1] - gy), 0, 0, False)]
    while len(heap) > 0:
        _, here, origin, seen = heapq.heappop(heap)
        if parent[here] >= 0:
            continue
        hx, hy, ox, oy = places[here, 0], places[here, 1], places[origin, 0], places[origin, 1]
        if here != 0:
            special = spared if origin < 2 or here < 2 else none
            if not seen and not sees(ox, oy, hx, hy, sight, special):
                continue
            if not clear_of_discs(ox, oy, hx, hy, discs):
                continue
        step = math.hypot(hx - ox, hy - oy)
        cost[here] = step + (cost[origin] if here != 0 else 0.0)
        parent[here] = origin
        if here == 1:
            break
        most -= 1
        if most < 0:
            return np.full((1, 2), math.nan)
        known = (
            every
            and here >= extra
            and (rows[here - extra, BEGIN] >= 0 or look_around(here - extra, sight))
        )
        row = all_chosen
        if known:
            row = pool[rows[here - extra, BEGIN] : rows[here - extra, END]]
        for there in _ahead(here, extra, row, places, backward, forward, parent):
            if not (
                (loose and min(here, there) < 2)
                or _is_step(places, backward, forward, origin, here, there)
            ):
                continue
            whole = cost[here] + math.hypot(places[there, 0] - hx, places[there, 1] - hy)
            whole += math.hypot(places[there, 0] - gx, places[there, 1] - gy)
            if whole <= longest:
                heapq.heappush(heap, (whole, there, here, known and there >= extra))
    return np.asarray(places[_trace(parent)])


@compiled
def _close(places: Array, discs: Array, extra: int, sight: Sight, parent: Indices) -> None:
    """Give a parent to places that no step can reach, so that none is tried; `extra` as above.

    Places in discs are among them, and vertices around discs within the reach of something solid,
    as most are in narrow aisles.  Those of `turns` never are.
    """
    around = places[2:extra]
    parent[2:extra][~keeping(around, around, np.zeros(len(around)), sight.solid)] = 0
    for k in range(len(discs)):
        x, y, radius = discs[k, 0], discs[k, 1], discs[k, RADIUS] - _TOUCHING
        for v in range(2, len(places)):
            dx, dy = places[v, 0] - x, places[v, 1] - y
            if dx * dx + dy * dy < radius * radius and radius > 0.0:
                parent[v] = 0


@compiled
def _ahead(
    here: int, extra: int, row: Indices, places: Array, backward: Array, forward: Array,
    parent: Indices,
) -> Indices:  # fmt: skip
    """Return the places without a parent to which a step from `here` may lead.

    They are some of the first `extra` and of `row`: most steps cut the outline at `here`.
    """
    found, count = np.empty(extra + len(row), dtype=np.int64), 0
    hx, hy = places[here, 0], places[here, 1]
    back_x, back_y = backward[here, 0], backward[here, 1]
    on_x, on_y = forward[here, 0], forward[here, 1]
    for i in range(-extra, len(row)):
        there = i + extra if i < 0 else extra + row[i]
        if parent[there] >= 0:
            continue
        if here >= 2 and there >= 2:
            # As in `cuts`; a call for each pair would take most of the search's time.
            dx, dy = places[there, 0] - hx, places[there, 1] - hy
            a, b = dx * back_y - dy * back_x, dx * on_y - dy * on_x
            slack = 1e-6 * (abs(dx) + abs(dy))
            if (a > slack and b < -slack) or (a < -slack and b > slack):
                continue
        found[count] = there
        count += 1
    return found[:count]


@compiled
def _around(discs: Array) -> tuple[Array, Array, Array]:
    """Return the vertices around discs, and the unit directions back and on along the outline."""
    count = len(discs) * SIDES
    places, back, onward = np.empty((count, 2)), np.empty((count, 2)), np.empty((count, 2))
    half = math.pi / SIDES
    for k in range(len(discs)):
        spread = (discs[k, RADIUS] + 2.0 * _TOUCHING) / math.cos(half)
        for side in range(SIDES):
            i, angle = k * SIDES + side, 2.0 * half * side
            places[i, 0] = discs[k, 0] + spread * math.cos(angle)
            places[i, 1] = discs[k, 1] + spread * math.sin(angle)
            onward[i, 0], onward[i, 1] = -math.sin(angle + half), math.cos(angle + half)
            back[i, 0], back[i, 1] = math.sin(angle - half), -math.cos(angle - half)
    return places, back, onward


@compiled
def _within_ellipse(turns: Array, ends: Array, longest: float) -> Indices:
    """Return the vertices over which a way between two ends can be at most `longest` [m]."""
    found = np.empty(len(turns), dtype=np.int64)
    count = 0
    for v in range(len(turns)):
        apart = math.hypot(turns[v, 0] - ends[0, 0], turns[v, 1] - ends[0, 1])
        if apart <= longest and (
            apart + math.hypot(turns[v, 0] - ends[1, 0], turns[v, 1] - ends[1, 1]) <= longest
        ):
            found[count] = v
            count += 1
    return found[:count]


@allocation_free
def _is_step(
    places: Array, backward: Array, forward: Array, origin: int, here: int, there: int
) -> bool:
    """Tell whether a taut way from `origin` over `here` may go on to `there`.

    A taut way turns at a vertex only towards the outline that the vertex belongs to, and cuts the
    outline neither there nor at the next vertex.
    """
    hx, hy = places[here, 0], places[here, 1]
    dx, dy = places[there, 0] - hx, places[there, 1] - hy
    if here >= 2 and cuts(dx, dy, here, backward, forward):
        return False
    if there >= 2 and cuts(dx, dy, there, backward, forward):
        return False
    size = math.hypot(dx, dy)
    if size == 0.0:
        return False
    if here >= 2:
        side = dx * backward[here, 1] - dy * backward[here, 0]
        other = dx * forward[here, 1] - dy * forward[here, 0]
        slack = 1e-7 * size
        if min(side, other) < -slack and max(side, other) > slack:
            return False
        ix, iy = hx - places[origin, 0], hy - places[origin, 1]
        turn = (ix * dy - iy * dx) * (side + other)
        if turn < -slack * (abs(side) + abs(other)) * math.hypot(ix, iy):
            return False
    return there < 2 or supports(dx / size, dy / size, there, backward, forward)


@compiled
def _trace(parent: Indices) -> Indices:
    """Return the places on the way from 0 to 1 by their parents; empty if 1 was not reached."""
    if parent[1] < 0:
        return np.zeros(0, dtype=np.int64)
    length, at = 1, 1
    while at != 0:
        at = parent[at]
        length += 1
    way = np.empty(length, dtype=np.int64)
    at = 1
    for i in range(length - 1, -1, -1):
        way[i] = at
        at = parent[at]
    return way
