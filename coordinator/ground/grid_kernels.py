"""Compiled: segments, and a grid of square cells for looking up the edges near a place.

Decides: which cells an edge lies in, how far apart segments are and whether they cross.  Must not
know: what an edge stands for.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from coordinator.base.compiled import allocation_free, compiled
from coordinator.curves.nurbs import Array
from coordinator.ground.growth import Indices


class Segment(NamedTuple):
    """A straight line from (ax, ay) to (bx, by) [m]."""

    ax: float
    ay: float
    bx: float
    by: float


class Frame(NamedTuple):
    """The square cells of a grid: its least x and y, the side of a cell [m], columns and rows."""

    x0: float
    y0: float
    size: float
    columns: int
    rows: int


class Grid(NamedTuple):
    """Edges by cell: the cell in column c and row r has number k = r * columns + c.

    Cell k lists the edges items[first[k] : first[k + 1]].
    """

    first: Indices
    items: Indices
    frame: Frame


@compiled
def segment(edges: Array, k: int) -> Segment:
    """Return edge k of edges (m, 4)."""
    return Segment(edges[k, 0], edges[k, 1], edges[k, 2], edges[k, 3])


@compiled
def cells_of(edges: Array, reach: float, frame: Frame) -> Grid:
    """Return a grid whose cells list the edges (m, 4) that come within `reach` [m] of them."""
    x0, y0, size, columns, rows = frame
    first = np.zeros(columns * rows + 1, dtype=np.int64)
    items = np.zeros(0, dtype=np.int64)
    pad = reach + 1e-6 * size
    for fill in range(2):
        for k in range(len(edges)):
            ax, ay, bx, by = segment(edges, k)
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
    return Grid(first, items, frame)


@allocation_free
def point_gap(px: float, py: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Return the distance [m] from p to the segment a-b."""
    dx, dy = bx - ax, by - ay
    square = dx * dx + dy * dy
    part = 0.0
    if square > 0.0:
        part = min(max(((px - ax) * dx + (py - ay) * dy) / square, 0.0), 1.0)
    return math.hypot(px - ax - part * dx, py - ay - part * dy)


@allocation_free
def cross_each_other(one: Segment, two: Segment) -> bool:
    """Tell whether two segments cross.

    An end that lies on the other segment counts as lying to the left of it.
    """
    (px, py, qx, qy), (ax, ay, bx, by) = one, two
    dx, dy = qx - px, qy - py
    if (dx * (ay - py) - dy * (ax - px) >= 0.0) == (dx * (by - py) - dy * (bx - px) >= 0.0):
        return False
    ex, ey = bx - ax, by - ay
    return (ex * (py - ay) - ey * (px - ax) >= 0.0) != (ex * (qy - ay) - ey * (qx - ax) >= 0.0)
