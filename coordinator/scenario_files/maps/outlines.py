"""Outlines of connected pieces of grid cells: traced exactly, then simplified outwards.

A wall that is slanted to the grid has an outline of many small steps, a staircase.  A bridge is a
chord that replaces a staircase and lies outside of it, so that nothing solid is uncovered.

Decides: which corners an outline keeps.  Must not know: files, metres.  All coordinates are corners
of the grid: x counts columns, y counts rows upwards; cell (y, x) covers [x, x + 1] by [y, y + 1].
Arrays have a rim of free cells around them.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from coordinator.base.compiled import compiled

Labels = NDArray[np.int32]
Corners = NDArray[np.int64]

_GAP = 48
"""The search for a longer bridge ends this many corners after the longest one found so far."""
_SHORT = 3
"""A single step wider or higher than this [cells] is kept as it is."""


@compiled
def trace(labels: Labels, pieces: int, count: int) -> tuple[Corners, NDArray[np.int64]]:
    """Return the corners (count, 2) of all outlines, counter-clockwise, and where each begins.

    Labels are 1 to `pieces`, and 0 for free cells; a label may be absent.  The cells of a piece are
    connected by their edges; a piece has no hole and touches itself at no corner.  `count` is the
    number of corners of all pieces.  The first corner of each outline is convex.
    """
    ahead = np.array([(0, 0, 0, -1), (-1, 0, 0, 0), (-1, -1, -1, 0), (0, -1, -1, -1)])
    step = np.array([(1, 0), (0, 1), (-1, 0), (0, -1)])
    seen = np.zeros(pieces + 1, np.bool_)
    corners = np.empty((count, 2), np.int64)
    begins = np.empty(pieces + 1, np.int64)
    n = rings = 0
    for row in range(labels.shape[0]):
        for column in range(labels.shape[1]):
            piece = labels[row, column]
            if piece == 0 or seen[piece]:
                continue
            seen[piece] = True
            begins[rings] = n
            rings += 1
            corners[n] = (column, row)
            n += 1
            x, y, way = column + 1, row, 0
            while x != column or y != row:
                left = labels[y + ahead[way, 1], x + ahead[way, 0]] == piece
                right = labels[y + ahead[way, 3], x + ahead[way, 2]] == piece
                if right or not left:
                    way = (way + (3 if right else 1)) % 4
                    corners[n] = (x, y)
                    n += 1
                x += step[way, 0]
                y += step[way, 1]
    begins[rings] = n
    return corners, begins[: rings + 1]


@compiled
def bridge(
    corners: Corners, begins: NDArray[np.int64], taken: NDArray[np.bool_], most: float
) -> tuple[NDArray[np.bool_], float]:
    """Return which corners stay when bridges replace staircases, and by how much outlines grow.

    A bridge joins two convex corners; the outline between them lies on its inner side.  The area
    between bridge and outline is nowhere farther than `most` [cells] from the outline; the greatest
    such distance is the growth [cells].  A bridge crosses only free cells, which count as taken
    from then on.  So outlines stay simple polygons and two bridges never meet in a passage.
    """
    keep = np.ones(len(corners), np.bool_)
    growth = 0.0
    for ring in range(len(begins) - 1):
        first, n = begins[ring], begins[ring + 1] - begins[ring]
        at = 0
        while at < n:
            best, best_gain = at + 1, 0.0
            end = at + 2
            while end <= min(n, best + _GAP) and _turns_left(corners, first, n, at):
                gain = _growth(corners, first, n, at, end, most)
                if gain >= 0.0 and _turns_left(corners, first, n, end % n):
                    a, b = corners[first + at], corners[first + end % n]
                    if _walk(taken, a[0], a[1], b[0], b[1], False):
                        best, best_gain = end, gain
                end += 1
            if best > at + 1:
                a, b = corners[first + at], corners[first + best % n]
                _walk(taken, a[0], a[1], b[0], b[1], True)
                keep[first + at + 1 : first + best] = False
                growth = max(growth, best_gain)
            at = best
    return keep, growth


@compiled
def _turns_left(corners: Corners, first: int, n: int, at: int) -> bool:
    """Return whether an outline's corner is convex."""
    before, here = corners[first + (at - 1) % n], corners[first + at]
    after = corners[first + (at + 1) % n]
    cross = (here[0] - before[0]) * (after[1] - here[1])
    return bool(cross - (here[1] - before[1]) * (after[0] - here[0]) > 0)


