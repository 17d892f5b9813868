"""A floor with its configuration spaces: where the centre of a disc of a given reach may be.

Decides: which configuration spaces and coarse grids are cached, and what bounds a piece of free
ground.  Must not know: curves, times or for which robot a space is used.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import shapely

from coordinator.ground.configuration_space import Ground
from coordinator.ground.growth import Rings
from coordinator.ground.rough_grid import RoughGrid
from coordinator.scenario.floor import Floor
from coordinator.scenario.model import Point

_QUARTER: Final = 16
"""Segments that a quarter of a round corner has where grown obstacles are shown or named."""


class GrownFloor(Floor):
    """A floor with a configuration space for each reach that was asked for."""

    def __init__(
        self,
        boundary: Sequence[Point],
        obstacles: Sequence[Sequence[Point]],
        names: Sequence[str] = (),
    ) -> None:
        super().__init__(boundary, obstacles, names)
        self._rings = Rings.of(obstacles, np.array(boundary))
        self._grounds: dict[tuple[float, float], Ground] = {}
        self._grids: dict[float, RoughGrid] = {}

    def ground(self, reach: float, room: float = 0.0) -> Ground:
        """Return the ground for a centre that keeps `reach` [m] from solid things.

        Its ways turn at corners farther out by `room` [m].
        """
        key = (round(reach, 9), round(room, 9))
        if key not in self._grounds:
            self._grounds[key] = Ground(self._rings, *key)
        return self._grounds[key]

    def rough_grid(self, ground: Ground) -> RoughGrid:
        """Return the coarse grid for a ground's reach, rounded down to millimetres."""
        reach = math.floor(1e3 * ground.reach) / 1e3
        if reach not in self._grids:
            self._grids[reach] = RoughGrid(ground, reach)
        return self._grids[reach]

    def fresh_ground(self, reach: float) -> Ground:
        """Return ground that is not cached, for a reach [m] that is needed only once."""
        return Ground(self._rings, reach)

    def free(self, reach: float) -> list[shapely.Geometry]:
        """Return the connected areas where a centre keeps `reach` [m] from anything solid."""
        grown = shapely.buffer(self.solid.geometries, reach, quad_segs=_QUARTER)
        return list(shapely.get_parts(shapely.difference(self.outline, shapely.union_all(grown))))
