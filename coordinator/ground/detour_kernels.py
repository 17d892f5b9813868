"""Compiled: leading a way around discs, one group of them after another.

A leg of the way that enters a group of discs is replaced by the shortest way from a place before
the group to a place behind it.

Decides: detours.  Must not know: what stands in the discs.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import allocation_free, compiled
from coordinator.curves.nurbs import Array
from coordinator.ground.distance_kernels import RADIUS, crossing
from coordinator.ground.shortest_way_kernels import search
from coordinator.ground.visibility_kernels import Sight, corners_within, sees

Flags = npt.NDArray[np.bool_]

_ASIDE: Final = 1.5
"""Detours leave a leg this many radii before a disc's centre and come back as far behind it."""

_DETOURS: Final = (0.6, 2.0)
"""By how much a detour may be longer, as shares of the sum of the discs' radii, tried in turn.  Few
vertices can take part in a short detour, so the first search is quick, and it mostly succeeds."""

_MOST_DISCS: Final = 3.0
"""In a group of more discs than this, only so many of the largest radius count in that sum."""

_PULL: Final = 0.01
"""A vertex is moved by this much [m] to see whether the way could be shorter."""

_GAIN: Final = 1e-3
"""A way that is not shorter by this much [m] is not worth a change."""

_ROUNDS: Final = 6
"""How often discs that a detour enters may join its group."""

_NO_LIMIT: Final = 1 << 60
_SPARE_CORNERS: Final = 0.1
"""At corners nearer to an end of a detour than the reach plus this share of it, only the arc blocks
ways, and not the tangent polygon around it."""


@compiled
def lead_around(way: Array, discs: Array, entered: Array, sight: Sight) -> tuple[Array, Flags]:
    """Return a way (n, 2) [m] led around discs (k, 3), and which discs leave no room for it (k,).

    entered (k, 3): the same discs a little smaller; only a way that enters these has to be changed.
    If there is no room, the returned way is empty.
    """
    closed = np.zeros(len(discs), dtype=np.bool_)
    lost = _inside(way, discs)
    places = [(way[0, 0], way[0, 1], False)]
    leg = np.empty((2, 2))
    i = 0
    while i < len(way) - 1:
        leg[0, 0], leg[0, 1] = places[-1][0], places[-1][1]
        leg[1] = way[i + 1]
        hit = crossing(leg, entered)[0]
        if not hit.any():
            i += 1
            if way[i, 0] != places[-1][0] or way[i, 1] != places[-1][1]:
                places.append((way[i, 0], way[i, 1], False))
            continue
        last = i + 1
        while last < len(way) - 1 and lost[last]:
            last += 1
        if last == i + 1:
            hit = _first_group(leg, discs, hit)
            size = math.hypot(leg[1, 0] - leg[0, 0], leg[1, 1] - leg[0, 1])
        else:
            legs = np.concatenate((leg[:1], way[i + 1 : last + 1]))
            size = _length(legs)
            for k in range(len(legs) - 1):
                hit |= crossing(legs[k : k + 2], entered)[0]
            leg[1] = way[last]
        around, closed = _detour(leg, size, hit, discs, entered, sight)
        if len(around) == 0:
            return around, closed
        end = len(around) - 1
        places.extend([(around[k, 0], around[k, 1], k in (0, end)) for k in range(end + 1)])
        i = last - 1
    closed[:] = False
    way = _tautened(places, discs, entered, sight)
    return _pulled(way, discs, entered, sight), closed


@compiled
def _inside(places: Array, discs: Array) -> Flags:
    """Tell for each place (n, 2) whether it lies in one of the discs (k, 3)."""
    found = np.zeros(len(places), dtype=np.bool_)
    for i in range(len(places)):
        for k in range(len(discs)):
            dx, dy = places[i, 0] - discs[k, 0], places[i, 1] - discs[k, 1]
            if dx * dx + dy * dy < discs[k, RADIUS] * discs[k, RADIUS]:
                found[i] = True
                break
    return found


@compiled
def _first_group(leg: Array, discs: Array, hit: Flags) -> Flags:
    """Return the first group of discs that a leg hits: those before the first gap between discs.

    The leg (2, 2) is cut down to the part beside this group.
    """
    dx, dy = leg[1, 0] - leg[0, 0], leg[1, 1] - leg[0, 1]
    size = math.hypot(dx, dy)
    chosen = np.flatnonzero(hit)
    low, high = np.empty(len(chosen)), np.empty(len(chosen))
    for k in range(len(chosen)):
        x, y, radius = discs[chosen[k]]
        middle = ((x - leg[0, 0]) * dx + (y - leg[0, 1]) * dy) / size
        low[k], high[k] = middle - _ASIDE * radius, middle + _ASIDE * radius
    group = np.zeros(len(discs), dtype=np.bool_)
    order = np.argsort(low)
    begin, end = low[order[0]], high[order[0]]
    for k in order:
        if low[k] > end:
            break
        group[chosen[k]] = True
        end = max(end, high[k])
    first, last = max(begin / size, 0.0), min(end / size, 1.0)
    x, y = leg[0, 0], leg[0, 1]
    leg[0, 0], leg[0, 1] = x + first * dx, y + first * dy
    if last < 1.0:
        leg[1, 0], leg[1, 1] = x + last * dx, y + last * dy
    return group


