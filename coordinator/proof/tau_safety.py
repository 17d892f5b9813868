"""The proof that a plan is tau-safe, from the decoded wire bytes alone.

For every pair and all |t - t'| <= tau the centres stay r_i + r_j + margin apart; every curve stays
margin + radius away from everything solid; the motion obeys the robot's limits.  Distances are
certified to RESOLUTION, without any sampling (separation.py, curves/bounds.py, limits.py).  A
shortfall below TOLERANCE is accepted, so that rounding never refuses a valid plan.  RESOLUTION,
TOLERANCE and the deviation that the messages allow robots are shares of the margin
(scenario/margin.py); the proof fails if these shares exceed the margin.

Decides: whether a plan may leave the coordinator.  The only code that the proof shares with zones,
schedule and motion is the evaluation of curves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from coordinator.curves.nurbs import Array
from coordinator.plan.document import Limits, Proof
from coordinator.plan.shares_of_tau import survived
from coordinator.plan.wire import Driven
from coordinator.proof.limits import limit_failures
from coordinator.proof.motion_pieces import Flights
from coordinator.proof.separation import Closest, Separation
from coordinator.scenario.margin import TOLERANCE, beside_solid, between_robots

_PLACE: Final = 0.05
"""Step [m] in which the place where a path comes too near to something solid is located."""

_MOST_SAID: Final = 20
"""Greatest number of pairs that a proof lists one by one as too near; the others are counted."""

Gap = Callable[[Array], float]


def least_clearance(driven: Sequence[Driven], gap: Gap) -> tuple[float, int]:
    """Return the least clearance beyond the radius [m], and the index of the robot that has it.

    `gap` returns the distance [m] from a polyline (n, 2) to the nearest solid thing.  The proven
    deviation of a curve from its polyline is subtracted: the true least clearance is not smaller,
    and larger by at most 2 * FLAT.
    """
    least = clearances(driven, gap)
    robot = int(np.argmin(least))
    return least[robot], robot


def clearances(driven: Sequence[Driven], gap: Gap) -> list[float]:
    """Return every robot's clearance [m], computed as in `least_clearance`."""
    return [gap(one.chain.points) - one.chain.bound - one.radius for one in driven]


def _say_clearance(driven: Driven, clearance: float, margin: float, gap: Gap) -> str:
    """Return a sentence that says where a curve is too near to something solid."""
    chords = list(pairwise(driven.chain.points))
    begin, end = chords[int(np.argmin([gap(np.array(chord)) for chord in chords]))]
    part = np.linspace(0.0, 1.0, 2 + int(math.dist(begin, end) / _PLACE))[:, None]
    places = begin + part * (end - begin)
    x, y = places[int(np.argmin([gap(np.stack((place, place))) for place in places]))]
    if clearance <= -driven.radius:
        return f"{driven.id}'s way leads through something solid near ({x:.2f}, {y:.2f})"
    return (
        f"{driven.id} comes within {clearance:.4f} m of something solid near ({x:.2f}, {y:.2f}), "
        f"needs {margin} m"
    )


def prove(
    driven: Sequence[Driven],
    tau: float,
    margin: float,
    gap: Gap | None,
    limits: Sequence[Limits | None],
) -> Proof:
    """Prove a plan; tau [s], margin [m].

    `limits` has one entry per robot, None if not known.  Without `gap` (no floor known) the
    clearance is not proven and is None in the proof.
    """
    apart = prove_separation(Flights(driven), tau, margin)
    failures = [*_say_shares(driven, margin), *apart.failures]
    clearance = None
    if gap is not None:
        each = clearances(driven, gap)
        clearance = min(each)
        failures += [
            _say_clearance(one, least, margin, gap)
            for one, least in zip(driven, each, strict=True)
            if least < margin - TOLERANCE or least <= -one.radius
        ]
    for one, limit in zip(driven, limits, strict=True):
        failures += [] if limit is None else limit_failures(one, limit)
    return Proof(
        holds=not failures,
        pairs=len(driven) * (len(driven) - 1) // 2,
        least_separation=apart.separation,
        least_slack=apart.slack,
        least_clearance=None if clearance is None else round(clearance, 6),
        survives=[] if failures or None in limits else survived(tau),
        tightest=apart.tightest,
        failures=failures,
    )


def _say_shares(driven: Sequence[Driven], margin: float) -> list[str]:
    """Return a sentence if the shares of the margin [m] exceed it: robots may deviate too far."""
    *_, most = by_track = sorted(driven, key=lambda one: one.plan.track_mm)
    shares, who = beside_solid(most.plan.track_mm), f"{most.id} {most.plan.track_mm} mm"
    if len(driven) > 1:
        other = by_track[-2]
        shares = between_robots(other.plan.track_mm, most.plan.track_mm)
        who = f"{other.id} {other.plan.track_mm} mm, {who}"
    if shares.total <= margin:
        return []
    rest = 1000.0 * (shares.proof + shares.arcs)
    return [
        f"the margin is {margin:g} m, but must cover {shares.total:g} m: how far robots may be "
        f"from their places ({who}), and {rest:g} mm for the proof and robots' arc lengths"
    ]


class Apart(NamedTuple):
    """Least centre distance and least slack [m], a sentence on the tightest pair, and failures."""

    separation: float | None
    slack: float | None
    tightest: str
    failures: list[str]


def separation_failures(flights: Flights, tau: float, margin: float) -> list[str]:
    """Return a sentence for each pair that comes too near.

    The need and tau are those of `prove_separation`.
    """
    driven = flights.driven
    keep = np.array([one.radius for one in driven]) + 0.5 * margin
    return _say_failing(Separation(flights, tau).below(keep, -TOLERANCE), driven, keep)


def prove_separation(flights: Flights, tau: float, margin: float) -> Apart:
    """Prove that all pairs keep r_i + r_j + margin [m] at times no more than tau [s] apart."""
    driven = flights.driven
    radii = np.array([one.radius for one in driven])
    keep = radii + 0.5 * margin
    fleet = Separation(flights, tau)
    tightest = fleet.least(keep)
    if tightest is None:
        return Apart(None, None, "", [])
    nearest, text = tightest, _say(tightest, driven, keep)
    if np.ptp(radii) > 0.0:
        nearest = fleet.least(np.zeros(len(driven)), tightest.distance) or tightest
        if (nearest.a, nearest.b) != (tightest.a, tightest.b):
            text += f"; the least separation is another pair's: {_say(nearest, driven, keep)}"
    failures = []
    if tightest.slack < -TOLERANCE:
        failures = _say_failing(fleet.below(keep, -TOLERANCE), driven, keep)
    return Apart(round(nearest.distance, 6), round(tightest.slack, 6), text, failures)


def _say_failing(failing: Sequence[Closest], driven: Sequence[Driven], keep: Array) -> list[str]:
    """Return a sentence for each pair that comes too near, at its worst place, worst pair first."""
    said = [_say(closest, driven, keep) for closest in failing[:_MOST_SAID]]
    more = len(failing) - len(said)
    return [*said, f"and {more} more pairs come too near"] if more else said


def _say(closest: Closest, driven: Sequence[Driven], keep: Array) -> str:
    a, b = driven[closest.a].id, driven[closest.b].id
    need = keep[closest.a] + keep[closest.b]
    return (
        f"{a} at {closest.t_a:.2f} s and {b} at {closest.t_b:.2f} s are {closest.distance:.4f} m "
        f"apart near ({closest.x:.2f}, {closest.y:.2f}), need {need:.4f} m"
    )
