"""Compiled: from where on along its way a robot keeps clear of another way for good.

Decides: where two ways part.  Must not know: places, robots, when anybody drives.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from coordinator.base.compiled import compiled
from coordinator.ground.grid_kernels import Segment, point_gap
from coordinator.places.move_kernels import Array, Indices

_HALVINGS: Final = 12
"""Where two ways part is found to the 4096th part of a leg."""


@compiled
def _gap(leg: Segment, share: float, other: Segment) -> float:
    """Return how far [m] the point after a share of a leg is from another."""
    x, y = leg.ax + share * (leg.bx - leg.ax), leg.ay + share * (leg.by - leg.ay)
    return float(point_gap(x, y, other.ax, other.ay, other.bx, other.by))


@compiled
def _last_share(leg: Segment, other: Segment, need: float) -> float:
    """Return which share of a leg is passed at its last point nearer than `need` [m] to another.

    Negative if no point is.  The distance is convex along the leg: golden sections lead towards the
    nearest point until one is near enough, then halving finds where the distance reaches `need`.
    """
    if _gap(leg, 1.0, other) < need:
        return 1.0
    low, high, near = 0.0, 1.0, 0.0
    for _ in range(2 * _HALVINGS):
        if _gap(leg, near, other) < need:
            break
        one, two = low + 0.382 * (high - low), low + 0.618 * (high - low)
        if _gap(leg, one, other) < _gap(leg, two, other):
            high, near = two, one
        else:
            low, near = one, two
    else:
        return -1.0
    low, high = near, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if _gap(leg, middle, other) < need:
            low = middle
        else:
            high = middle
    return high


@compiled
def _last_near(way: Array, other: Array, need: float) -> float:
    """Return how far [m] along a way (n, 2) its last point is nearer than `need` to another."""
    ahead = 0.0
    for k in range(len(way) - 1):
        ahead += math.hypot(way[k + 1, 0] - way[k, 0], way[k + 1, 1] - way[k, 1])
    for k in range(len(way) - 2, -1, -1):
        leg = Segment(way[k, 0], way[k, 1], way[k + 1, 0], way[k + 1, 1])
        size = math.hypot(leg.bx - leg.ax, leg.by - leg.ay)
        ahead -= size
        last = -1.0
        for j in range(len(other) - 1):
            beside = Segment(other[j, 0], other[j, 1], other[j + 1, 0], other[j + 1, 1])
            last = max(last, _last_share(leg, beside, need))
        if last >= 0.0:
            return ahead + last * size
    return 0.0


@compiled
def clear_by_steps(way: Array, other: Array, need: float, step: float) -> float:
    """Return how far [m] along a way (n, 2) it is clear of another one (m, 2) for good.

    Places `step` [m] apart are looked at, so that it is two steps farther than it might be; 0 if
    the ways are nowhere nearer than `need` [m].
    """
    length = 0.0
    for k in range(len(way) - 1):
        length += math.hypot(way[k + 1, 0] - way[k, 0], way[k + 1, 1] - way[k, 1])
    leg, ahead = len(way) - 1, length
    size = 0.0
    for number in range(math.ceil(length / step) - 1, -1, -1):
        at = number * step
        while at < ahead and leg > 0:
            leg -= 1
            size = math.hypot(way[leg + 1, 0] - way[leg, 0], way[leg + 1, 1] - way[leg, 1])
            ahead -= size
        share = min(max((at - ahead) / size, 0.0), 1.0) if size > 0.0 else 0.0
        x = way[leg, 0] + share * (way[leg + 1, 0] - way[leg, 0])
        y = way[leg, 1] + share * (way[leg + 1, 1] - way[leg, 1])
        for j in range(len(other) - 1):
            gap = point_gap(x, y, other[j, 0], other[j, 1], other[j + 1, 0], other[j + 1, 1])
            if gap < need + 0.5 * step:
                return at + 2.0 * step
    return 0.0


@compiled
def clear_after(
    one: Indices, other: Indices, ways: Array, ways_from: Indices, need: float
) -> tuple[Array, Array]:
    """Return, for pairs of lines, how far [m] along `one` it is clear of `other` for good.

    First along the line, then along it backwards.
    """
    forth, back = np.empty(len(one)), np.empty(len(one))
    for k in range(len(one)):
        way = ways[ways_from[one[k]] : ways_from[one[k] + 1]]
        beside = ways[ways_from[other[k]] : ways_from[other[k] + 1]]
        forth[k] = _last_near(way, beside, need)
        back[k] = _last_near(way[::-1].copy(), beside, need)
    return forth, back
