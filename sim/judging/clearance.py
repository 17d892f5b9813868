"""How near robots truly came to obstacles and to the edge of the floor.

Distances are exact for straight motion between two rows of a black box.
Decides: what is solid, which is every obstacle and all that lies beyond the floor's boundary.
Shares no code with the planner and the proof.  Must not know: plans, and how large a robot is.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from coordinator.scenario.model import Point
from sim.judging.blackbox import BlackBox


class SolidGround:
    """The solid parts of a floor, given as outlines [m]."""

    def __init__(self, boundary: Sequence[Point], obstacles: Sequence[Sequence[Point]]) -> None:
        rings = [np.array(ring) for ring in (boundary, *obstacles)]
        edges = [np.stack((ring, np.roll(ring, -1, axis=0)), axis=1) for ring in rings]
        self._edges = shapely.STRtree(shapely.linestrings(np.concatenate(edges)))
        self._floor = shapely.Polygon(boundary)
        self._obstacles = shapely.STRtree([shapely.Polygon(ring) for ring in obstacles])

    def nearest(self, box: BlackBox) -> tuple[float, float]:
        """Return the least distance [m] of a robot's centre from anything solid, and when [s].

        The distance is 0 for a centre inside something solid.  Between two rows the robot is
        assumed to move straight; the time is that of the earlier row.
        """
        last = len(box.t) - 1
        moved = np.any(np.diff(box.places, axis=0) != 0.0, axis=1)
        rows = np.append(np.flatnonzero(moved), last)
        ends = np.stack((box.places[rows], box.places[np.minimum(rows + 1, last)]), axis=1)
        found, apart = self._edges.query_nearest(
            shapely.linestrings(ends), return_distance=True, all_matches=False
        )
        # A track that meets no edge is entirely free or entirely solid, as its first point is.
        if self._is_solid(box.places[0]):
            return 0.0, float(box.t[0])
        least = int(np.argmin(apart))
        return float(apart[least]), float(box.t[rows[found[0, least]]])

    def _is_solid(self, place: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> bool:
        here = shapely.Point(place)
        met = self._obstacles.query(here, predicate="intersects")
        return len(met) > 0 or not shapely.intersects(self._floor, here)
