"""The space that one robot's path may use: its ground without the places of other robots.

Decides: whether lines and curves are clear.  A curve is not sampled but certified, by its chords
and the greatest distance that it can have from them.  Must not know: how a path is found.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from coordinator.curves.bounds import flatten
from coordinator.curves.nurbs import Array, Nurbs
from coordinator.ground.configuration_space import Ground
from coordinator.ground.detour_kernels import lead_around
from coordinator.ground.distance_kernels import Solid, crossing, entered, keeping

Flags = npt.NDArray[np.bool_]

NO_DISCS: Final = np.empty((0, 3))

DISC_TOLERANCE: Final = 1e-3
"""Ways may touch the discs that they avoid; curves may enter them by this much [m]."""

_FLAT: Final = 1e-4
"""Greatest deviation [m] of the polylines by which curves are judged."""

_NEAR: Final = 1.0
"""Only discs within this distance [m] of a way can matter to the curve along it."""

_NEAR_DETOURS: Final = 4.0
"""Detours are searched among the discs within this distance [m] of a way."""


@dataclass(frozen=True, eq=False)
class Space:
    """Ground and discs (k, 3) [m] to stay out of.

    Curves keep at least `need` [m] from everything solid.  The lines and corners from which a curve
    is made keep `spare` [m] more, for rounding to float32.
    """

    ground: Ground
    need: float
    spare: float = 0.0
    discs: Array = field(default_factory=lambda: NO_DISCS)
    _ways: dict[bytes, Array | None] = field(default_factory=dict)

    def shortest_way(self, start: Array, goal: Array) -> Array | None:
        """Return the shortest way (n, 2) [m] from start to goal (2,); None when there is none.

        Where the way crosses discs, it is led around them locally and may be a little longer than
        the shortest.  Discs that leave no room for this take part in the next search.  Ways are
        cached: the paths that are tried for a robot with headings differ only near their ends.
        """
        ends = np.concatenate((start, goal)).tobytes()
        if ends not in self._ways:
            self._ways[ends] = self._find_way(start, goal)
        return self._ways[ends]

    def _find_way(self, start: Array, goal: Array) -> Array | None:
        blocking = np.zeros(len(self.discs), dtype=np.bool_)
        while True:
            way = self.ground.shortest_way(start, goal, self.discs[blocking])
            if way is None:
                return None
            near = np.flatnonzero(self._near(way, _NEAR_DETOURS))
            around, closed = lead_around(
                way, self.discs[near], self._relaxed[near], self.ground.sight
            )
            if len(around) and not entered(around, self._relaxed).any():
                return np.asarray(around)
            if len(around) or blocking[near[closed]].all():
                return self._shortest_among_discs(start, goal)
            blocking[near[closed]] = True

    def crossing(self, way: Array) -> Flags:
        """Return for each leg of a way (n + 1, 2) and each disc whether the leg enters the disc."""
        return crossing(way, self._relaxed)

    def _shortest_among_discs(self, start: Array, goal: Array) -> Array | None:
        """Return the shortest way; discs take part only once a way has crossed them.

        A way that is shortest among some of the discs and crosses no other is shortest among all.
        """
        active = np.zeros(len(self.discs), dtype=np.bool_)
        while True:
            way = self.ground.shortest_way(start, goal, self.discs[active])
            if way is None:
                return None
            more = entered(way, self._relaxed) & ~active
            if not more.any():
                return way
            active |= more

    def near(self, way: Array) -> Space:
        """Return the same space with only the discs that matter to a curve along a way (n, 2)."""
        return Space(self.ground, self.need, self.spare, self.discs[self._near(way, _NEAR)])

    def _near(self, way: Array, reach: float) -> Flags:
        """Return which discs come nearer than `reach` [m] to a way (n, 2) [m]."""
        wide = self.discs + np.array((0.0, 0.0, reach))
        return entered(way, wide)

    def keeping(self, starts: Array, ends: Array) -> Flags:
        """Return for each straight line (k, 2)-(k, 2) whether it is clear."""
        return keeping(starts, ends, np.zeros(len(starts)), self.solid)

    @cached_property
    def solid(self) -> Solid:
        """The obstacles for the lines and corners from which a curve is made."""
        return Solid(self.need + self.spare, self._relaxed, *self.ground.solid_edges)

    def obstructed(self, curve: Nurbs) -> Array:
        """Flatten a curve and return the parameters (m,) at which it is not proven clear."""
        chain = flatten(curve, _FLAT)
        solid = self.solid._replace(need=self.need)
        clear = keeping(chain.points[:-1], chain.points[1:], chain.deviation, solid)
        return np.asarray(0.5 * (chain.u[:-1] + chain.u[1:])[~clear])

    @cached_property
    def _relaxed(self) -> Array:
        return self.discs - (0.0, 0.0, DISC_TOLERANCE)
