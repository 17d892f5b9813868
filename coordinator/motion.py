"""Speed along a path: the fastest under the limits, with few knots, and the times that follow.

Decides: where the robot speeds up, slows down and rests.  v^2 is linear in s between knots, so
every piece has constant acceleration (Eq. 15-18 with the true speed).  Must not know: other robots.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from coordinator.nurbs import Array, Nurbs

_BOX_RESERVE: Final = 0.98
"""Share of the sampled lateral limit that is used: the true peak lies between samples."""

_RAMP: Final = 0.01
"""Length [m] of the speed change at a bend for robots without a limit on acceleration."""


_SHORTEST_RAMP: Final = 2e-5
"""No change of speed from rest is shorter [m]: float32 on the wire must tell its ends apart."""


@dataclass(frozen=True)
class Box:
    """A stretch [s0, s1] of the path [m] with v^2 at most w [m^2/s^2]."""

    s0: float
    s1: float
    w: float


@dataclass(frozen=True, eq=False)
class SpeedLimits:
    """What bounds the speed on one path: top v^2, acceleration (inf allowed) and slow bends."""

    length: float
    top: float
    accel: float
    bends: tuple[Box, ...]

    @property
    def ramp(self) -> float:
        """Acceleration [m/s^2] that is used: the limit, or a steep ramp without one."""
        if math.isinf(self.accel):
            return self.top / (2.0 * _RAMP)
        slowest = min([self.top, *(bend.w for bend in self.bends)])
        return min(self.accel, slowest / (2.0 * _SHORTEST_RAMP))


def limits_on(curve: Nurbs, speed: float, accel: float, lateral: float) -> SpeedLimits:
    """Return the limits on a curve for a planned speed [m/s] and accelerations [m/s^2]."""
    bends: list[Box] = []
    if math.isfinite(lateral):
        spans = np.unique(curve.knots)
        parts = np.linspace(0.0, 1.0, 32, endpoint=False)
        u = np.append((spans[:-1, None] + np.diff(spans)[:, None] * parts).ravel(), spans[-1])
        bound = _BOX_RESERVE * lateral / np.maximum(np.abs(curve.curvature(u)), 1e-9)
        bends = _boxes(curve.arc_at(u), bound, speed * speed)
    return SpeedLimits(curve.length, speed * speed, accel, tuple(bends))


def _boxes(s: Array, bound: Array, top: float) -> list[Box]:
    """Return a box per stretch of samples whose bound on v^2 lies below the top."""
    slow = np.concatenate(([False], bound < top, [False]))
    edges = np.flatnonzero(slow[1:] != slow[:-1])
    boxes = []
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        low, high = max(first - 1, 0), min(end, len(s) - 1)
        boxes.append(Box(float(s[low]), float(s[high]), float(bound[first:end].min())))
    return boxes


def speed_knots(limits: SpeedLimits, begin: float, end: float) -> tuple[Array, Array]:
    """Return the fastest motion from rest at `begin` to rest at `end`: s [m] and v^2 there.

    Robots without a limit on acceleration have full speed at once, at both ends too.
    """
    ramp = limits.ramp
    places, tops = _stretches(limits, begin, end)
    at_ends = 0.0 if math.isfinite(limits.accel) else limits.top
    caps = [min(pair) for pair in pairwise([at_ends, *tops, at_ends])]
    sizes = [s1 - s0 for s0, s1 in pairwise(places)]
    for i, size in enumerate(sizes):
        caps[i + 1] = min(caps[i + 1], caps[i] + 2.0 * ramp * size)
    for i in range(len(sizes) - 1, -1, -1):
        caps[i] = min(caps[i], caps[i + 1] + 2.0 * ramp * sizes[i])
    knots = [(places[0], caps[0])]
    for i, top in enumerate(tops):
        knots += _between(places[i], caps[i], places[i + 1], caps[i + 1], top, ramp)
        knots.append((places[i + 1], caps[i + 1]))
    return _distinct(knots)


def _stretches(limits: SpeedLimits, begin: float, end: float) -> tuple[list[float], list[float]]:
    """Return the borders [m] of stretches with one top v^2 each, and these tops."""
    places, tops = [begin], []
    for bend in limits.bends:
        if bend.s1 <= begin or bend.s0 >= end:
            continue
        if bend.s0 > places[-1]:
            tops.append(limits.top)
            places.append(bend.s0)
        tops.append(bend.w)
        places.append(min(bend.s1, end))
    if places[-1] < end:
        tops.append(limits.top)
        places.append(end)
    return places, tops


def _between(
    s0: float, w0: float, s1: float, w1: float, top: float, ramp: float
) -> list[tuple[float, float]]:
    """Return the knots between two slow places: up to the top and down, or a peak below it."""
    peak = 0.5 * (w0 + w1) + ramp * (s1 - s0)
    if peak <= top:
        return [(s0 + (peak - w0) / (2.0 * ramp), peak)]
    return [(s0 + (top - w0) / (2.0 * ramp), top), (s1 - (top - w1) / (2.0 * ramp), top)]


def _distinct(knots: list[tuple[float, float]]) -> tuple[Array, Array]:
    """Merge knots at the same place, keeping the lower speed, and drop those on a line."""
    kept: list[tuple[float, float]] = []
    same = 1e-9 * max(w for _, w in knots)
    for s, w in knots:
        if kept and s - kept[-1][0] < 1e-6:
            kept[-1] = (kept[-1][0], min(w, kept[-1][1]))
            continue
        if len(kept) > 1:
            (s0, w0), (s1, w1) = kept[-2], kept[-1]
            if abs(w0 + (w - w0) * (s1 - s0) / (s - s0) - w1) < same:
                kept.pop()
        kept.append((s, w))
    kept[-1] = (knots[-1][0], kept[-1][1])
    return np.array([s for s, _ in kept]), np.array([max(w, 0.0) for _, w in kept])


def times_at(knots_s: Array, knots_w: Array, s: Array) -> Array:
    """Return the times [s] since the first knot at arc lengths s (m,) within the knots."""
    speed = np.sqrt(knots_w)
    durations = 2.0 * np.diff(knots_s) / (speed[:-1] + speed[1:])
    begun = np.concatenate(([0.0], np.cumsum(durations)))
    leg = np.clip(np.searchsorted(knots_s, s, side="right") - 1, 0, len(knots_s) - 2)
    passed = s - knots_s[leg]
    part = passed / (knots_s[leg + 1] - knots_s[leg])
    here = np.sqrt(np.maximum(knots_w[leg] + part * (knots_w[leg + 1] - knots_w[leg]), 0.0))
    both = speed[leg] + here
    return np.asarray(begun[leg] + 2.0 * passed / np.where(both > 0.0, both, 1.0))


@dataclass(frozen=True)
class Wait:
    """A rest at arc length s [m] until plan time `depart` [s], for the robot `owner`'s sake."""

    s: float
    depart: float
    owner: int


