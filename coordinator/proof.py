"""The proof that a plan is tau-safe, from the decoded wire bytes alone.

For every pair and all |t - t'| <= tau the centres stay r_i + r_j + margin apart; every curve keeps
margin + radius from everything solid; the motion keeps the robot's limits.  Branch and bound over
boxes of (t, t'): on a time interval a robot stays within the arc length that it covers of its
middle place, which bounds distances from below without any sampling.  Bounds are certified to
RESOLUTION; a shortfall below TOLERANCE is accepted, so rounding never refuses a valid plan.

Decides: whether a plan may leave the coordinator.  Shares nothing with zones.py, waiting.py and
schedule.py but the evaluation of curves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Final

import numpy as np
import numpy.typing as npt

from coordinator.budget import Budget
from coordinator.nurbs import Array
from coordinator.plan import Limits, Proof
from coordinator.wire import Driven

RESOLUTION: Final = 2.5e-4
"""Least values are exact up to this [m]."""

TOLERANCE: Final = 1e-3
"""A shortfall up to this [m] is accepted."""

_BLOCK: Final = 0.5
_STRETCH: Final = 0.25

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
    """The least slack [m] and where it is met: robots (indices), plan times [s], place [m]."""

    slack: float
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
        key, inverse = np.unique(robot << 40 | block, return_inverse=True)
        center, radius = np.empty((len(key), 2)), np.empty(len(key))
        owner = key >> 40
        for index in np.unique(owner).tolist():
            mine = owner == index
            balls = flights[index].balls(key[mine] & (1 << 40) - 1, size)
            center[mine], radius[mine] = balls
        centers.append(center[inverse])
        radii.append(radius[inverse])
    apart = centers[0] - centers[1]
    slack = np.hypot(apart[:, 0], apart[:, 1]) - need[boxes.a, boxes.b]
    return slack - radii[0] - radii[1], slack, 0.5 * (centers[0] + centers[1])


def least_clearance(
    driven: Sequence[Driven], distance: Callable[[Array], Array]
) -> tuple[float, int, float]:
    """Return the least distance to anything solid beyond the radius [m], the robot, s [m].

    `distance` gives for points (m, 2) the distance to the nearest solid thing (m,).
    """
    best, best_robot, best_s = math.inf, 0, 0.0
    size = _STRETCH
    robot = np.concatenate(
        [np.full(math.ceil(d.curve.length / size), i) for i, d in enumerate(driven)]
    )
    cell = np.concatenate([np.arange(math.ceil(d.curve.length / size)) for d in driven])
    while len(cell):
        places = np.empty((len(cell), 2))
        radius = np.array([d.radius for d in driven])[robot]
        middle = (cell + 0.5) * size
        for index in np.unique(robot).tolist():
            mine = robot == index
            places[mine] = driven[index].curve.at_arc(middle[mine])
        clearance = distance(places) - radius
        at = int(np.argmin(clearance))
        if clearance[at] < best:
            best, best_robot, best_s = float(clearance[at]), int(robot[at]), float(middle[at])
        keep = clearance - 0.5 * size < best - RESOLUTION
        robot = np.repeat(robot[keep], 2)
        cell = np.concatenate([2 * cell[keep, None], 2 * cell[keep, None] + 1], axis=1).ravel()
        size *= 0.5
    return best, best_robot, best_s


def limit_failures(driven: Driven, limits: Limits) -> list[str]:
    """Return how a motion breaks the robot's limits, one sentence each; 1 % is tolerated.

    Curvature is sampled 64 times a knot span.
    """
    line, curve, failures = driven.timeline, driven.curve, []
    v0, v1 = np.array(line.v0), np.array(line.v1)
    if max(v0.max(), v1.max()) > limits.max_speed * 1.0001:
        failures.append(f"{driven.id} drives faster than {limits.max_speed} m/s")
    length = np.array(line.s1) - np.array(line.s0) + 1e-5
    rate = np.abs(v1**2 - v0**2) / (2.0 * length)
    if limits.max_accel is not None:
        if rate.max() > limits.max_accel * 1.01:
            failures.append(f"{driven.id} changes speed faster than {limits.max_accel} m/s^2")
        if v0[0] > 1e-6 or v1[-1] > 1e-6:
            failures.append(f"{driven.id} does not begin and end at rest")
    spans = np.unique(curve.knots)
    u = np.concatenate([np.linspace(a, b, 64) for a, b in pairwise(spans)])
    bend = np.abs(curve.curvature(u))
    if limits.max_lateral_accel is not None:
        s = curve.arc_at(u)
        leg = np.clip(np.searchsorted(line.s0, s, side="right") - 1, 0, len(v0) - 1)
        part = np.clip((s - np.array(line.s0)[leg]) / length[leg], 0.0, 1.0)
        square = v0[leg] ** 2 + part * (v1[leg] ** 2 - v0[leg] ** 2)
        if np.max(square * bend) > limits.max_lateral_accel * 1.02:
            failures.append(f"{driven.id} takes a bend above {limits.max_lateral_accel} m/s^2")
    if limits.min_turn_radius > 0.0 and bend.max() * limits.min_turn_radius > 1.01:
        failures.append(f"{driven.id} turns tighter than {limits.min_turn_radius} m")
    return failures


def prove(
    driven: Sequence[Driven],
    tau: float,
    margin: float,
    distance: Callable[[Array], Array] | None,
    limits: Sequence[Limits | None],
    budget: Budget | None,
) -> Proof:
    """Prove a plan; tau [s], margin [m].

    Without `distance` (no floor known) clearance is not proven and None is reported.
    """
    failures: list[str] = []
    flights = [Flight(one) for one in driven]
    radii = np.array([one.radius for one in driven])
    need = radii[:, None] + radii + margin
    tightest = least_slack(flights, tau, need)
    apart = least_slack(flights, tau, np.zeros_like(need))
    text = "" if tightest is None else _say(tightest, driven, need)
    if tightest is not None and tightest.slack < -TOLERANCE:
        failures += _failing_pairs(flights, tau, need, driven)
    clearance = None
    if distance is not None:
        clearance, robot, s = least_clearance(driven, distance)
        if clearance < margin - TOLERANCE:
            failures.append(
                f"{driven[robot].id} comes within {clearance:.4f} m of something solid "
                f"at s = {s:.3f} m, needs {margin} m"
            )
    for one, limit in zip(driven, limits, strict=True):
        failures += [] if limit is None else limit_failures(one, limit)
    return Proof(
        holds=not failures,
        pairs=len(driven) * (len(driven) - 1) // 2,
        least_separation=None if apart is None else round(apart.slack, 6),
        least_clearance=None if clearance is None else round(clearance, 6),
        survives=[] if budget is None or failures else budget.survives(tau),
        tightest=text,
        failures=failures,
    )


def _failing_pairs(
    flights: Sequence[Flight], tau: float, need: Array, driven: Sequence[Driven]
) -> list[str]:
    """Say for every pair that comes too near where it does so most."""
    failures = []
    for a, b in combinations(range(len(flights)), 2):
        pair = [flights[a], flights[b]]
        closest = least_slack(pair, tau, need[np.ix_((a, b), (a, b))])
        if closest is not None and closest.slack < -TOLERANCE:
            failures.append(_say(closest, [driven[a], driven[b]], need[np.ix_((a, b), (a, b))]))
    return failures


def _say(closest: Closest, driven: Sequence[Driven], need: Array) -> str:
    a, b = driven[closest.a].id, driven[closest.b].id
    wanted = float(need[closest.a, closest.b])
    apart = closest.slack + wanted
    return (
        f"{a} at {closest.t_a:.2f} s and {b} at {closest.t_b:.2f} s are {apart:.4f} m apart "
        f"near ({closest.x:.2f}, {closest.y:.2f}), need {wanted:.4f} m"
    )
