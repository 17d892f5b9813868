"""Covering the occupied cells of a grid with few simple polygons.

Decides: how a region with holes is cut into pieces without holes, and where a grid lies on the
floor.  Must not know: files and formats.  Cells that share an edge belong to one region; cells that
only touch at a corner become two polygons that touch there, and nothing passes between these.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from coordinator.scenario.model import Point
from coordinator.scenario_files.maps.outlines import Labels, bridge, trace

MOST_CELLS: Final = 16_777_216
"""The greatest number of cells of a grid (4,096 by 4,096)."""
MOST_CORNERS: Final = 1_000_000
"""If the exact outlines have more corners than this, the map shows noise and not a floor."""

Cells = NDArray[np.bool_]
Window = tuple[slice, ...]


class TooManyCornersError(ValueError):
    """The outlines have too many corners; the text states how many, and how many are allowed."""


class Grid(NamedTuple):
    """Cells on the floor: `occupied` (rows, columns); the first row has the smallest y.

    `cell` [m]; (x, y) [m] is the lower left corner of the first cell, `yaw` [rad] turns the grid
    around it.
    """

    occupied: Cells
    cell: float
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    def place(self, corners: NDArray[np.int64]) -> tuple[Point, ...]:
        """Return corners of cells (n, 2), x before y, as places [m]."""
        x, y = self.cell * corners[:, 0], self.cell * corners[:, 1]
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        turned = np.column_stack((self.x + x * cos - y * sin, self.y + x * sin + y * cos))
        return tuple((px, py) for px, py in turned.tolist())

    def boundary(self) -> tuple[Point, ...]:
        """Return the extent of the grid, counter-clockwise."""
        rows, columns = self.occupied.shape
        return self.place(np.array([(0, 0), (columns, 0), (columns, rows), (0, rows)]))

    def obstacles(self, most_growth: float) -> tuple[tuple[tuple[Point, ...], ...], float]:
        """Return polygons [m] and by how much [m] they exceed the cells; at most `most_growth`."""
        outlines, growth = outline_cells(self.occupied, most_growth / self.cell)
        return tuple(map(self.place, outlines)), growth * self.cell


def outline_cells(occupied: Cells, most: float) -> tuple[list[NDArray[np.int64]], float]:
    """Return outlines of all occupied cells and how far [cells] they exceed them.

    Outlines are simple, counter-clockwise corners (n, 2) of the grid, x before y; their union
    covers every occupied cell, and nothing of it is farther than `most` [cells] from one.  With
    `most` = 0 the union is exactly the occupied cells.  Raises TooManyCornersError.
    """
    labels, pieces = _pieces_without_holes(np.pad(np.asarray(occupied, np.bool_), 1))
    count = int(_corners(labels, pieces)[1].sum())
    if count == 0:
        return [], 0.0
    corners, begins = trace(labels, pieces, count)
    keep, growth = bridge(corners, begins, labels > 0, float(most))
    kept_before = np.concatenate(([0], np.cumsum(keep)))
    return np.split(corners[keep] - 1, kept_before[begins[1:-1]]), growth


def _pieces_without_holes(occupied: Cells) -> tuple[Labels, int]:
    """Label the pieces of the occupied cells and count them; pieces with holes are cut first.

    The array has a rim of free cells.
    """
    labels = np.empty(occupied.shape, np.int32)
    pieces = ndimage.label(occupied, output=labels)
    turns, count = _corners(labels, pieces)
    if count.sum() > MOST_CORNERS:
        raise TooManyCornersError(
            f"its outlines have {count.sum()} corners, more than {MOST_CORNERS}: "
            "that is noise rather than a floor; filter the map first"
        )
    # An outline has four more left turns than right turns, unless there is a hole or a pinch.
    windows = ndimage.find_objects(labels)
    waiting = [(int(piece), windows[piece - 1]) for piece in np.flatnonzero(turns != 4) if piece]
    while waiting:
        piece, window = waiting.pop()
        view = labels[window]
        mask = view == piece
        for half in _halves(mask):
            parts, number = ndimage.label(mask[half])
            view[half][mask[half]] = parts[mask[half]] + pieces
            waiting += [
                (pieces + i, _within(box, half, window))
                for i, box in enumerate(ndimage.find_objects(parts), start=1)
            ]
            pieces += number
    return labels, pieces


def _halves(mask: Cells) -> list[Window]:
    """Return the two halves of a piece, cut through its middle hole; empty if it has no hole."""
    holes, number = ndimage.label(np.pad(~mask, 1, constant_values=True))
    if number == 1:
        return []
    axis = int(mask.shape[1] > mask.shape[0])
    spans = [box[axis] for box in ndimage.find_objects(holes)[1:]]
    at = sorted((span.start + span.stop) // 2 - 1 for span in spans)[len(spans) // 2]
    low, high, whole = slice(0, at), slice(at, mask.shape[axis]), slice(0, mask.shape[1 - axis])
    return [(low, whole), (high, whole)] if axis == 0 else [(whole, low), (whole, high)]


def _within(box: Window, half: Window, window: Window) -> Window:
    """Convert a box relative to a half of a window into a box relative to the whole grid."""
    starts = [h.start + w.start for h, w in zip(half, window, strict=True)]
    return tuple(
        slice(b.start + start, b.stop + start) for b, start in zip(box, starts, strict=True)
    )


def _corners(labels: Labels, pieces: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return for each label its left turns minus its right turns, and its number of corners.

    A corner where a piece touches itself counts as two right turns.
    """
    quads = (labels[:-1, :-1], labels[:-1, 1:], labels[1:, 1:], labels[1:, :-1])
    mixed = (quads[0] != quads[1]) | (quads[1] != quads[2]) | (quads[2] != quads[3])
    ring = [quad[mixed] for quad in quads]
    left = np.zeros(pieces + 1, np.int64)
    right = np.zeros(pieces + 1, np.int64)
    for i, here in enumerate(ring):
        before, opposite, after = ring[i - 1] == here, ring[i - 2] == here, ring[i - 3] == here
        left += np.bincount(here[~before & ~after & ~opposite], minlength=pieces + 1)
        bends = (before & after & ~opposite) | (~before & ~after & opposite)
        right += np.bincount(here[bends], minlength=pieces + 1)
    left[0] = right[0] = 0
    return left - right, left + right
