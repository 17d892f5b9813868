"""The least distance of two moving robots over all times no more than tau apart.

Branch and bound over boxes of (t, t'): within a block of time a robot stays in a ball around its
middle place, with the arc length it covers on either side as radius; this bounds distances from
below without any sampling.

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

    def balls(self, block: Indices, size: float) -> tuple[Array, Array]:
        """Return a ball (centre (m, 2), radius (m,)) around the robot in each block of time.

        Block k is the interval [k, k + 1] * size; the centre is the place at its middle.
        """
        arcs = [self.arc(np.asarray((block + part) * size)) for part in (0.0, 0.5, 1.0)]
        radius = np.maximum(arcs[1] - arcs[0], arcs[2] - arcs[1])
        return self.driven.curve.at_arc(arcs[1]), radius


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
    """Return per box a lower bound, the slack at its middle, and the place between the robots."""
    centers, radii = [], []
    for robot, block in ((boxes.a, boxes.p), (boxes.b, boxes.q)):
        width = int(block.max()) + 1
        key, inverse = _distinct(robot * width + block)
        center, radius = np.empty((len(key), 2)), np.empty(len(key))
        owner = key // width
        borders = np.searchsorted(owner, np.arange(len(flights) + 1))
        for index, (first, end) in enumerate(pairwise(borders.tolist())):
            if first < end:
                balls = flights[index].balls(key[first:end] - index * width, size)
                center[first:end], radius[first:end] = balls
        centers.append(center[inverse])
        radii.append(radius[inverse])
    apart = centers[0] - centers[1]
    slack = np.hypot(apart[:, 0], apart[:, 1]) - need[boxes.a, boxes.b]
    return slack - radii[0] - radii[1], slack, 0.5 * (centers[0] + centers[1])


def _distinct(keys: Indices) -> tuple[Indices, Indices]:
    """Return the sorted distinct keys, and for each key its place among them."""
    highest = int(keys.max()) + 1
    if highest > 4 * len(keys):
        return np.unique(keys, return_inverse=True)
    used = np.zeros(highest, dtype=np.bool_)
    used[keys] = True
    return np.flatnonzero(used), (np.cumsum(used) - 1)[keys]
