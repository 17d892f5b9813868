"""One robot's path as data for the search for waits: cells, times of passing, stations.

Decides: how a path and its speed limits become numbers for the kernels.  Must not know: other
robots (junctions.py).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from coordinator.curves.chords import Chords
from coordinator.curves.interpolation_kernels import times_at
from coordinator.curves.nurbs import Array
from coordinator.motion.velocity_profile import SpeedLimits, all_ramp_ends
from coordinator.schedule.waiting_kernels import Ride, times_left

CELL: Final = 0.008
"""Length [m] of the cells that a path is cut into, to locate conflicts to a centimetre."""


@dataclass(frozen=True, eq=False)
class Track:
    """A path as chords, what bounds the speed on it, and the length of its cells [m]."""

    limits: SpeedLimits
    chords: Chords
    cell: float = CELL

    @cached_property
    def ceiling(self) -> Array:
        """Knots (n, 2) of the greatest speed allowed: s [m], v^2."""
        return self.limits.ceiling[:2].T.copy()

    def with_cell(self, cell: float) -> Track:
        """Return the same path in cells of this length [m]."""
        return self if self.cell == cell else replace(self, cell=cell)

    @property
    def cells(self) -> int:
        """The number of cells of the path; the last cell may reach beyond its end."""
        return int(self.limits.length / self.cell) + 1

    @cached_property
    def elapsed(self) -> Array:
        """Times (n + 1,) [s] at which a robot that never rests passes the borders of cells."""
        borders = self.cell * np.arange(self.cells + 1)
        return self._elapsed_at(np.minimum(borders, self.limits.length))

    @cached_property
    def alone(self) -> float:
        """The time [s] that the whole path takes when no other robot is in the way."""
        return float(times_left(self.ride([0.0, self.limits.length]))[0])

    def cell_at(self, s: float) -> int:
        """Return the cell in which arc length s [m] lies."""
        return int(s / self.cell)

    def ride(self, places: Sequence[float]) -> Ride:
        """Return the path for the kernels, with stations at these places [m], in order."""
        limits, rest = self.limits, np.array(places, dtype=np.float64)
        ends = np.clip(all_ramp_ends(limits, rest), 0.0, limits.length)
        speeds = np.sqrt(np.interp(ends, self.ceiling[:, 0], self.ceiling[:, 1]))
        spent = 2.0 * np.abs(ends - rest[:, None]) / np.maximum(speeds, 1e-12)
        at = self._elapsed_at(ends.ravel()).reshape(-1, 2)
        cells = [self.cell_at(s) for s in places]
        down, up = 0, 1
        ramp_up = (ends[:, up], spent[:, up], at[:, up])
        ramp_down = (ends[:, down], spent[:, down], at[:, down])
        table = np.column_stack((rest, *ramp_up, *ramp_down, cells))
        at_once = math.isinf(limits.accel)
        return Ride(table, self.elapsed, self.ceiling, self.cell, limits.ramp, at_once)

    def _elapsed_at(self, s: Array) -> Array:
        return times_at(self.ceiling[:, 0], self.ceiling[:, 1], s)
