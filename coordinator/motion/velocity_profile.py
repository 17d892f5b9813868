"""Speed along a path: the fastest profile within the limits, with few knots, and its times.

Decides: where the robot speeds up, slows down and rests.  v^2 is linear in s between knots, so
every piece has constant acceleration (Eq. 15-18 with the true speed).  Must not know: other robots.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Final

import numpy as np

from coordinator.curves.interpolation_kernels import between
from coordinator.curves.nurbs import Array, Nurbs
from coordinator.motion.message_room import MOST_SPEEDS, ROOM, path_bytes, speed_bytes
from coordinator.motion.profile_simplification_kernels import merged, reachable
from coordinator.motion.speed_cap import cap_on

_LOSSES: Final = (0.006, 0.012, 0.025, 0.05, 0.1, 0.15, 0.2, 0.25)
"""Shares of the fastest time that may be lost in order to have fewer knots.  The first share that
makes the knots fit into a message is used, or the last one."""

FASTEST_TURN: Final = 20.0
"""No robot turns faster than this [rad/s], whatever its limits are.

A control loop of 100 Hz that turns farther than 0.2 rad in one tick cannot keep to its path."""

_RAMP: Final = 0.01
"""Length [m] of the speed change at a bend for robots without a limit on acceleration."""

_SHORTEST_RAMP: Final = 2e-5
"""Least length [m] of a ramp from rest to speed: its ends must differ as float32 on the wire."""

_PLACE_ERROR: Final = 2e-5
"""By how much [m] the place of a sharp bend may be wrong, since float32 rounds places."""

_CRAWL: Final = 0.05
"""Share of the top v^2 below which _PLACE_ERROR is taken into account."""

_SAME_SHARE: Final = 1e-6
"""Share of v^2 that rounding may take."""

_SAME_PLACE: Final = 1e-6
"""Knots nearer to each other than this [m] are merged."""


@dataclass(frozen=True, eq=False)
class SpeedLimits:
    """Limits of the speed on one path: top v^2, acceleration (inf allowed) and slow bends.

    bends: knots (s, v^2) of the highest v^2 allowed, from 0 to the length, at most `top` and
    nowhere steeper than `ramp` allows; empty if no bend lowers the speed.
    """

    length: float
    top: float
    accel: float
    bends: tuple[tuple[float, float], ...]

    @property
    def ramp(self) -> float:
        """Acceleration [m/s^2] that is used: the limit, or a steep ramp's if there is none."""
        if math.isinf(self.accel):
            return self.top / (2.0 * _RAMP)
        return min(self.accel, self.top / (2.0 * _SHORTEST_RAMP))

    @cached_property
    def ceiling(self) -> tuple[list[float], list[float]]:
        """Knots of the highest v^2 allowed, with or without bends: s [m], v^2."""
        knots = self.bends or ((0.0, self.top), (self.length, self.top))
        return [s for s, _ in knots], [w for _, w in knots]

    @cached_property
    def rises(self) -> list[float]:
        """For each knot of the ceiling: 2 `ramp` s of the place where a ramp up to it begins."""
        return [2.0 * self.ramp * s - w for s, w in zip(*self.ceiling, strict=True)]

    @cached_property
    def falls(self) -> list[float]:
        """For each knot of the ceiling: 2 `ramp` s of the place where a ramp down from it ends."""
        return [2.0 * self.ramp * s + w for s, w in zip(*self.ceiling, strict=True)]


def limits_on(
    curve: Nurbs, speed: float, accel: float, lateral: float, turning: float = math.inf
) -> SpeedLimits:
    """Return the limits on a curve for a speed [m/s], accelerations [m/s^2], turn rate [rad/s].

    A motion along the whole curve takes at most 1 % longer than the fastest one, or longer if a
    message has no room for that many knots.  No robot turns faster than FASTEST_TURN.
    """
    free = SpeedLimits(curve.length, speed * speed, accel, ())
    s, w = cap_on(curve, lateral, min(turning, FASTEST_TURN), free.top)
    if w.min() >= free.top:
        return free
    s, w = _few(curve, *reachable(s, _rounded_down(free, w), 2.0 * free.ramp, math.isfinite(accel)))
    return replace(free, bends=tuple(zip(s.tolist(), w.tolist(), strict=True)))