@compiled
def _growth(corners: Corners, first: int, n: int, at: int, end: int, most: float) -> float:
    """Return how far [cells] a bridge grows the outline; -1 when it may not be built.

    The depth of the outline below the chord bounds the growth.  For a straight slanted wall that
    bound is as large as sqrt(2), so `_stair_growth` gives a tighter one for stairs that only rise.
    """
    x0, y0 = corners[first + at]
    dx, dy = corners[first + end % n, 0] - x0, corners[first + end % n, 1] - y0
    if end - at == 2 and max(abs(dx), abs(dy)) > _SHORT:
        return -1.0
    length = math.sqrt(dx * dx + dy * dy)
    deepest = 0
    stairs = dx != 0 and dy != 0
    for i in range(at + 1, end + 1):
        x, y = corners[first + i % n]
        depth = dx * (y - y0) - dy * (x - x0)
        if depth < 0 or depth > 1.5 * most * length:
            return -1.0
        deepest = max(deepest, depth)
        before = corners[first + i - 1]
        stairs = stairs and (x - before[0]) * dx >= 0 and (y - before[1]) * dy >= 0
    if length > 0.0 and deepest <= most * length:
        return deepest / length
    return _stair_growth(corners, first, n, at, end, most) if stairs else -1.0


@compiled
def _stair_growth(corners: Corners, first: int, n: int, at: int, end: int, most: float) -> float:
    """Return the growth of a bridge over a staircase [cells], or -1 when it exceeds `most`.

    Between two tips the outline has a notch, which the chord covers.  The point of the notch that
    is farthest from the stairs lies on the chord.  Turn the grid so that the chord rises to the
    right: along the chord the distance to the tread falls and the distance to the riser grows.  So
    the farthest point is where both are equal, or below the tip.
    """
    dx = corners[first + end % n, 0] - corners[first + at, 0]
    dy = corners[first + end % n, 1] - corners[first + at, 1]
    wide, high = (abs(dx), abs(dy)) if dx * dy > 0 else (abs(dy), abs(dx))
    slope, farthest = high / wide, 0.0
    for i in range(at, end, 2):
        tip, next_tip = corners[first + i], corners[first + (i + 2) % n]
        x, y = tip[0] - corners[first + at, 0], tip[1] - corners[first + at, 1]
        below = abs(dx * y - dy * x) / wide
        rise, run = abs(next_tip[1] - tip[1]), abs(next_tip[0] - tip[0])
        if dx * dy < 0:
            rise, run = run, rise
        near, far = 0.0, 1.0 * run
        for _ in range(30):
            middle = 0.5 * (near + far)
            behind = math.hypot(middle, max(below - slope * middle, 0.0))
            if behind < rise + below - slope * middle:
                near = middle
            else:
                far = middle
        farthest = max(farthest, below, rise + below - slope * near)
        if farthest > most:
            return -1.0
    return farthest


@compiled
def _walk(taken: NDArray[np.bool_], x0: int, y0: int, x1: int, y1: int, take: bool) -> bool:
    """With `take`, mark all cells that a chord crosses as taken; else return whether all are free.

    The outside of the outline is to the right of the chord.
    """
    dx, dy = x1 - x0, y1 - y0
    if dx == 0 or dy == 0:
        return _walk_along(taken, x0, y0, dx, dy, take)
    size = abs(dx)
    for x in range(min(x0, x1), max(x0, x1)):
        here = (y0 * dx + dy * (x - x0)) * (1 if dx > 0 else -1)
        there = here + dy * (1 if dx > 0 else -1)
        for y in range(min(here, there) // size, -(-max(here, there) // size)):
            if take:
                taken[y, x] = True
            elif taken[y, x]:
                return False
        if not take and x != min(x0, x1) and here % size == 0:
            outer_x, outer_y = x - (0 if dy > 0 else 1), here // size - (1 if dx > 0 else 0)
            if taken[outer_y, outer_x]:
                return False
    return True


@compiled
def _walk_along(taken: NDArray[np.bool_], x0: int, y0: int, dx: int, dy: int, take: bool) -> bool:
    """Do the same as `_walk` for a chord along a grid line, with the cells on its inner side."""
    for i in range(abs(dx) + abs(dy)):
        if dx != 0:
            x = min(x0, x0 + dx) + i
            y = y0 - (1 if (dx > 0) != take else 0)
        else:
            x = x0 - (1 if (dy < 0) != take else 0)
            y = min(y0, y0 + dy) + i
        if take:
            taken[y, x] = True
        elif taken[y, x]:
            return False
    return True
