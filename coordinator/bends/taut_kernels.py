"""Compiled: a way over a mesh pulled taut where others allow it.

Decides: which vertices of a way are left out, and when the robot passes the others.  Must not know:
meshes, curves.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import compiled
from coordinator.bends.traffic_kernels import MOST, Traffic, forbidden_at
from coordinator.bends.way_kernels import LOOK, SOON, Trip
from coordinator.curves.nurbs import Array
from coordinator.curves.nurbs_kernels import Indices

Flags = npt.NDArray[np.bool_]


@compiled
def pulled_taut(
    way: Array, when: Array, sight: Flags, trip: Trip, traffic: Traffic
) -> tuple[Indices, Array]:
    """Return which vertices of a way (n, 2) are kept, and when the robot comes and goes (m, 2) [s].

    sight (n, n): which vertices a clear straight line joins.  Vertices are left out where nobody is
    met on the line.  Then the robot drives ahead of these times where others allow it, and more
    slowly than it can where not.
    """
    count = len(way)
    kept = np.zeros(count, np.int64)
    n, at = 1, 0
    while at < count - 1:
        best = at + 1
        for to in range(at + 2, count):
            if when[to - 1, 1] > when[to - 1, 0] + SOON:
                break
            if sight[at, to] and _meets_nobody(
                way[at], way[to], when[at, 1], when[to, 0], trip, traffic
            ):
                best = to
        kept[n] = at = best
        n += 1
    kept = kept[:n]
    times = np.empty((n, 2))
    times[0], times[n - 1] = when[0], when[count - 1]
    bound = 1
    while True:
        k = _ahead(way, when, kept, trip, traffic, bound, times)
        if k == n:
            return kept, times
        bound = k + 1


@compiled
def _ahead(
    way: Array, when: Array, kept: Indices, trip: Trip, traffic: Traffic, bound: int, times: Array
) -> int:
    """Enter times at the kept vertices (n, 2) [s] as far as others allow them.

    Times before number `bound` are the planned ones, later ones are as early as possible.  Returns
    n, or the number of the vertex that the robot cannot come to without meeting others.
    """
    n = len(kept)
    for k in range(1, n):
        at, to = kept[k - 1], kept[k]
        times[k] = when[to]
        if k < bound:
            continue
        leave = times[k - 1, 1]
        far = math.hypot(way[to, 0] - way[at, 0], way[to, 1] - way[at, 1])
        early = leave + far / trip.speed
        if _meets_nobody(way[at], way[to], leave, early, trip, traffic):
            times[k, 0] = early
        elif leave < when[at, 1] and not _meets_nobody(
            way[at], way[to], leave, when[to, 0], trip, traffic
        ):
            return k
        if when[to, 1] <= when[to, 0] + SOON:
            times[k, 1] = times[k, 0]
    return n


@compiled
def _meets_nobody(
    here: Array, there: Array, begin: float, end: float, trip: Trip, traffic: Traffic
) -> bool:
    """Return whether others allow a straight line between two places (2,), driven evenly."""
    times = np.empty((MOST, 2))
    dx, dy = there[0] - here[0], there[1] - here[1]
    pieces = int(math.hypot(dx, dy) / LOOK) + 1
    for j in range(1, pieces + 1):
        share = j / pieces
        x, y, now = here[0] + share * dx, here[1] + share * dy, begin + share * (end - begin)
        busy = forbidden_at(traffic, trip.robot, x, y, trip.reach, trip.tau, times)
        for i in range(busy):
            if times[i, 0] < now < times[i, 1]:
                return False
    return True
