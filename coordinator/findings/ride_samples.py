"""Samples one robot's part in one epoch over time, quickly, for summaries of logs.

Decides: how finely a path is sampled.  Must not know: logs, messages' bytes, the planner and its
compiled kernels, which take longer to load than it takes to read a log.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from coordinator.findings.braking import Driving
from coordinator.plan.document import RobotPlan
from protocol.messages import Plan
from protocol.plan_parts import unpack_plan
from protocol.timeline import Timeline

Array = np.ndarray[tuple[int, ...], np.dtype[np.float64]]

_STEP: Final = 0.02
_MOST_TIMES: Final = 2_000

_SAMPLES: Final = 2_000
_PER_KNOT: Final = 20
"""The least number of samples of a path, and the number for each of its knots."""


@dataclass(frozen=True, eq=False)
class RideSamples:
    """A path as a polyline and the motion along it; plan times [s], arc lengths [m].

    arcs (m,), places (m, 2): the path.
    `brake_rate`: the robot's deceleration [m/s^2].  `driving`: how it drove; None: by its plan.
    """

    line: Timeline
    arcs: Array
    places: Array
    brake_rate: float
    driving: Driving | None = None

    def driven(self, driving: Driving) -> RideSamples:
        """Return the ride as it was driven."""
        return replace(self, driving=driving)

    def arcs_at(self, times: Array) -> Array:
        """Return where along its path the plan has the robot at plan times (n,)."""
        return arcs_on(self.line, times)

    def driven_at(self, times: Array) -> Array:
        """Return how far along its path the robot was at plan times (n,), its braking included."""
        if self.driving is None:
            return self.arcs_at(times)
        progress, brake, rate = self.driving
        passed = progress.at(times)
        s = self.arcs_at(np.minimum(passed, brake))
        if math.isfinite(brake) and rate > 0.0:
            speed = self.line.v_at(brake)
            slowing = np.clip(passed - brake, 0.0, speed / rate)
            s = s + slowing * (speed - 0.5 * rate * slowing)
        return s

    def places_at(self, s: Array) -> Array:
        """Return the places (n, 2) at arc lengths (n,)."""
        return np.column_stack([np.interp(s, self.arcs, self.places[:, i]) for i in (0, 1)])


def arcs_on(line: Timeline, times: Array) -> Array:
    """Return where along its path [m] a motion has its robot at plan times (n,) [s]."""
    t0, t1 = np.array(line.t0), np.array(line.t1)
    leg = np.maximum(np.searchsorted(t0, times, side="right") - 1, 0)
    long = t1 - t0
    rates = (np.array(line.v1) - np.array(line.v0)) / long
    passed = np.clip(times - t0[leg], 0.0, long[leg])
    by_leg = np.array(line.v0)[leg] + 0.5 * rates[leg] * passed
    return np.asarray(np.array(line.s0)[leg] + passed * by_leg)


def times_between(begin: float, end: float) -> Array:
    """Return the sample times from `begin` to `end` [s]."""
    count = min(2 + int(max(end - begin, 0.0) / _STEP), _MOST_TIMES)
    return np.linspace(begin, max(end, begin + _STEP), count)


def ride_of_message(plan: Plan) -> RideSamples:
    """Return the ride that a Plan message describes; raise ValueError if the message is invalid."""
    parts = unpack_plan(plan)
    return _ride(parts.path, parts.motion, plan.brake_mmps2 / 1000.0)


def ride_of_plan(robot: RobotPlan) -> RideSamples:
    """Return the ride that a plan document describes; raise ValueError if it is invalid."""
    path = robot.path
    xs, ys = zip(*path.control_points, strict=True)
    rests = [(stop.s, stop.depart) for stop in robot.stops]
    if robot.start_time > 0.0:
        rests.insert(0, (0.0, robot.start_time))
    motion = (
        [s for s, _ in robot.profile],
        [v for _, v in robot.profile],
        [s for s, _ in rests],
        [depart for _, depart in rests],
        0.0,
    )
    return _ride((path.degree, path.knots, xs, ys, path.weights), motion, 0.0)


def _ride(
    path: tuple[int, Sequence[float], Sequence[float], Sequence[float], Sequence[float]],
    motion: tuple[list[float], list[float], list[float], list[float], float],
    rate: float,
) -> RideSamples:
    line = Timeline(*motion)
    degree, knots, xs, ys, weights = path
    if len(xs) <= degree or len(knots) != len(xs) + degree + 1 or not knots[-1] > knots[0]:
        raise ValueError("the path is not a curve")
    places = _places(degree, np.array(knots), np.column_stack((xs, ys)), np.array(weights))
    arcs = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(places, axis=0).T))))
    if not (np.isfinite(arcs).all() and arcs[-1] > 0.0):
        raise ValueError("the path has no length")
    return RideSamples(line, arcs * (line.length / arcs[-1]), places, rate)


def _places(degree: int, knots: Array, points: Array, weights: Array) -> Array:
    """Return samples (m, 2) of a curve, its knots included, all by de Boor's algorithm at once."""
    count = max(_SAMPLES, _PER_KNOT * len(knots))
    u = np.union1d(np.linspace(knots[0], knots[-1], count), knots)
    span = np.clip(np.searchsorted(knots, u, side="right") - 1, degree, len(points) - 1)
    lifted = np.column_stack((points * weights[:, None], weights))
    rows = lifted[span[:, None] + np.arange(-degree, 1)]
    for level in range(1, degree + 1):
        for j in range(degree, level - 1, -1):
            low = knots[span - degree + j]
            high = knots[span + j - level + 1]
            part = ((u - low) / (high - low))[:, None]
            rows[:, j] = (1.0 - part) * rows[:, j - 1] + part * rows[:, j]
    return np.asarray(rows[:, degree, :2] / rows[:, degree, 2:])