def limits_after(
    begun: Array, curve: Nurbs, speed: float, accel: float, lateral: float, turning: float
) -> SpeedLimits | None:
    """Return the limits on a curve whose first part is driven in a given way; `accel` is finite.

    begun (n, 2): knots of the motion on that part, s [m] and v^2.  None if the robot would have to
    be slower there to keep to the limits behind it.
    """
    free = SpeedLimits(curve.length, speed * speed, accel, ())
    at, height = begun[-1].tolist()
    s, w = cap_on(curve, lateral, turning, free.top)
    behind = s > at
    s, w = np.append(at, s[behind]), np.append(height, _rounded_down(free, w[behind]))
    s, w = reachable(np.append(s, s[-1]), np.append(w, 0.0), 2.0 * free.ramp, False)
    if w[0] < height * (1.0 - _SAME_SHARE):
        return None
    s, w = _few(curve, s, w)
    knots = [*begun.tolist(), *zip(s[1:].tolist(), w[1:].tolist(), strict=True)]
    return replace(free, bends=tuple((s, w) for s, w in knots))


def _rounded_down(free: SpeedLimits, w: Array) -> Array:
    """Return v^2 (n,) at bends, lower where rounding the place of a sharp one matters."""
    lower = np.maximum(w - 2.0 * free.ramp * _PLACE_ERROR, 0.25 * w)
    return np.where(w < _CRAWL * free.top, lower, w)


def _few(curve: Nurbs, s: Array, w: Array) -> tuple[Array, Array]:
    """Return a profile with so few knots that they fit into a message with the curve."""
    fewer = s, w
    room = ROOM - path_bytes(len(curve.points))
    for loss in _LOSSES:
        fewer = merged(s, w, loss)
        speeds = len(np.unique(fewer[1]))
        if speeds <= MOST_SPEEDS and speed_bytes(len(fewer[0]), speeds) <= room:
            break
    return fewer


def least_time(
    curve: Nurbs, speed: float, accel: float, lateral: float, turning: float = math.inf
) -> float:
    """Return the time [s] of the fastest motion along a whole curve, from rest to rest."""
    free = SpeedLimits(curve.length, speed * speed, accel, ())
    cap = cap_on(curve, lateral, turning, free.top)
    s, w = reachable(*cap, 2.0 * free.ramp, math.isfinite(accel))
    both = np.sqrt(w[:-1]) + np.sqrt(w[1:])
    return float((2.0 * np.diff(s) / np.where(both > 0.0, both, 1.0)).sum())


def speed_knots(limits: SpeedLimits, begin: float, end: float) -> tuple[list[float], list[float]]:
    """Return the fastest motion from rest at `begin` to rest at `end`: knots s [m] and v^2.

    Robots without a limit on acceleration have full speed everywhere, even at both ends.
    """
    places, heights = limits.ceiling
    low, high = ramp_ends(limits, begin)[1], ramp_ends(limits, end)[0]
    if math.isfinite(limits.accel) and low >= high:
        middle = 0.5 * (begin + end)
        peak = min(limits.ramp * (end - begin), _between(places, heights, middle))
        return [begin, middle, end], [0.0, peak, 0.0]
    inner = slice(bisect_right(places, low), bisect_left(places, high))
    s = [low, *places[inner], high]
    w = [_between(places, heights, low), *heights[inner], _between(places, heights, high)]
    if math.isfinite(limits.accel):
        s, w = [begin, *s, end], [0.0, *w, 0.0]
    return _distinct(s, w)


def all_ramp_ends(limits: SpeedLimits, rests: Array) -> Array:
    """Return the `ramp_ends` (n, 2) [m] of many rests (n,) [m]."""
    if math.isinf(limits.accel):
        return np.column_stack((rests, rests))
    rate, little, places = 2.0 * limits.ramp, 1e-9 * limits.top, np.array(limits.ceiling[0])
    down = between(np.array(limits.falls), places, rate * rests - little)
    up = between(np.array(limits.rises), places, rate * rests + little)
    down = np.minimum(down, rests - _SHORTEST_RAMP)
    return np.column_stack((down, np.maximum(up, rests + _SHORTEST_RAMP)))


def ramp_ends(limits: SpeedLimits, rest: float) -> tuple[float, float]:
    """Return where [m] the ramp down to a rest leaves the ceiling, and where the ramp up meets it.

    The ceiling is nowhere steeper than the ramps, so each ramp meets it once.
    """
    if math.isinf(limits.accel):
        return rest, rest
    # The small shift picks the edge's end where the ceiling is exactly as steep as a ramp.
    rate, little, places = 2.0 * limits.ramp, 1e-9 * limits.top, limits.ceiling[0]
    down = _between(limits.falls, places, rate * rest - little)
    up = _between(limits.rises, places, rate * rest + little)
    return min(down, rest - _SHORTEST_RAMP), max(up, rest + _SHORTEST_RAMP)


