"""A coarse grid that shows that two places are not connected, much faster than a search for ways.

Decides: what is closed for certain.  Must not know: ways, robots, curves.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from coordinator.curves.nurbs import Array
from coordinator.ground.configuration_space import Ground
from coordinator.ground.distance_kernels import Solid, keeping
from coordinator.ground.rough_grid_kernels import connected

_PER_REACH: Final = 8.0
_MOST_CELLS: Final = 500_000
"""Cells have a side of an eighth of the reach, or more on large floors.  From wider ones one cannot
tell that robots in neighbouring aisles close the corner between these."""

_SURE: Final = 0.003
"""A cell counts as closed only if all of it is closed by this much [m]."""


class RoughGrid:
    """The cells in which the centre of a disc of a given reach [m], at most the ground's, may be.

    Cells deep in something solid count as open, too, but nothing leads there.
    """

    def __init__(self, ground: Ground, reach: float) -> None:
        corners = ground.rings.corners
        (x0, y0), (x1, y1) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
        self._pitch = max(reach / _PER_REACH, math.sqrt((x1 - x0) * (y1 - y0) / _MOST_CELLS))
        self._sure = self._pitch * math.sqrt(0.5) + _SURE
        self._corner = np.array((x0, y0))
        xs = np.arange(x0 + 0.5 * self._pitch, x1 + self._pitch, self._pitch)
        ys = np.arange(y0 + 0.5 * self._pitch, y1 + self._pitch, self._pitch)
        centres = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
        solid = Solid(reach - self._sure, np.empty((0, 3)), *ground.solid_edges)
        clear = keeping(centres, centres, np.zeros(len(centres)), solid)
        self._open = clear.reshape(len(ys), len(xs))

    def parts(self, start: Array, goal: Array, discs: Array) -> bool:
        """Return whether certainly no way leads from start to goal (2,) clear of discs (k, 3) [m].

        False does not mean that there is one.
        """
        scaled = (np.stack((start, goal)) - self._corner) / self._pitch
        closing = np.column_stack((discs[:, :2] - self._corner, discs[:, 2] - self._sure))
        return not connected(self._open, scaled.astype(np.int64), closing / self._pitch)
