"""Speed along a path: the fastest profile within the limits, with few knots, and its times.

Decides: where the robot speeds up, slows down and rests.  v^2 is linear in s between knots, so
every piece has constant acceleration (Eq. 15-18 with the true speed).  Must not know: other robots.
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from coordinator.curves.interpolation_kernels import between
from coordinator.curves.nurbs import Array, Nurbs
from coordinator.motion.message_room import MOST_SPEEDS, ROOM, path_bytes, speed_bytes
from coordinator.motion.profile_kernels import (
    SHORTEST_RAMP,
    Limits,
    motion_knots,
    times_left,
    times_reached,
)
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

_PLACE_ERROR: Final = 2e-5
"""By how much [m] the place of a sharp bend may be wrong, since float32 rounds places."""

_CRAWL: Final = 0.05
"""Share of the top v^2 below which _PLACE_ERROR is taken into account."""

_SAME_SHARE: Final = 1e-6
"""Share of v^2 that rounding may take."""


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
        return min(self.accel, self.top / (2.0 * SHORTEST_RAMP))

    @cached_property
    def ceiling(self) -> Array:
        """Knots of the highest v^2 allowed, with or without bends, as profile_kernels has it."""
        s, w = np.array(self.bends or ((0.0, self.top), (self.length, self.top))).T
        along = 2.0 * self.ramp * s
        return np.stack((s, w, along - w, along + w))

    @property
    def in_short(self) -> Limits:
        """These limits for profile_kernels."""
        return float(self.top), float(self.accel), float(self.ramp)


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


def all_ramp_ends(limits: SpeedLimits, rests: Array) -> Array:
    """Return where [m] ramps down to rests (n,) leave the ceiling and ramps up meet it, (n, 2)."""
    if math.isinf(limits.accel):
        return np.column_stack((rests, rests))
    rate, little, (places, _, rises, falls) = 2.0 * limits.ramp, 1e-9 * limits.top, limits.ceiling
    down = between(falls, places, rate * rests - little)
    up = between(rises, places, rate * rests + little)
    down = np.minimum(down, rests - SHORTEST_RAMP)
    return np.column_stack((down, np.maximum(up, rests + SHORTEST_RAMP)))


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
        departs = {wait.s: wait.depart for wait in waits}
        rests = [0.0, *(wait.s for wait in waits if wait.s > 0.0), limits.length]
        knots, arrivals = motion_knots(
            limits.ceiling,
            limits.in_short,
            np.array(rests),
            np.array([departs.get(place, 0.0) for place in rests[:-1]]),
        )
        self.knots_s, self.knots_w, self.knots_t = knots
        self.arrivals: list[float] = arrivals[:-1].tolist()
        self.finish = float(arrivals[-1])

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
        return times_reached(self.knots_s, self.knots_w, self.knots_t, s)

    def left(self, s: Array) -> Array:
        """Return the times [s] at which the robot leaves s (m,) [m]; +inf at its goal."""
        return times_left(self.knots_s, self.knots_w, self.knots_t, s, self.limits.length)