@compiled
def _detour(
    ends: Array, size: float, active: Flags, discs: Array, entered: Array, sight: Sight
) -> tuple[Array, Flags]:
    """Return a way between two places (2, 2) not much longer than `size` [m]; empty if none is.

    It keeps out of the active discs.  Others that it enters become active, and the search is
    repeated; the active discs are returned too.
    """
    spared = corners_within(ends, sight.corners, sight.reach * (1.0 + _SPARE_CORNERS))
    active = active.copy()
    for _ in range(_ROUNDS):
        radii = discs[active, RADIUS]
        spread = min(radii.sum(), _MOST_DISCS * radii.max()) if len(radii) else 0.0
        for share in _DETOURS:
            longest = size + share * spread
            way = search(ends, _NO_LIMIT, longest, discs[active], sight, spared)
            if len(way) > 0 or spread == 0.0:
                break
        if len(way) == 0:
            break
        entering = crossing(way, entered)
        fresh = False
        for k in range(len(discs)):
            if not active[k] and entering[:, k].any():
                active[k] = fresh = True
        if not fresh:
            return way, active
    return np.empty((0, 2)), active


@compiled
def _tautened(
    places: list[tuple[float, float, bool]], discs: Array, entered: Array, sight: Sight
) -> Array:
    """Return a way (n, 2) without the vertices that a free straight line can skip.

    places: x, y [m] of each vertex, and whether a detour leaves its leg or comes back to it there.
    Such loose vertices are replaced by the shortest way between their neighbours.
    """
    kept = [(places[0][0], places[0][1])]
    short = np.empty((2, 2))
    for i in range(1, len(places) - 1):
        x, y, loose = places[i]
        short[0, 0], short[0, 1] = kept[-1]
        short[1, 0], short[1, 1] = places[i + 1][0], places[i + 1][1]
        spared = corners_within(short, sight.corners, sight.reach * (1.0 + _SPARE_CORNERS))
        hit = crossing(short, entered)[0]
        if not hit.any() and sees(
            short[0, 0], short[0, 1], short[1, 0], short[1, 1], sight, spared
        ):
            continue
        if loose:
            size = math.hypot(x - short[0, 0], y - short[0, 1])
            size += math.hypot(x - short[1, 0], y - short[1, 1])
            around, _ = _detour(short, size, hit, discs, entered, sight)
            if len(around) and _length(around) < size:
                kept.extend([(around[k, 0], around[k, 1]) for k in range(1, len(around) - 1)])
                continue
        kept.append((x, y))
    kept.append((places[-1][0], places[-1][1]))
    return np.array(kept)


@compiled
def _pulled(way: Array, discs: Array, entered: Array, sight: Sight) -> Array:
    """Return a way (n, 2) in which vertices that are free to move are replaced by a shorter way.

    Where a detour meets a corner of something solid, one of its vertices may not be needed.
    """
    kept = [(way[0, 0], way[0, 1])]
    ends = np.empty((2, 2))
    for i in range(1, len(way) - 1):
        ends[0, 0], ends[0, 1] = kept[-1]
        ends[1] = way[i + 1]
        x, y = way[i, 0], way[i, 1]
        if _can_be_pulled(ends, x, y, entered, sight):
            size = math.hypot(x - ends[0, 0], y - ends[0, 1])
            size += math.hypot(x - ends[1, 0], y - ends[1, 1])
            around, _ = _detour(ends, size, crossing(ends, entered)[0], discs, entered, sight)
            if len(around) and _length(around) < size - _GAIN:
                kept.extend([(around[k, 0], around[k, 1]) for k in range(1, len(around) - 1)])
                continue
        kept.append((x, y))
    kept.append((way[-1, 0], way[-1, 1]))
    return np.array(kept)


@compiled
def _can_be_pulled(ends: Array, x: float, y: float, entered: Array, sight: Sight) -> bool:
    """Tell whether a vertex (x, y) between two others is free to move towards their chord."""
    dx, dy = 0.5 * (ends[0, 0] + ends[1, 0]) - x, 0.5 * (ends[0, 1] + ends[1, 1]) - y
    apart = math.hypot(dx, dy)
    if apart < _GAIN:
        return False
    part = min(0.1, _PULL / apart)
    bent = np.empty((3, 2))
    bent[0], bent[2] = ends[0], ends[1]
    bent[1, 0], bent[1, 1] = x + part * dx, y + part * dy
    if crossing(bent, entered).any():
        return False
    for k in range(2):
        spared = corners_within(
            bent[k : k + 2], sight.corners, sight.reach * (1.0 + _SPARE_CORNERS)
        )
        if not sees(bent[k, 0], bent[k, 1], bent[k + 1, 0], bent[k + 1, 1], sight, spared):
            return False
    return True


@allocation_free
def _length(way: Array) -> float:
    """Return the length [m] of a way (n, 2)."""
    size = 0.0
    for k in range(len(way) - 1):
        size += math.hypot(way[k + 1, 0] - way[k, 0], way[k + 1, 1] - way[k, 1])
    return size
