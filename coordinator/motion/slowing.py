"""Lower speed limits on stretches of a path, so that a robot passes later without a stop.

Decides: how a stretch is driven at a lower speed.  Must not know: why.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from coordinator.curves.nurbs import Array
from coordinator.motion.profile_simplification_kernels import reachable
from coordinator.motion.velocity_profile import SpeedLimits

_EDGE: Final = 1e-3
"""Length [m] over which the limit falls at the ends of a stretch, before accelerations count."""

_SAME_SHARE: Final = 1e-6
"""Share of v^2 by which a vertex may lie off a line that replaces it."""


class Slow(NamedTuple):
    """A stretch of a path from `begin` to `end` [m] with at most this `speed` [m/s]."""

    begin: float
    end: float
    speed: float


def slowed(limits: SpeedLimits, stretches: Iterable[Slow]) -> SpeedLimits:
    """Return limits that are lower on some stretches.

    The new ceiling is nowhere steeper than the acceleration allows.
    """
    s, w = limits.ceiling[:2]
    changed = False
    for begin, end, speed in stretches:
        begin, end = max(begin, 0.0), min(end, limits.length)
        if end - begin < 4.0 * _EDGE:
            continue
        changed = True
        level = _crossings(s, w, speed * speed)
        level = level[(level > begin + _EDGE) & (level < end - _EDGE)]
        edges = np.array((begin, begin + _EDGE, *level, end - _EDGE, end))
        heights = np.interp(edges, s, w)
        s, first = np.unique(np.concatenate((s, edges)), return_index=True)
        w = np.concatenate((w, heights))[first]
        inside = (s > begin + 0.5 * _EDGE) & (s < end - 0.5 * _EDGE)
        w[inside] = np.minimum(w[inside], speed * speed)
    if not changed:
        return limits
    s, w = reachable(s, w, 2.0 * limits.ramp, math.isfinite(limits.accel))
    s, w = _corners(s, w)
    return replace(limits, bends=tuple(zip(s.tolist(), w.tolist(), strict=True)))


def _crossings(s: Array, w: Array, level: float) -> Array:
    """Return where a polyline crosses a level: there a robot that speeds up has the lower speed."""
    k = np.flatnonzero((w[:-1] - level) * (w[1:] - level) < 0.0)
    return np.asarray(s[k] + (level - w[k]) / (w[k + 1] - w[k]) * (s[k + 1] - s[k]))


def _corners(s: Array, w: Array) -> tuple[Array, Array]:
    """Return the vertices at which a polyline turns; those that lie near another one, if lower."""
    first = np.flatnonzero(np.append(True, np.diff(s) > 0.0))
    s, w = s[first], np.minimum.reduceat(w, first)
    kept = [0]
    for k in range(1, len(s) - 1):
        i = kept[-1]
        straight = w[i] + (w[k + 1] - w[i]) * (s[k] - s[i]) / (s[k + 1] - s[i])
        above, same = straight - w[k], _SAME_SHARE * w[k]
        if above > same or (above < -same and s[k] - s[i] > _EDGE):
            kept.append(k)
    kept.append(len(s) - 1)
    return s[kept], w[kept]
