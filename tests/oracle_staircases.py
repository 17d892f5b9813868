"""Staircases by dense sampling: the definition of design section 3, every 20 ms.

Nothing in here imports the coordinator; the fleet is oracles.Track.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.distance import cdist

STEP = 0.02


def sampled(fleet, margin):
    """Return the times (m,) [s], and the need (n, n, m) [s]: of robot ahead, behind, at a time.

    -inf where nothing has to have been passed.
    """
    end = max(track.finish for track in fleet) + 1.0
    times = np.arange(0.0, end, STEP)
    places = [track.at(times) for track in fleet]
    need = np.full((len(fleet), len(fleet), len(times)), -np.inf)
    earlier = times[:, None] < times
    for i, ahead in enumerate(fleet):
        for j, behind in enumerate(fleet):
            if i != j:
                near = cdist(places[i], places[j]) < ahead.radius + behind.radius + margin
                last = np.where(near & earlier, times[:, None], -np.inf).max(axis=0)
                need[i, j] = np.maximum.accumulate(last)
    return times, need
