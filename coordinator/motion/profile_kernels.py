"""Compiled: the fastest motion between rests below a ceiling of v^2, and its times.

A ceiling is a table (4, n): s [m], v^2 [m^2/s^2], and for each knot 2 `ramp` s of the place where a
ramp up to it begins, and of the place where one down from it ends.  It is nowhere steeper than the
ramps, so each ramp meets it once.

Decides: where the speed rises, falls and rests.  Must not know: curves, robots, why one waits.
"""

from __future__ import annotations

import math
from typing import Final, TypeAlias

import numpy as np

from coordinator.base.compiled import allocation_free, compiled
from coordinator.curves.nurbs import Array

SHORTEST_RAMP: Final = 2e-5
"""Least length [m] of a ramp from rest to speed: its ends must differ as float32 on the wire."""

_SAME_PLACE: Final = 1e-6
"""Knots nearer to each other than this [m] are merged."""

Limits: TypeAlias = tuple[float, float, float]
"""Top v^2, the limit of acceleration [m/s^2], inf allowed, and the acceleration that is used."""

_SAME_SHARE: Final = 1e-9
"""Share of v^2 by which a knot may lie off a line that replaces it: bends may be taken at 1e-5 of
the top speed, so that no share of the top is small.  `_ROUNDING` of the top is."""
_ROUNDING: Final = 4e-16

_PER_LEG: Final = 4
"""A leg has at most this many knots besides those of the ceiling below which it lies."""


@allocation_free
def _between(known: Array, values: Array, at: float) -> float:
    """Interpolate linearly between `known` places (n,), which increase, and their values (n,)."""
    low, high = 1, len(known) - 1
    while low < high:
        middle = (low + high) // 2
        if known[middle] < at:
            low = middle + 1
        else:
            high = middle
    part = (at - known[low - 1]) / (known[low] - known[low - 1])
    return float(values[low - 1] + min(max(part, 0.0), 1.0) * (values[low] - values[low - 1]))


@compiled
def _write_leg(ceiling: Array, limits: Limits, begin: float, end: float, s: Array, w: Array) -> int:
    """Write the knots of the fastest motion from rest at `begin` to rest at `end` to s, w (m,).

    Return how many there are.  A robot without a limit on acceleration has full speed everywhere,
    even at both ends.
    """
    places, heights, rises, falls = ceiling
    top, accel, ramp = limits
    low, high, rests = begin, end, math.isfinite(accel)
    if rests:
        # The small shift picks the edge's end where the ceiling is exactly as steep as a ramp.
        rate, little = 2.0 * ramp, 1e-9 * top
        low = max(_between(rises, places, rate * begin + little), begin + SHORTEST_RAMP)
        high = min(_between(falls, places, rate * end - little), end - SHORTEST_RAMP)
        if low >= high:
            middle = 0.5 * (begin + end)
            s[0], s[1], s[2] = begin, middle, end
            peak = min(ramp * (end - begin), _between(places, heights, middle))
            w[0], w[1], w[2] = 0.0, peak, 0.0
            return 3
    first = int(np.searchsorted(places, low, side="right"))
    last = int(np.searchsorted(places, high, side="left"))
    count = 0
    if rests:
        s[0], w[0], count = begin, 0.0, 1
    s[count], w[count] = low, _between(places, heights, low)
    count += 1
    for k in range(first, last):
        s[count], w[count] = places[k], heights[k]
        count += 1
    s[count], w[count] = high, _between(places, heights, high)
    count += 1
    if rests:
        s[count], w[count] = end, 0.0
        count += 1
    return _keep_distinct(s[:count], w[:count])


@compiled
def _keep_distinct(s: Array, w: Array) -> int:
    """Merge knots s, w (n,) at the same place, drop those on a straight line; return how many stay.

    Where some are merged, the lower speed counts.
    """
    rounding, kept = _ROUNDING * w.max(), 1
    end = s[-1]
    for k in range(1, len(s)):
        here, height = s[k], w[k]
        if here - s[kept - 1] < _SAME_PLACE:
            w[kept - 1] = min(w[kept - 1], height)
            continue
        if kept > 1:
            rise = (height - w[kept - 2]) / (here - s[kept - 2])
            off = abs(w[kept - 2] + rise * (s[kept - 1] - s[kept - 2]) - w[kept - 1])
            if off <= max(_SAME_SHARE * w[kept - 1], rounding):
                kept -= 1
        s[kept], w[kept] = here, height
        kept += 1
    s[kept - 1] = end
    return kept


@compiled
def motion_knots(
    ceiling: Array, limits: Limits, rests: Array, departs: Array
) -> tuple[Array, Array]:
    """Return the knots (3, n) of a motion: s [m], v^2, t [s]; and its arrivals (m,) [s] at rests.

    rests (m,) [m]: the start, places in order, and the goal; departs (m - 1,) [s]: it leaves none
    of them sooner.
    """
    s = np.empty(ceiling.shape[1] + _PER_LEG * len(rests))
    w, t, arrivals = np.empty(len(s)), np.empty(len(s)), np.empty(len(rests))
    count, now = 0, 0.0
    for leg in range(len(rests) - 1):
        arrivals[leg] = now
        now = max(now, departs[leg])
        more = _write_leg(ceiling, limits, rests[leg], rests[leg + 1], s[count:], w[count:])
        t[count] = now
        for k in range(count + 1, count + more):
            now += 2.0 * (s[k] - s[k - 1]) / (math.sqrt(w[k - 1]) + math.sqrt(w[k]))
            t[k] = now
        count += more
    arrivals[-1] = now
    return np.stack((s[:count], w[:count], t[:count])), arrivals


@compiled
def times_reached(s: Array, w: Array, t: Array, at: Array) -> Array:
    """Return the times (m,) [s] at which a motion reaches places `at` (m,) [m]; -inf at its start.

    s [m], w [m^2/s^2], t [s] (n,): its knots; where places repeat, it rests.
    """
    found = np.empty(len(at))
    for k in range(len(at)):
        leg = max(int(np.searchsorted(s, at[k], side="left")) - 1, 0)
        found[k] = -np.inf if at[k] <= 0.0 else _time(s, w, t, leg, at[k])
    return found


@compiled
def times_left(s: Array, w: Array, t: Array, at: Array, length: float) -> Array:
    """Return the times (m,) [s] at which a motion leaves places `at` (m,) [m]; +inf at its goal.

    s [m], w [m^2/s^2], t [s] (n,): its knots; where places repeat, it rests.
    """
    found = np.empty(len(at))
    for k in range(len(at)):
        leg = min(max(int(np.searchsorted(s, at[k], side="right")) - 1, 0), len(s) - 2)
        found[k] = np.inf if at[k] >= length else _time(s, w, t, leg, at[k])
    return found


@allocation_free
def _time(s: Array, w: Array, t: Array, leg: int, at: float) -> float:
    """Return when a motion is at a place [m] between the knots `leg` and `leg + 1`."""
    size = s[leg + 1] - s[leg]
    passed = min(max(at - s[leg], 0.0), size)
    here = math.sqrt(max(w[leg] + passed / max(size, 1e-12) * (w[leg + 1] - w[leg]), 0.0))
    both = math.sqrt(w[leg]) + here
    return float(t[leg] + 2.0 * passed / (both if both > 0.0 else 1.0))
