"""Finds which robots came nearest to each other, how near and when, from their places over time.

Decides: the least distance of each robot to any other, exact for straight motion between samples.
Must not know: where the places come from.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

Array = np.ndarray[tuple[int, ...], np.dtype[np.float64]]

_COARSE: Final = 16
"""Pairs are first compared at every sample of this stride."""


class Nearest(NamedTuple):
    """The robot (its index) that came nearest, how near [m], and when [s].

    -1 and inf: none was there with it.
    """

    other: int
    distance: float
    t: float


def nearest_of_all(times: Array, tracks: Sequence[Array]) -> list[Nearest]:
    """Return for every robot the one that came nearest to it; an empty list for a single robot.

    times (m,) [s], increasing; tracks: for each robot its places (m, 2) [m] at these times, nan
    while it is not there.
    """
    count = len(tracks)
    if count < 2 or not len(times):
        return []
    found = [Nearest(-1, np.inf, 0.0)] * count
    for bound, i, j in _pairs(np.stack(tracks)):
        if bound < max(found[i].distance, found[j].distance):
            distance, t = _least(times, tracks[i] - tracks[j])
            if distance < found[i].distance:
                found[i] = Nearest(j, distance, t)
            if distance < found[j].distance:
                found[j] = Nearest(i, distance, t)
    return found


def _pairs(tracks: Array) -> list[tuple[float, int, int]]:
    """Return a lower bound on the distance [m] of every pair, the least first.

    It uses one sample in every _COARSE.  In between, a robot is no farther from one of these than
    half the way that it covers from one to the next.  For one that is not always there it is 0.
    """
    rough = np.concatenate((tracks[:, ::_COARSE], tracks[:, -1:]), axis=1)
    fine = np.hypot(*np.moveaxis(np.diff(tracks, axis=1), 2, 0))
    cuts = np.arange(0, max(fine.shape[1], 1), _COARSE)
    reach = 0.5 * np.add.reduceat(fine, cuts, axis=1).max(axis=1) if fine.size else np.zeros(1)
    found: list[tuple[float, int, int]] = []
    for i in range(len(tracks) - 1):
        apart = rough[i + 1 :] - rough[i]
        nearest = np.sqrt(np.einsum("ijk,ijk->ij", apart, apart).min(axis=1))
        bounds = nearest - (reach[i] + reach[i + 1 :] if fine.size else 0.0)
        bounds = np.nan_to_num(bounds)
        found += [(bound, i, i + 1 + k) for k, bound in enumerate(bounds.tolist())]
    return sorted(found)


def _least(times: Array, apart: Array) -> tuple[float, float]:
    """Return the least length [m] of a vector that is linear between rows, and when [s].

    What has no two rows one after the other has no length, which is inf.
    """
    if len(times) == 1:
        return float(np.hypot(*apart[0])), float(times[0])
    step = np.diff(apart, axis=0)
    square = np.einsum("ij,ij->i", step, step)
    towards = -np.einsum("ij,ij->i", apart[:-1], step)
    part = np.clip(towards / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
    distance = np.hypot(*(apart[:-1] + part[:, None] * step).T)
    distance[np.isnan(distance)] = np.inf
    at = int(np.argmin(distance))
    if np.isinf(distance[at]):
        return math.inf, float(times[at])
    return float(distance[at]), float(times[at] + part[at] * (times[at + 1] - times[at]))
