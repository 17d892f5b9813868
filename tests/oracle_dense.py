"""Dense sampler for large fleets: every pair, every 20 ms, all shifts up to tau.

The same question as oracles.least_slack.  Pairs of seconds whose boxes are too far apart are left
out, nothing else.  Nothing in here imports the coordinator; the fleet is oracles.Track.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

BLOCK = 50
"""Samples that share a box."""


@dataclass(frozen=True)
class Closest:
    """The least |c_i(t) - c_j(t')| less the need [m] within |t - t'| <= tau: who, and when [s].

    Exact where it is below `look`; above, it only says that it is above.
    """

    slack: float
    who: tuple[str, str] = ("", "")
    when: tuple[float, float] = (math.nan, math.nan)


def closest(fleet, tau, margin, step=0.02, look=0.02):
    """Return the closest moment of a fleet; pairs farther apart than the need + `look` are one."""
    shifts = math.ceil(tau / step - 1e-9)
    step = tau / shifts if shifts else step
    end = max(track.finish for track in fleet) + tau
    blocks = math.ceil(end / step / BLOCK) + 1
    t = step * np.arange(blocks * BLOCK)
    places = np.array([track.at(t) for track in fleet]).reshape(len(fleet), blocks, BLOCK, 2)
    low, high = places.min(axis=2), places.max(axis=2)
    radius = np.array([track.radius for track in fleet])
    need = radius[:, None] + radius + margin
    worst = Closest(look)
    for i, p, j, q in _near_boxes(low, high, need + look, math.ceil(shifts / BLOCK)):
        gap = cdist(places[i, p], places[j, q]) - need[i, j]
        late = BLOCK * (q - p) + np.arange(BLOCK) - np.arange(BLOCK)[:, None]
        gap[np.abs(late) > shifts] = math.inf
        a, b = np.unravel_index(np.argmin(gap), gap.shape)
        if gap[a, b] < worst.slack:
            when = float(t[p * BLOCK + a]), float(t[q * BLOCK + b])
            worst = Closest(float(gap[a, b]), (fleet[i].id, fleet[j].id), when)
    return worst


def _near_boxes(low, high, reach, most):
    """Yield robot, block, robot, block of boxes within reach, blocks at most `most` apart."""
    blocks = low.shape[1]
    upper = np.triu(np.ones_like(reach, dtype=bool), 1)
    for p in range(blocks):
        for q in range(max(0, p - most), min(blocks, p + most + 1)):
            gap = np.maximum(
                low[None, :, q] - high[:, None, p], low[:, None, p] - high[None, :, q]
            ).max(axis=2)
            for i, j in np.argwhere((gap < reach) & upper):
                yield i, p, j, q