class Motion:
    """A whole motion with its waits: when the robot reaches and leaves each place."""

    def __init__(self, limits: SpeedLimits, waits: list[Wait]) -> None:
        self.limits = limits
        self.waits = waits
        self.arrivals: list[float] = []
        places = [wait.s for wait in waits if wait.s > 0.0]
        borders = [0.0, *places, limits.length]
        departs = {wait.s: wait.depart for wait in waits}
        legs_s, legs_w, legs_t = [], [], []
        now = 0.0
        for begin, end in pairwise(borders):
            self.arrivals.append(now)
            now = max(now, departs.get(begin, 0.0))
            knots_s, knots_w = speed_knots(limits, begin, end)
            time = now + times_at(knots_s, knots_w, knots_s)
            legs_s.append(knots_s)
            legs_w.append(knots_w)
            legs_t.append(time)
            now = float(time[-1])
        self.finish = now
        self.knots_s = np.concatenate(legs_s)
        self.knots_w = np.concatenate(legs_w)
        self.knots_t = np.concatenate(legs_t)

    @property
    def start_time(self) -> float:
        """Plan time [s] at which the robot leaves its start."""
        return float(self.knots_t[0])

    def reached(self, s: Array) -> Array:
        """Return when the robot first stands at s (m,) [s]; -inf at its start."""
        leg = np.clip(np.searchsorted(self.knots_s, s, side="left") - 1, 0, None)
        return np.where(s <= 0.0, -np.inf, self._time(leg, s))

    def left(self, s: Array) -> Array:
        """Return when the robot last stands at s (m,) [s]; +inf at its goal."""
        last = len(self.knots_s) - 2
        leg = np.clip(np.searchsorted(self.knots_s, s, side="right") - 1, 0, last)
        return np.where(s >= self.limits.length, np.inf, self._time(leg, s))

    def _time(self, leg: np.ndarray[tuple[int, ...], np.dtype[np.intp]], s: Array) -> Array:
        s0, s1 = self.knots_s[leg], self.knots_s[leg + 1]
        w0, w1 = self.knots_w[leg], self.knots_w[leg + 1]
        passed = np.clip(s - s0, 0.0, s1 - s0)
        here = np.sqrt(np.maximum(w0 + passed / np.maximum(s1 - s0, 1e-12) * (w1 - w0), 0.0))
        both = np.sqrt(w0) + here
        return np.asarray(self.knots_t[leg] + 2.0 * passed / np.where(both > 0.0, both, 1.0))
