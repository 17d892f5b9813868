"""A coarse grid that shows that two places are not connected, much faster than a search for ways.

Decides: what is closed for certain.  Must not know: ways, robots, curves.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from coordinator.curves.nurbs import Array
from coordinator.ground.grown_floor import GrownFloor
from coordinator.ground.rough_grid_kernels import connected

_PER_REACH: Final = 4.0
_MOST_CELLS: Final = 40_000
"""Cells have a side of a quarter of the reach, or more on large floors."""

_SURE: Final = 0.003
"""A cell counts as closed only if all of it is closed by this much [m]."""


class RoughGrid:
    """The cells in which the centre of a disc of a given reach [m] may be."""

    def __init__(self, floor: GrownFloor, reach: float) -> None:
        x0, y0, x1, y1 = floor.outline.bounds
        self._pitch = max(reach / _PER_REACH, math.sqrt((x1 - x0) * (y1 - y0) / _MOST_CELLS))
        self._sure = self._pitch * math.sqrt(0.5) + _SURE
        self._corner = np.array((x0, y0))
        xs = np.arange(x0 + 0.5 * self._pitch, x1 + self._pitch, self._pitch)
        ys = np.arange(y0 + 0.5 * self._pitch, y1 + self._pitch, self._pitch)
        centres = np.stack(np.meshgrid(xs, ys), axis=-1)
        apart = floor.distance(centres.reshape(-1, 2)).reshape(centres.shape[:2])
        self._open = apart > reach - self._sure

    def parts(self, start: Array, goal: Array, discs: Array) -> bool:
        """Return whether certainly no way leads from start to goal (2,) clear of discs (k, 3) [m].

        False does not mean that there is one.
        """
        scaled = (np.stack((start, goal)) - self._corner) / self._pitch
        closing = np.column_stack((discs[:, :2] - self._corner, discs[:, 2] - self._sure))
        return not connected(self._open, scaled.astype(np.int64), closing / self._pitch)
