"""The least distance of two moving robots over all times no more than tau apart.

Branch and bound over boxes of (t, t').  What bounds a distance from below is the arc length that a
robot covers in a block of time: it cannot get farther from where it is at the block's ends and
middle.  Nothing is taken from samples alone.

Decides: how near robots come by their wire bytes, to RESOLUTION.  Must not know: what is near
enough (proof.py), zones or schedules.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
import numpy.typing as npt

from coordinator.nurbs import Array
from coordinator.wire import Driven

RESOLUTION: Final = 2.5e-4
"""Least values are exact up to this [m]."""

_BLOCK: Final = 4.0

Indices = npt.NDArray[np.int64]


class Flight:
    """One robot's planned place over time, vectorised: c(t) of design section 1."""

    def __init__(self, driven: Driven) -> None:
        self.driven = driven
        timeline = driven.timeline
        self._t0, self._t1 = np.array(timeline.t0), np.array(timeline.t1)
        self._s0, self._v0 = np.array(timeline.s0), np.array(timeline.v0)
        self._rate = (np.array(timeline.v1) - self._v0) / (self._t1 - self._t0)
        self.finish = timeline.finish

    def arc(self, time: Array) -> Array:
        """Return arc lengths (m,) [m] at plan times (m,) [s]."""
        leg = np.clip(np.searchsorted(self._t0, time, side="right") - 1, 0, len(self._t0) - 1)
        passed = np.clip(time, self._t0[leg], self._t1[leg]) - self._t0[leg]
        return np.asarray(self._s0[leg] + passed * (self._v0[leg] + 0.5 * self._rate[leg] * passed))

    def stretch(self, block: Indices, size: float) -> tuple[Array, Array]:
        """Return where the robot is in blocks of time: 3 places (m, 3, 2) and ways (m, 3).

        Block k is the interval [k, k + 1] * size; the places are those at its beginning, middle
        and end, the ways [m] lead from the first to the second, on to the third, and in all.
        """
        times = (block[:, None] + np.array((0.0, 0.5, 1.0))) * size
        arcs = self.arc(times.ravel()).reshape(-1, 3)
        places = self.driven.curve.at_arc(arcs.ravel()).reshape(-1, 3, 2)
        ways = np.diff(arcs, axis=1)
        return places, np.column_stack((ways, ways.sum(axis=1)))


@dataclass(frozen=True)
class Closest:
    """The least slack [m], the distance there [m], whose (indices), when [s] and where [m]."""

    slack: float
    distance: float
    a: int
    b: int
    t_a: float
    t_b: float
    x: float
    y: float


@dataclass(frozen=True, eq=False)
class _Boxes:
    """Boxes of plan times: block p of robot a by block q of robot b."""

    a: Indices
    p: Indices
    b: Indices
    q: Indices

    def pick(self, keep: npt.NDArray[np.bool_]) -> _Boxes:
        return _Boxes(self.a[keep], self.p[keep], self.b[keep], self.q[keep])

    def quarters(self) -> _Boxes:
        p = np.concatenate([2 * self.p + i for i in (0, 1, 0, 1)])
        q = np.concatenate([2 * self.q + i for i in (0, 0, 1, 1)])
        return _Boxes(np.tile(self.a, 4), p, np.tile(self.b, 4), q)

    def in_band(self, tau: float, size: float) -> _Boxes:
        return self.pick((np.abs(self.p - self.q) - 1) * size <= tau)


def least_slack(flights: Sequence[Flight], tau: float, need: Array) -> Closest | None:
    """Return the least centre distance minus need[a, b] [m] over all pairs and |t - t'| <= tau.

    need: (n, n) [m].  None for fewer than two robots.  The true least slack lies between the
    value returned and RESOLUTION below it.
    """
    if len(flights) < 2:
        return None
    size = _BLOCK
    boxes = _first_boxes(flights, tau)
    best: Closest | None = None
    while len(boxes.p):
        low, slack, middle = _bounds(boxes, flights, size, need)
        valid = np.flatnonzero(np.abs(boxes.p - boxes.q) * size <= tau)
        if len(valid):
            at = int(valid[np.argmin(slack[valid])])
            if best is None or slack[at] < best.slack:
                best = Closest(
                    float(slack[at]),
                    float(slack[at] + need[boxes.a[at], boxes.b[at]]),
                    int(boxes.a[at]),
                    int(boxes.b[at]),
                    float((boxes.p[at] + 0.5) * size),
                    float((boxes.q[at] + 0.5) * size),
                    float(middle[at, 0]),
                    float(middle[at, 1]),
                )
        if best is not None:
            boxes = boxes.pick(low < best.slack - RESOLUTION)
        size *= 0.5
        boxes = boxes.quarters().in_band(tau, size)
    return best


