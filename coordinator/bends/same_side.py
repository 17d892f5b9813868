"""Arcs on which all robots keep to the same side, as in a roundabout, at a pace that fits all.

Robots that are placed one after another never find such a flow: the first ones drive straight on.

Decides: the arcs, and the pace at which nobody would meet anybody.  Must not know: curves, meshes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np

from coordinator.bends.traffic_kernels import Traffic, first_meeting
from coordinator.curves.nurbs import Array

BULGES: Final = (0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0, 1.15, 1.3, 1.5, 1.8)
"""How far arcs go aside, as shares of half the distance from start to goal; 1 is a half circle."""

_TURN: Final = 0.25
"""The turn [rad] from one vertex of an arc to the next, at most."""

_STEP: Final = 0.15
"""Distance [m] between the samples of an arc."""

_SLOWEST: Final = 0.25
_HALVINGS: Final = 5
"""The pace is at least this share of the greatest speed, and is found by so many halvings."""


class Mover(NamedTuple):
    """A robot's start and goal (2,) [m], its radius [m], speed [m/s], and acceleration [m/s^2]."""

    start: Array
    goal: Array
    radius: float
    speed: float
    accel: float


class Turning(NamedTuple):
    """Arcs of all robots as polygons (n, 2) [m], and the pace [m/s] at which nobody meets anybody.

    arrivals: their sum [s].
    """

    arcs: list[Array]
    pace: float
    arrivals: float


def same_side(
    movers: Sequence[Mover],
    keeps: Callable[[int, Array], bool],
    gather: Callable[[list[Array]], Traffic],
    margin: float,
    tau: float,
) -> list[Turning]:
    """Return the flows that keep to one side, those with the earliest arrivals first.

    keeps: whether the floor has room for a robot's polygon; gather: makes traffic of samples.
    """
    found = []
    for bulge in BULGES:
        arcs = [arc(one.start, one.goal, bulge) for one in movers]
        if not all(keeps(index, way) for index, way in enumerate(arcs)):
            continue
        pace = _pace(movers, arcs, gather, margin, tau)
        if pace > 0.0:
            arrivals = sum(
                _length(way) / min(one.speed, pace) for one, way in zip(movers, arcs, strict=True)
            )
            found.append(Turning(arcs, pace, arrivals))
    return sorted(found, key=lambda one: one.arrivals)


def arc(start: Array, goal: Array, bulge: float) -> Array:
    """Return the vertices (n, 2) of an arc to the right of the straight line."""
    along = goal - start
    half = 2.0 * math.atan(bulge)
    angles = np.linspace(-half, half, 2 * max(math.ceil(half / _TURN), 1) + 1)
    size = 0.5 / math.sin(half)
    forth, aside = size * np.sin(angles), size * (np.cos(angles) - math.cos(half))
    right = np.array((along[1], -along[0]))
    way = 0.5 * (start + goal) + forth[:, None] * along + aside[:, None] * right
    way[0], way[-1] = start, goal
    return np.asarray(way)


def _pace(
    movers: Sequence[Mover],
    arcs: Sequence[Array],
    gather: Callable[[list[Array]], Traffic],
    margin: float,
    tau: float,
) -> float:
    """Return the greatest pace [m/s] at which nobody meets anybody; 0 if there is none."""
    top = max(one.speed for one in movers)
    marks = [_marks(way) for way in arcs]

    def is_clear(pace: float) -> bool:
        samples = [
            _samples(one, *mark, min(one.speed, pace))
            for one, mark in zip(movers, marks, strict=True)
        ]
        traffic = gather(samples)
        return all(
            first_meeting(own, traffic, index, movers[index].radius + margin, tau) < 0
            for index, own in enumerate(samples)
        )

    if is_clear(top):
        return top
    low, high = _SLOWEST * top, top
    if not is_clear(low):
        return 0.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_clear(middle) else (low, middle)
    return low


def _marks(way: Array) -> tuple[Array, Array]:
    """Return places (m + 1, 2) along a polygon, the ends among them, and the borders (m,) [m]."""
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(way, axis=0).T)))
    borders = np.linspace(0.0, along[-1], max(int(along[-1] / _STEP), 1) + 1)
    s = np.concatenate(([0.0], 0.5 * (borders[1:] + borders[:-1]), [along[-1]]))
    return np.column_stack([np.interp(s, along, way[:, axis]) for axis in (0, 1)]), borders


def _samples(one: Mover, places: Array, borders: Array, speed: float) -> Array:
    """Return the samples (n, 5) of a robot on its arc, as traffic_kernels has them."""
    ramp = 0.5 * speed / one.accel
    times = np.concatenate(
        ([0.0], ramp + borders[1:-1] / speed, [2.0 * ramp + borders[-1] / speed])
    )
    begin, end = np.append(-math.inf, times), np.append(times, math.inf)
    return np.column_stack((places, begin, end, np.full(len(places), one.radius)))


def _length(way: Array) -> float:
    return float(np.hypot(*np.diff(way, axis=0).T).sum())
