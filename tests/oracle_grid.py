"""Independent oracle for one robot among moving others: places and times on a fine grid.

The robot has no inertia: in each step of time it rests or drives one step of its path.  Others are
seen at sampled moments.  Nothing in here imports the coordinator.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.spatial.distance import cdist

STEP = 0.02
"""A step of the path [m]."""


class Grid:
    """Where and when one robot must not be: `banned` (places, times).

    places_at returns points (n, 2) at arc lengths (n,); `others` have `at(times)`, (m, 2) [m].  It
    keeps `need` [m] from where any of them is within `tau` [s]; the grid ends at `horizon` [s].
    """

    def __init__(self, places_at, length, speed, others, need, tau, horizon):
        self.last = max(1, math.ceil(length / STEP))
        self.s = np.linspace(0.0, length, self.last + 1)
        self.tick = length / self.last / speed
        shifts = math.ceil(tau / self.tick)
        self.times = math.ceil(horizon / self.tick)
        t = self.tick * np.arange(-shifts, self.times + shifts + 1)
        places = places_at(self.s)
        self.banned = np.zeros((self.last + 1, self.times + 1), dtype=bool)
        for other in others:
            near = cdist(places, other.at(np.maximum(t, 0.0)), "sqeuclidean") < need**2
            wide = maximum_filter1d(near.view(np.uint8), 2 * shifts + 1, axis=1)
            self.banned |= wide[:, shifts : shifts + self.times + 1].astype(bool)

    @cached_property
    def quiet(self):
        """Where and from when on nobody comes near any more (places, times)."""
        return ~np.logical_or.accumulate(self.banned[:, ::-1], axis=1)[:, ::-1]

    @cached_property
    def _sums(self):
        return np.cumsum(np.pad(self.banned, ((0, 0), (1, 0))), axis=1)

    def arrival(self, rests=None, polite=False):
        """Return when [s] the goal is reached first, infinite if not before the horizon.

        It may rest at its start and, where given, only at the places `rests` [m]; a polite one
        only where nobody comes near any more.
        """
        may = np.ones_like(self.banned) if not polite else self.quiet.copy()
        if rests is not None:
            allowed = np.zeros(self.last + 1, dtype=bool)
            allowed[[int(np.argmin(np.abs(self.s - s))) for s in rests]] = True
            may &= allowed[:, None]
        may[0] = True
        here = np.zeros(self.last + 1, dtype=bool)
        here[0] = not self.banned[0, 0]
        for k in range(self.times + 1):
            if here[-1] and self.quiet[-1, k]:
                return k * self.tick
            if k < self.times:
                moved = here & may[:, k]
                moved[1:] |= here[:-1]
                here = moved & ~self.banned[:, k + 1]
        return math.inf

    def lets(self, reached, left):
        """Tell whether a robot may be at each place from `reached` to `left` [s], (places,)."""
        top = self.times
        low = np.clip(np.floor(reached / self.tick), 0, top).astype(int)
        high = np.clip(np.ceil(left / self.tick), 0, top).astype(int)
        at = np.arange(self.last + 1)
        return not np.any(self._sums[at, high + 1] - self._sums[at, low])