def _first_boxes(flights: Sequence[Flight], tau: float) -> _Boxes:
    """Return boxes over all times from 0 until both robots of a pair stand at their goals.

    Earlier and later times repeat places that these boxes hold already.
    """
    parts = []
    blocks = [math.ceil(flight.finish / _BLOCK) + 1 for flight in flights]
    band = np.arange(-int(tau / _BLOCK) - 1, int(tau / _BLOCK) + 2, dtype=np.int64)
    for a in range(len(flights)):
        for b in range(a + 1, len(flights)):
            count = max(blocks[a], blocks[b])
            p = np.repeat(np.arange(count, dtype=np.int64), len(band))
            q = p + np.tile(band, count)
            boxes = _Boxes(np.full_like(p, a), p, np.full_like(p, b), q)
            parts.append(boxes.pick((q >= 0) & (q < count)))
    return _Boxes(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in ("a", "p", "b", "q"))
    )


def _bounds(
    boxes: _Boxes, flights: Sequence[Flight], size: float, need: Array
) -> tuple[Array, Array, Array]:
    """Return per box a lower bound, the slack at its middle, and the place between the robots.

    Two bounds hold, and the better one counts.  Ball: a robot is no farther from its middle place
    than the way from there to either end.  Segment: a way of length l between two places c apart
    stays within sqrt(l^2 - c^2) / 2 of the straight line between them, for it runs in the ellipse
    with these foci; on straight paths this is exact at once.
    """
    places, ways = [], []
    for robot, block in ((boxes.a, boxes.p), (boxes.b, boxes.q)):
        width = int(block.max()) + 1
        key, inverse = _distinct(robot * width + block)
        place, way = np.empty((len(key), 3, 2)), np.empty((len(key), 3))
        borders = np.searchsorted(key // width, np.arange(len(flights) + 1))
        for index, (first, end) in enumerate(pairwise(borders.tolist())):
            if first < end:
                stretch = flights[index].stretch(key[first:end] - index * width, size)
                place[first:end], way[first:end] = stretch
        places.append(place[inverse])
        ways.append(way[inverse])
    apart = places[0][:, 1] - places[1][:, 1]
    wanted = need[boxes.a, boxes.b]
    slack = np.hypot(apart[:, 0], apart[:, 1]) - wanted
    ball = slack - sum(np.maximum(way[:, 0], way[:, 1]) for way in ways)
    straight = _segment_distance(places[0][:, 0], places[0][:, 2], places[1][:, 0], places[1][:, 2])
    for place, way in zip(places, ways, strict=True):
        chord = place[:, 2] - place[:, 0]
        excess = way[:, 2] ** 2 - np.einsum("ij,ij->i", chord, chord)
        straight -= 0.5 * np.sqrt(np.maximum(excess, 0.0))
    low = np.maximum(ball, straight - wanted)
    return low, slack, 0.5 * (places[0][:, 1] + places[1][:, 1])


def _segment_distance(a0: Array, a1: Array, b0: Array, b1: Array) -> Array:
    """Return the distances (m,) between segments a0-a1 and b0-b1, ends (m, 2) each."""
    ends = [
        _point_distance(a0, b0, b1),
        _point_distance(a1, b0, b1),
        _point_distance(b0, a0, a1),
        _point_distance(b1, a0, a1),
    ]
    a, b = a1 - a0, b1 - b0
    across = (_cross(a, b0 - a0) * _cross(a, b1 - a0) < 0.0) & (
        _cross(b, a0 - b0) * _cross(b, a1 - b0) < 0.0
    )
    return np.where(across, 0.0, np.minimum.reduce(ends))


def _point_distance(point: Array, start: Array, end: Array) -> Array:
    """Return the distances (m,) from points to segments, (m, 2) each."""
    leg, to_point = end - start, point - start
    square = np.einsum("ij,ij->i", leg, leg)
    part = np.einsum("ij,ij->i", leg, to_point) / np.where(square > 0.0, square, 1.0)
    miss = to_point - np.clip(part, 0.0, 1.0)[:, None] * leg
    return np.asarray(np.hypot(miss[:, 0], miss[:, 1]))


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _distinct(keys: Indices) -> tuple[Indices, Indices]:
    """Return the sorted distinct keys, and for each key its place among them."""
    highest = int(keys.max()) + 1
    if highest > 4 * len(keys):
        return np.unique(keys, return_inverse=True)
    used = np.zeros(highest, dtype=np.bool_)
    used[keys] = True
    return np.flatnonzero(used), (np.cumsum(used) - 1)[keys]
