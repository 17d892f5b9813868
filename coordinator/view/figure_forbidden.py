"""Computes what forces a wait: the region in arc length and time that another robot forbids.

Robot j waits for robot i at their zone.  For an arc length s of j in the zone, take the arc lengths
of i at which the centres would be nearer than r_i + r_j + margin.  Being at s is forbidden to j
from tau before i first reaches the least of them until tau after i last leaves the greatest of
them, since i may be up to tau early or late.  The region is computed from the plan as sent.  It is
an illustration; the proof is proof/tau_safety.py.

Decides: the region.  Must not know: how it is drawn.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from coordinator.curves.chords import Chords, chords_of
from coordinator.curves.nurbs import Array
from coordinator.curves.nurbs_kernels import Indices
from coordinator.plan.document import PlanDocument, Reason
from coordinator.plan.wire import Driven
from protocol.timeline import Timeline

_ROWS: Final = 121
"""Number of samples along a zone."""


@dataclass(frozen=True, eq=False)
class Forbidden:
    """Arc lengths s (n,) [m] of a robot's path, each forbidden to it from begin to end (n,) [s].

    begin is -inf where the other robot starts there, end is inf where the other robot stays there.
    """

    s: Array
    begin: Array
    end: Array


def forbidden(robot: Driven, other: Driven, reason: Reason, document: PlanDocument) -> Forbidden:
    """Return what `other` forbids `robot` at a wait's zone, without arc lengths that are free."""
    need = robot.radius + other.radius + document.margin
    low, high = np.clip(reason.zone, 0.0, robot.curve.length)
    # The region has round ends, so samples are closer together towards both ends.
    s = low + 0.5 * (high - low) * (1.0 - np.cos(np.linspace(0.0, math.pi, _ROWS)))
    places = robot.curve.at_arc(s)
    least, greatest = nearer_than(places, chords_of(other.curve), need, reason.their_zone)
    near = least <= greatest
    begin = first_reached(other.timeline, least[near]) - document.tau
    end = last_left(other.timeline, greatest[near]) + document.tau
    return Forbidden(s[near], begin, end)


def nearer_than(
    places: Array, chords: Chords, need: float, within: tuple[float, float]
) -> tuple[Array, Array]:
    """Return for places (n, 2) the least and greatest arc length (n,) [m] of the chords near them.

    Near means at a distance of `need` [m] or less.  Only arc lengths [m] in `within` count; where
    none is near, the least is inf and the greatest is -inf.
    """
    start, way = chords.points[:-1], np.diff(chords.points, axis=0)
    square = np.maximum(np.einsum("ij,ij->i", way, way), 1e-300)
    gap = places[:, None, :] - start
    foot = np.einsum("ijk,jk->ij", gap, way) / square
    inside = need * need - (np.einsum("ijk,ijk->ij", gap, gap) - foot * foot * square)
    half = np.sqrt(np.maximum(inside, 0.0) / square)
    size = np.diff(chords.s)
    low = np.maximum(chords.s[:-1] + np.clip(foot - half, 0.0, 1.0) * size, within[0])
    high = np.minimum(chords.s[:-1] + np.clip(foot + half, 0.0, 1.0) * size, within[1])
    near = (inside >= 0.0) & (foot + half >= 0.0) & (foot - half <= 1.0) & (low <= high)
    least = np.where(near, low, math.inf).min(axis=1)
    greatest = np.where(near, high, -math.inf).max(axis=1)
    return np.asarray(least), np.asarray(greatest)


def first_reached(timeline: Timeline, s: Array) -> Array:
    """Return the times (n,) [s] at which a robot first reaches arc lengths (n,) [m].

    The time is -inf at the robot's start.
    """
    times = _times(timeline, s, np.searchsorted(timeline.s1, s, side="left"))
    return np.where(s <= 0.0, -math.inf, times)


def last_left(timeline: Timeline, s: Array) -> Array:
    """Return the times (n,) [s] at which a robot last leaves arc lengths (n,) [m].

    The time is inf at the robot's goal.
    """
    times = _times(timeline, s, np.searchsorted(timeline.s0, s, side="right") - 1)
    return np.where(s >= timeline.length, math.inf, times)


def _times(timeline: Timeline, s: Array, legs: Indices) -> Array:
    """Return the times (n,) [s] at which arc lengths (n,) [m] are passed in legs (n,)."""
    legs = np.clip(legs, 0, len(timeline.s0) - 1)
    s0, s1, v0, v1, t0 = (
        np.array(values)[legs]
        for values in (timeline.s0, timeline.s1, timeline.v0, timeline.v1, timeline.t0)
    )
    along = np.clip(s - s0, 0.0, s1 - s0)
    slope = (v1 * v1 - v0 * v0) / (s1 - s0)
    speed = np.sqrt(np.maximum(v0 * v0 + slope * along, 0.0))
    return np.asarray(t0 + 2.0 * along / np.maximum(v0 + speed, 1e-12))
