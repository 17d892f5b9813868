"""Compiled: segments, and a grid of square cells for looking up the edges near a place.

`first` (cells + 1,) and `items` list the edges of each cell; `frame` (5,) is x0, y0, the size of a
cell [m], columns and rows.

Decides: which cells an edge lies in, how far apart segments are and whether they cross.  Must not
know: what an edge stands for.
"""

from __future__ import annotations

import math

import numpy as np

from coordinator.base.compiled import compiled
from coordinator.curves.nurbs import Array
from coordinator.ground.growth import Indices


@compiled
def cells_of(edges: Array, reach: float, frame: Array) -> tuple[Indices, Indices]:
    """Return `first` and `items`: per cell the edges (m, 4) that come within `reach` [m] of it."""
    x0, y0, size = frame[0], frame[1], frame[2]
    columns, rows = int(frame[3]), int(frame[4])
    first = np.zeros(columns * rows + 1, dtype=np.int64)
    items = np.zeros(0, dtype=np.int64)
    pad = reach + 1e-6 * size
    for fill in range(2):
        for k in range(len(edges)):
            ax, ay, bx, by = edges[k, 0], edges[k, 1], edges[k, 2], edges[k, 3]
            c0 = max(int((min(ax, bx) - pad - x0) / size), 0)
            c1 = min(int((max(ax, bx) + pad - x0) / size), columns - 1)
            r0 = max(int((min(ay, by) - pad - y0) / size), 0)
            r1 = min(int((max(ay, by) + pad - y0) / size), rows - 1)
            length = max(math.hypot(bx - ax, by - ay), 1e-12)
            nx, ny = (ay - by) / length, (bx - ax) / length
            # A cell whose middle is farther from the edge's line than this cannot touch it.
            far = 0.5 * size * (abs(nx) + abs(ny)) + pad
            for r in range(r0, r1 + 1):
                for c in range(c0, c1 + 1):
                    mx, my = x0 + (c + 0.5) * size, y0 + (r + 0.5) * size
                    if abs((mx - ax) * nx + (my - ay) * ny) > far:
                        continue
                    cell = r * columns + c
                    if fill == 0:
                        first[cell + 1] += 1
                    else:
                        items[first[cell]] = k
                        first[cell] += 1
        if fill == 0:
            for cell in range(columns * rows):
                first[cell + 1] += first[cell]
            items = np.zeros(first[-1], dtype=np.int64)
    first[1:] = first[:-1].copy()
    first[0] = 0
    return first, items


@compiled
def point_gap(px: float, py: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Return the distance from p to the segment a-b."""
    dx, dy = bx - ax, by - ay
    square = dx * dx + dy * dy
    part = 0.0
    if square > 0.0:
        part = min(max(((px - ax) * dx + (py - ay) * dy) / square, 0.0), 1.0)
    return math.hypot(px - ax - part * dx, py - ay - part * dy)


@compiled
def cross_each_other(
    px: float, py: float, qx: float, qy: float, ax: float, ay: float, bx: float, by: float
) -> bool:
    """Tell whether the segments p-q and a-b cross.

    An end that lies on the other segment counts as lying on one side of it.
    """
    dx, dy = qx - px, qy - py
    if (dx * (ay - py) - dy * (ax - px) >= 0.0) == (dx * (by - py) - dy * (bx - px) >= 0.0):
        return False
    ex, ey = bx - ax, by - ay
    return (ex * (py - ay) - ey * (px - ax) >= 0.0) != (ex * (qy - ay) - ey * (qx - ax) >= 0.0)
