"""The configuration space of a disc: which straight lines are free for its centre, shortest ways.

One Ground serves all robots of the same reach.  Lines of sight between its vertices are computed on
demand and cached.

Decides: what counts as free (touching an obstacle does, entering it does not) and how places are
looked up.  Must not know: robots, curves or times.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Final

import numpy as np

from coordinator.base.bounds import bounds_of
from coordinator.curves.nurbs import Array
from coordinator.ground.distance_kernels import Solid, gaps, keeping
from coordinator.ground.grid_kernels import Frame, Grid, cells_of
from coordinator.ground.growth import TURN_STEP, Indices, Rings, grow
from coordinator.ground.shortest_way_kernels import search
from coordinator.ground.visibility_kernels import Sight, corners_within, sees

_SLACK: Final = 1e-6
"""Blocked ground is smaller than the grown obstacles by this [m]: touching them is allowed."""

_EDGES_PER_CELL: Final = 0.5
_MOST_CELLS: Final = 1_000_000
_SEEN_PER_TURN: Final = 64
"""The cache has room for this many visible vertices per vertex, on average."""

_FIRST_PLACES: Final = 1000
_FIRST_SHARE: Final = 2
"""How many places the first, least thorough search for a way may visit: so many, or the number of
vertices divided by _FIRST_SHARE."""

_MOST_SAGITTA: Final = 0.05
"""The grid of solid edges serves tests of distances up to the reach plus this [m]."""


class Ground:
    """Free ground for a centre that keeps `reach` [m] from all that is solid.

    Ways turn at vertices that lie farther out by `room` [m].
    """

    def __init__(self, rings: Rings, reach: float, room: float = 0.0) -> None:
        self.reach = reach
        self.rings = rings
        self._newest: tuple[bytes, Array | None] = b"", None
        blocking, turning = grow(rings, reach - _SLACK), grow(rings, reach + room)
        self.frame = _frame(blocking.edges, turning.turns)
        bare = Solid(reach - 2.0 * _SLACK, np.empty((0, 3)), *self.solid_edges)
        # A vertex within the reach of something else cannot be a corner of any way.
        free = keeping(turning.turns, turning.turns, np.zeros(len(turning.turns)), bare)
        self.turns = turning.turns[free]
        count = len(self.turns)
        rows = np.full((count + 1, 2), -1)
        rows[-1] = 0
        pool = np.zeros(min(count * count, max(_SEEN_PER_TURN * count, 4096)), np.int64)
        self.sight = Sight(
            turns=self.turns,
            before=turning.before[free],
            after=turning.after[free],
            rows=rows,
            pool=pool,
            edges=blocking.edges,
            owners=blocking.owners,
            beyond=blocking.beyond,
            corners=rings.corners,
            reach=reach - _SLACK,
            room=room,
            grid=cells_of(blocking.edges, 0.0, self.frame),
            solid=bare,
        )

    def clear(self, start: Array, end: Array) -> bool:
        """Return whether the straight line between two places (2,) [m] is free."""
        spared = self._spared(np.stack((start, end)))
        return sees(start[0], start[1], end[0], end[1], self.sight, spared)

    def shortest_way(
        self, start: Array, goal: Array, discs: Array, longest: float = math.inf
    ) -> Array | None:
        """Return the vertices (n, 2) [m] of the shortest way; None if none is within `longest` [m].

        start, goal (2,) [m] are the first and the last vertex; discs (k, 3) [m]: x, y, radius of
        places to stay out of.  The search starts from both ends in turn, with growing effort: if
        one end is enclosed, the search from there ends early.
        """
        ends = np.stack((start, goal))
        if np.array_equal(start, goal):
            return ends
        if len(discs) or longest < math.inf:
            return self._way(ends, discs, longest)
        key, (known, way) = ends.tobytes(), self._newest
        if key != known:
            way = self._way(ends, discs, longest)
            self._newest = key, way  # A robot is looked for a way to the same place again, soon.
        return way

    def _way(self, ends: Array, discs: Array, longest: float) -> Array | None:
        most = max(_FIRST_PLACES, len(self.turns) // _FIRST_SHARE)
        spared = self._spared(ends)
        while True:
            for step in (1, -1):
                # A kernel is compiled anew, for seconds, for an array of another layout.
                begin = np.ascontiguousarray(ends[::step])
                way = search(begin, most, longest, discs, self.sight, spared)
                if len(way) == 0:
                    return None
                if not math.isnan(way[0, 0]):
                    return np.ascontiguousarray(way[::step])
            most *= 4

    @cached_property
    def solid_edges(self) -> tuple[Array, Grid]:
        """The edges (m, 4) of everything solid, not grown, and their grid for `keeping`."""
        corners = self.rings.corners
        edges = np.concatenate((corners, corners[self.rings.following]), axis=1)
        return edges, cells_of(edges, self.reach + _MOST_SAGITTA, self.frame)

    def gaps(self, places: Array, most: float) -> Array:
        """Return the distances (n,) [m] of places (n, 2) from the nearest edge, up to `most`."""
        edges, _ = self.solid_edges
        return gaps(places, edges, cells_of(edges, most, self.frame), most)

    def _spared(self, places: Array) -> Indices:
        """Return the corners that have a place between their arc and its tangent polygon.

        At these corners the arc itself decides what is free; otherwise a robot at that place could
        not leave it.
        """
        far = self.reach / math.cos(0.5 * TURN_STEP)
        return corners_within(places, self.rings.corners, far)


def _frame(edges: Array, turns: Array) -> Frame:
    """Return a frame that holds all edges (m, 4) and turns (n, 2) [m]."""
    ends = np.concatenate((edges[:, :2], edges[:, 2:], turns))
    low, high = bounds_of(ends)
    wide, tall = (high - low).tolist()
    cells = min(max(len(edges) / _EDGES_PER_CELL, 16.0), _MOST_CELLS)
    size = max(math.sqrt(wide * tall / cells), max(wide, tall) / 2000.0, 1e-6)
    x0, y0 = (low - 0.01 * size).tolist()
    columns, rows = math.ceil(wide / size + 0.02), math.ceil(tall / size + 0.02)
    return Frame(x0, y0, size, max(columns, 1), max(rows, 1))