def _between(known: list[float], values: list[float], at: float) -> float:
    """Interpolate linearly between `known` places, which increase, and their values."""
    k = bisect_left(known, at, 1, len(known) - 1)
    part = (at - known[k - 1]) / (known[k] - known[k - 1])
    return values[k - 1] + min(max(part, 0.0), 1.0) * (values[k] - values[k - 1])


def _distinct(s: list[float], w: list[float]) -> tuple[list[float], list[float]]:
    """Merge knots at the same place, with the lower speed, and drop those on a straight line."""
    kept_s, kept_w = s[:1], w[:1]
    same = 1e-9 * max(w)
    for here, height in zip(s[1:], w[1:], strict=True):
        if here - kept_s[-1] < _SAME_PLACE:
            kept_w[-1] = min(kept_w[-1], height)
            continue
        if len(kept_s) > 1:
            rise = (height - kept_w[-2]) / (here - kept_s[-2])
            if abs(kept_w[-2] + rise * (kept_s[-1] - kept_s[-2]) - kept_w[-1]) < same:
                kept_s.pop()
                kept_w.pop()
        kept_s.append(here)
        kept_w.append(height)
    kept_s[-1] = s[-1]
    return kept_s, kept_w


@dataclass(frozen=True)
class Wait:
    """A rest at arc length s [m] until plan time `depart` [s], to let the robot `owner` pass.

    `zone` is the conflict zone that the robot waits to enter; `owner` and `zone` are -1 for a rest
    that no other robot causes.
    """

    s: float
    depart: float
    owner: int
    zone: int = -1


class Motion:
    """A robot's motion along its whole path, with its waits and the time at each place."""

    def __init__(self, limits: SpeedLimits, waits: list[Wait]) -> None:
        self.limits = limits
        self.waits = waits
        self.arrivals: list[float] = []
        places = [wait.s for wait in waits if wait.s > 0.0]
        borders = [0.0, *places, limits.length]
        departs = {wait.s: wait.depart for wait in waits}
        knots_s: list[float] = []
        knots_w: list[float] = []
        knots_t: list[float] = []
        now = 0.0
        for begin, end in pairwise(borders):
            self.arrivals.append(now)
            now = max(now, departs.get(begin, 0.0))
            leg_s, leg_w = speed_knots(limits, begin, end)
            knots_s += leg_s
            knots_w += leg_w
            knots_t.append(now)
            for (s0, s1), (w0, w1) in zip(pairwise(leg_s), pairwise(leg_w), strict=True):
                now += 2.0 * (s1 - s0) / (math.sqrt(w0) + math.sqrt(w1))
                knots_t.append(now)
        self.finish = now
        self.knots_s, self.knots_w = np.array(knots_s), np.array(knots_w)
        self.knots_t = np.array(knots_t)

    def place_at(self, time: float) -> float:
        """Return where the robot is at a plan time [s], as arc length [m]; 0 before its start."""
        at = int(np.searchsorted(self.knots_t, time, side="right")) - 1
        if at < 0 or at + 1 == len(self.knots_t):
            return 0.0 if at < 0 else self.limits.length
        s, after = self.knots_s[at : at + 2].tolist()
        if after <= s:
            return float(s)
        t0, t1 = self.knots_t[at : at + 2].tolist()
        v0, v1 = np.sqrt(self.knots_w[at : at + 2]).tolist()
        passed = time - t0
        return float(s + passed * (v0 + 0.5 * (v1 - v0) / (t1 - t0) * passed))

    def from_place(self, place: float) -> Motion:
        """Return the motion from an arc length [m] on, which it passes without a rest there."""
        rest = copy(self)
        k = int(np.searchsorted(self.knots_s, place, side="right"))
        s0, s1 = self.knots_s[k - 1 : k + 1].tolist()
        w0, w1 = self.knots_w[k - 1 : k + 1].tolist()
        here = w0 + (place - s0) / (s1 - s0) * (w1 - w0)
        rest.knots_s = np.append(place, self.knots_s[k:]) - place
        rest.knots_w = np.append(here, self.knots_w[k:])
        rest.knots_t = np.append(self.reached(np.array([place])), self.knots_t[k:])
        rest.waits = [replace(one, s=one.s - place) for one in self.waits if one.s > place]
        return rest

    @property
    def start_time(self) -> float:
        """Plan time [s] at which the robot leaves its start."""
        return float(self.knots_t[0])

    def reached(self, s: Array) -> Array:
        """Return the times [s] at which the robot reaches s (m,) [m]; -inf at its start."""
        leg = np.clip(np.searchsorted(self.knots_s, s, side="left") - 1, 0, None)
        return np.where(s <= 0.0, -np.inf, self._time(leg, s))

    def left(self, s: Array) -> Array:
        """Return the times [s] at which the robot leaves s (m,) [m]; +inf at its goal."""
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
