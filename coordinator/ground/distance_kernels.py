"""Compiled: distances of straight lines from solid edges and discs.

Decides: distances.  Must not know: what a line or an edge stands for.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import allocation_free, compiled
from coordinator.curves.nurbs import Array
from coordinator.ground.grid_kernels import Grid, Segment, point_gap, segment

RADIUS: Final = 2
"""Column of discs (k, 3) [m], after x and y."""


class Solid(NamedTuple):
    """What lines must stay clear of: edges (m, 4), by `need` [m], and discs (k, 3) [m].

    Each cell of the grid lists the edges that come within the greatest distance that is tested.
    """

    need: float
    discs: Array
    edges: Array
    grid: Grid


@allocation_free
def _segment_gap(one: Segment, two: Segment) -> float:
    """Return the distance [m] between two segments."""
    (px, py, qx, qy), (ax, ay, bx, by) = one, two
    dx, dy, ex, ey = qx - px, qy - py, bx - ax, by - ay
    if (dx * (ay - py) - dy * (ax - px)) * (dx * (by - py) - dy * (bx - px)) < 0.0 and (
        ex * (py - ay) - ey * (px - ax)
    ) * (ex * (qy - ay) - ey * (qx - ax)) < 0.0:
        return 0.0
    return min(
        point_gap(px, py, ax, ay, bx, by),
        point_gap(qx, qy, ax, ay, bx, by),
        point_gap(ax, ay, px, py, qx, qy),
        point_gap(bx, by, px, py, qx, qy),
    )


@allocation_free
def keeps(line: Segment, extra: float, solid: Solid) -> bool:
    """Tell whether a line stays `solid.need + extra` [m] from edges and `extra` from discs."""
    (px, py, qx, qy), (need, discs, edges, (first, items, frame)) = line, solid
    low_x, high_x, low_y, high_y = min(px, qx), max(px, qx), min(py, qy), max(py, qy)
    for k in range(len(discs)):
        x, y, radius = discs[k, 0], discs[k, 1], discs[k, RADIUS] + extra
        if (
            low_x - x < radius
            and x - high_x < radius
            and low_y - y < radius
            and (y - high_y < radius and point_gap(x, y, px, py, qx, qy) < radius)
        ):
            return False
    x0, y0, size, columns, rows = frame
    length, reach = math.hypot(qx - px, qy - py), need + extra
    pieces = 1 + int(length / size)
    half = 0.5 * length / pieces
    for piece in range(pieces):
        ax, ay = px + (qx - px) * piece / pieces, py + (qy - py) * piece / pieces
        bx, by = px + (qx - px) * (piece + 1) / pieces, py + (qy - py) * (piece + 1) / pieces
        c0 = min(max(int((min(ax, bx) - x0) / size), 0), columns - 1)
        c1 = min(max(int((max(ax, bx) - x0) / size), 0), columns - 1)
        r0 = min(max(int((min(ay, by) - y0) / size), 0), rows - 1)
        r1 = min(max(int((max(ay, by) - y0) / size), 0), rows - 1)
        for r in range(r0, r1 + 1):
            for c in range(c0, c1 + 1):
                cell = r * columns + c
                for i in range(first[cell], first[cell + 1]):
                    k = items[i]
                    ex, ey = (
                        edges[k, 0] - ax + edges[k, 2] - bx,
                        edges[k, 1] - ay + edges[k, 3] - by,
                    )
                    wide = abs(edges[k, 2] - edges[k, 0]) + abs(edges[k, 3] - edges[k, 1])
                    far = 2.0 * (reach + half) + wide
                    if ex * ex + ey * ey > far * far:
                        continue  # Their middles alone are too far apart.
                    if _segment_gap(Segment(ax, ay, bx, by), segment(edges, k)) < reach:
                        return False
    return True


@compiled
def keeping(starts: Array, ends: Array, extra: Array, solid: Solid) -> npt.NDArray[np.bool_]:
    """Tell for each line from `starts` (k, 2) to `ends` (k, 2) whether it is clear of `solid`.

    Line i must stay at least `solid.need + extra[i]` from edges and `extra[i]` from discs [m].
    """
    found = np.empty(len(starts), dtype=np.bool_)
    for k in range(len(starts)):
        line = Segment(starts[k, 0], starts[k, 1], ends[k, 0], ends[k, 1])
        found[k] = keeps(line, extra[k], solid)
    return found


@compiled
def gaps(places: Array, edges: Array, grid: Grid, most: float) -> Array:
    """Return the distances (n,) [m] of places (n, 2) from the nearest edge, up to `most`.

    Each cell of the grid lists the edges that come within `most` of it; all places lie in cells.
    """
    first, items, (x0, y0, size, columns, rows) = grid
    found = np.empty(len(places))
    for place in range(len(places)):
        x, y = places[place, 0], places[place, 1]
        column = min(max(int((x - x0) / size), 0), columns - 1)
        cell = min(max(int((y - y0) / size), 0), rows - 1) * columns + column
        least = most
        for i in range(first[cell], first[cell + 1]):
            ax, ay, bx, by = segment(edges, items[i])
            if (
                min(ax, bx) - x < least
                and x - max(ax, bx) < least
                and min(ay, by) - y < least
                and y - max(ay, by) < least
            ):
                least = min(least, point_gap(x, y, ax, ay, bx, by))
        found[place] = least
    return found


@compiled
def crossing(way: Array, discs: Array) -> npt.NDArray[np.bool_]:
    """Tell for each leg of a way (n + 1, 2) and each disc (k, 3) whether the leg enters it."""
    found = np.zeros((len(way) - 1, len(discs)), dtype=np.bool_)
    for i in range(len(way) - 1):
        ax, ay, bx, by = way[i, 0], way[i, 1], way[i + 1, 0], way[i + 1, 1]
        x0, x1, y0, y1 = min(ax, bx), max(ax, bx), min(ay, by), max(ay, by)
        for k in range(len(discs)):
            x, y, radius = discs[k, 0], discs[k, 1], discs[k, RADIUS]
            if x0 - x < radius and x - x1 < radius and y0 - y < radius and y - y1 < radius:
                found[i, k] = point_gap(x, y, ax, ay, bx, by) < radius
    return found


@compiled
def entered(way: Array, discs: Array) -> npt.NDArray[np.bool_]:
    """Tell for each disc (k, 3) whether a way (n, 2) enters it."""
    found = np.zeros(len(discs), dtype=np.bool_)
    x0, x1, y0, y1 = way[:, 0].min(), way[:, 0].max(), way[:, 1].min(), way[:, 1].max()
    for k in range(len(discs)):
        x, y, radius = discs[k, 0], discs[k, 1], discs[k, RADIUS]
        if x0 - x >= radius or x - x1 >= radius or y0 - y >= radius or y - y1 >= radius:
            continue
        for i in range(len(way) - 1):
            ax, ay, bx, by = way[i, 0], way[i, 1], way[i + 1, 0], way[i + 1, 1]
            if (
                min(ax, bx) - x < radius
                and x - max(ax, bx) < radius
                and min(ay, by) - y < radius
                and y - max(ay, by) < radius
                and point_gap(x, y, ax, ay, bx, by) < radius
            ):
                found[k] = True
                break
    return found


@compiled
def nearest_of(places: Array, others: Array) -> Array:
    """Return the distance (n,) [m] from each place (n, 2) to the nearest of others (k, 2)."""
    found = np.empty(len(places))
    for i in range(len(places)):
        least = math.inf
        for k in range(len(others)):
            dx, dy = places[i, 0] - others[k, 0], places[i, 1] - others[k, 1]
            least = min(least, dx * dx + dy * dy)
        found[i] = math.sqrt(least)
    return found
