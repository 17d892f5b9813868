"""Compiled: the fastest profile below a cap, and one with fewer knots that is nowhere faster.

A profile is a polyline of v^2 [m^2/s^2] over s [m].  It is simplified greedily: the step that costs
the least time comes first, until the allowed time is spent.  There are two kinds of steps.  Where
the slope decreases at a vertex, the vertex is removed: the chord of its neighbours lies below.
Where it increases at both ends of an edge, the edge is removed and its neighbours are prolonged
until they meet: they lie below, too.  Neither step makes the profile steeper anywhere.

Decides: which knots are worth sending.  Must not know: curves, robots.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import allocation_free, compiled
from coordinator.curves.nurbs import Array

Links = npt.NDArray[np.signedinteger[Any]]

_STRAIGHT: Final = 1e-8
"""Slopes that differ by no more than this share count as equal."""


@compiled
def reachable(s: Array, w: Array, rate: float, rests: bool) -> tuple[Array, Array]:
    """Return s, w of the highest polyline below s, w (n,) that is nowhere steeper than `rate`.

    w = v^2.  s never decreases; where it repeats, the least w counts.  With `rests` the polyline is
    0 at both ends.
    """
    if rests:
        zero = np.zeros(1)
        s, w = np.concatenate((s[:1], s, s[-1:])), np.concatenate((zero, w, zero))
    s, w = _climbed(s, w, rate)
    s, w = _climbed(-s[::-1], w[::-1].copy(), rate)
    return -s[::-1], w[::-1].copy()


@compiled
def _climbed(s: Array, w: Array, rate: float) -> tuple[Array, Array]:
    """Return s, w of the highest polyline below s, w (n,) that rises by at most `rate` a metre."""
    cut_s, cut_w = np.empty(2 * len(s)), np.empty(2 * len(s))
    cut_s[0], cut_w[0] = s[0], w[0]
    count, here = 1, w[0]
    for i in range(1, len(s)):
        step = s[i] - s[i - 1]
        ramp = here + rate * step
        if ramp > w[i] and here < w[i - 1]:
            meet = step * (w[i - 1] - here) / (w[i - 1] - here + ramp - w[i])
            cut_s[count], cut_w[count] = s[i - 1] + meet, here + rate * meet
            count += 1
        here = min(ramp, w[i])
        cut_s[count], cut_w[count] = s[i], here
        count += 1
    return cut_s[:count], cut_w[:count]


@compiled
def merged(s: Array, w: Array, share: float) -> tuple[Array, Array]:
    """Return s, w of a polyline below s, w (n,) with few vertices and the same ends.

    To drive along it takes at most 1 + share times as long.
    """
    s, w, slope = _edges(s, w)
    last = len(s) - 1
    before, after = np.arange(-1, last), np.arange(1, last + 2)
    left = 0.0
    losses = np.full(last + 1, math.inf)
    for i in range(last):
        left += share * _time(s[i], w[i], s[i + 1], w[i + 1])
        if i > 0:
            losses[i] = _loss(s, w, slope, before, after, i)
    kept = np.ones(last + 1, dtype=np.bool_)
    while True:
        i = int(np.argmin(losses))
        if not losses[i] <= left:
            return s[kept], w[kept]
        left -= losses[i]
        p, j = before[i], after[i]
        if _bends_down(slope[p], slope[i]):
            slope[p] = (w[j] - w[p]) / (s[j] - s[p])
        else:
            s[j], w[j] = _meeting(s, w, slope, p, i, j)
        after[p], before[j] = j, p
        kept[i], losses[i] = False, math.inf
        for near in (before[p], p, j, after[j]):
            if 0 < near < last:
                losses[near] = _loss(s, w, slope, before, after, near)


@compiled
def _edges(s: Array, w: Array) -> tuple[Array, Array, Array]:
    """Return s, w of the vertices at which the slope changes, and the slope after each.

    The lowest vertex of a valley is returned twice, as a level edge of length 0.  It can grow when
    the edges beside it are removed, so that the floor of the valley stays as high as it was.
    """
    kept_s, kept_w, slopes = np.empty(2 * len(s)), np.empty(2 * len(s)), np.zeros(2 * len(s))
    count, here = 0, 0
    for i in range(1, len(s)):
        step = s[i] - s[here]
        if step <= 0.0:
            continue
        rise = (w[i] - w[here]) / step
        slope = slopes[count - 1] if count > 0 else math.inf
        if abs(rise - slope) > _STRAIGHT * abs(rise):
            for _ in range(2 if slope < 0.0 < rise else 1):
                kept_s[count], kept_w[count] = s[here], w[here]
                count += 1
            slopes[count - 1] = rise
        here = i
    kept_s[count], kept_w[count] = s[here], w[here]
    return kept_s[: count + 1], kept_w[: count + 1], slopes[: count + 1]


@allocation_free
def _bends_down(slope: float, onward: float) -> bool:
    """Tell whether the slope `onward` is at most the `slope` before it, but for rounding."""
    return onward - slope <= _STRAIGHT * abs(onward)


@allocation_free
def _time(s0: float, w0: float, s1: float, w1: float) -> float:
    """Return the time [s] that the edge from (s0, w0) to (s1, w1) takes."""
    return 2.0 * (s1 - s0) / (math.sqrt(w0) + math.sqrt(w1)) if s1 > s0 else 0.0


@allocation_free
def _meeting(s: Array, w: Array, slope: Array, p: int, i: int, j: int) -> tuple[float, float]:
    """Return s, w of the place where the edge from p to i, prolonged, meets the edge after j."""
    x = s[i] + (w[j] - w[i] - slope[j] * (s[j] - s[i])) / (slope[p] - slope[j])
    x = min(max(x, s[i]), s[j])
    if abs(slope[p]) < abs(slope[j]):
        return x, w[i] + slope[p] * (x - s[i])
    return x, w[j] + slope[j] * (x - s[j])


@allocation_free
def _loss(s: Array, w: Array, slope: Array, before: Links, after: Links, i: int) -> float:
    """Return the time [s] that it costs to remove vertex i or the edge after it.

    The vertex is removed if the slope decreases at i, otherwise the edge.  The cost is infinite if
    the edge cannot be removed.
    """
    p, j = before[i], after[i]
    now = _time(s[p], w[p], s[i], w[i]) + _time(s[i], w[i], s[j], w[j])
    if _bends_down(slope[p], slope[i]):
        return max(_time(s[p], w[p], s[j], w[j]) - now, 0.0)
    q = after[j]
    if q == len(s) or slope[i] >= slope[j]:
        return math.inf
    x, y = _meeting(s, w, slope, p, i, j)
    if y <= 0.0:
        return math.inf
    now += _time(s[j], w[j], s[q], w[q])
    return max(_time(s[p], w[p], x, y) + _time(x, y, s[q], w[q]) - now, 0.0)
