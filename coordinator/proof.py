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

from collections.abc import Callable, Sequence
from itertools import combinations, pairwise
from typing import Final

import numpy as np

from coordinator.bounds import flatten
from coordinator.budget import Budget
from coordinator.nurbs import Array
from coordinator.plan import Limits, Proof
from coordinator.separation import Closest, Flight, least_slack
from coordinator.wire import Driven

TOLERANCE: Final = 1e-3
"""A shortfall up to this [m] is accepted."""

_FLAT: Final = 2e-4
"""Curves are flattened this finely [m] to prove their clearance."""

Gap = Callable[[Array], float]


def least_clearance(driven: Sequence[Driven], gap: Gap) -> tuple[float, int]:
    """Return the least distance to anything solid beyond the radius [m], and whose it is.

    `gap` tells the distance [m] from a polyline (n, 2) to the nearest solid thing.  Each curve is
    flattened with a proven deviation, which is taken off: the true least clearance is not smaller,
    and larger by at most 2 * _FLAT.
    """
    least = []
    for one in driven:
        chain = flatten(one.curve, _FLAT)
        least.append(gap(chain.points) - chain.bound - one.radius)
    robot = int(np.argmin(least))
    return least[robot], robot


def _say_clearance(driven: Driven, clearance: float, margin: float, gap: Gap) -> str:
    """Say where a curve is too near to something solid."""
    points = flatten(driven.curve, _FLAT).points
    nearest = int(np.argmin([gap(np.array(chord)) for chord in pairwise(points)]))
    x, y = points[nearest]
    return (
        f"{driven.id} comes within {clearance:.4f} m of something solid near ({x:.2f}, {y:.2f}), "
        f"needs {margin} m"
    )


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
        whole = np.maximum(np.array(line.s1) - np.array(line.s0), 1e-9)
        part = np.clip((s - np.array(line.s0)[leg]) / whole[leg], 0.0, 1.0)
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
    gap: Gap | None,
    limits: Sequence[Limits | None],
    budget: Budget | None,
) -> Proof:
    """Prove a plan; tau [s], margin [m].

    Without `gap` (no floor known) clearance is not proven and None is reported.
    """
    failures: list[str] = []
    flights = [Flight(one) for one in driven]
    radii = np.array([one.radius for one in driven])
    need = radii[:, None] + radii + margin
    tightest = least_slack(flights, tau, need)
    apart = least_slack(flights, tau, np.zeros_like(need)) if np.ptp(radii) > 0.0 else tightest
    text = "" if tightest is None else _say(tightest, driven, need)
    if tightest is not None and tightest.slack < -TOLERANCE:
        failures += _failing_pairs(flights, tau, need, driven)
    clearance = None
    if gap is not None:
        clearance, robot = least_clearance(driven, gap)
        if clearance < margin - TOLERANCE:
            failures.append(_say_clearance(driven[robot], clearance, margin, gap))
    for one, limit in zip(driven, limits, strict=True):
        failures += [] if limit is None else limit_failures(one, limit)
    return Proof(
        holds=not failures,
        pairs=len(driven) * (len(driven) - 1) // 2,
        least_separation=None if apart is None else round(apart.distance, 6),
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
