"""Algorithm 2 of the paper as printed: one stop of fixed length at each crossing, pair by pair.

For comparison only.  It adds T for every earlier stop of a robot, also for stops that lie behind
the crossing in question, and it accounts neither for widths nor for new conflicts that a stop
creates.  Its plans are proven like all others, and the proof usually fails.  docs/paper.md lists
the errata.

Decides: who stops at which crossing.  Must not know: zones and waits (priority_order.py).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np
import shapely

from coordinator.curves.nurbs import Nurbs
from coordinator.motion.velocity_profile import Motion, SpeedLimits, Wait
from coordinator.plan.crossings import find_crossings
from coordinator.scenario.model import Scenario

_STEP: Final = 0.01
"""Step [m] of the search for places to stop."""


@dataclass(frozen=True)
class Encounter:
    """One row of Table 1: robots i and p with arc lengths d [m] to the crossing and speeds."""

    i: int
    p: int
    d_i: float
    d_p: float
    v_i: float
    v_p: float


@dataclass(frozen=True)
class Verdict:
    """What Algorithm 2 decides at one crossing; times [s] corrected for earlier stops."""

    encounter: Encounter
    t_i: float
    t_p: float
    stops: int | None
    """The robot that stops for T before the crossing, or None."""


def algorithm_2(
    encounters: Iterable[Encounter], stop_time: float, tau: float, *, slower_first: bool = False
) -> list[Verdict]:
    """Run Algorithm 2 over crossings in the order given; stop_time T and tau in seconds.

    `slower_first` reverses its priority: Table 1 stops the faster robot, Algorithm 2 the slower.
    """
    stopped: dict[int, int] = {}
    verdicts = []
    for at in encounters:
        t_i = at.d_i / at.v_i + stop_time * stopped.get(at.i, 0)
        t_p = at.d_p / at.v_p + stop_time * stopped.get(at.p, 0)
        loser = None
        if abs(t_i - t_p) <= tau:
            i_yields = at.v_p <= at.v_i if slower_first else at.v_p >= at.v_i
            loser = at.i if i_yields else at.p
            stopped[loser] = stopped.get(loser, 0) + 1
        verdicts.append(Verdict(at, t_i, t_p, loser))
    return verdicts


def schedule(
    scenario: Scenario, paths: Sequence[Nurbs], limits: Sequence[SpeedLimits], tau: float
) -> list[Motion]:
    """Return the motions of Algorithm 2: the loser rests T at R_ip-b, before the zone."""
    encounters = []
    for i, p in combinations(range(len(paths)), 2):
        for meeting in find_crossings(paths[i], paths[p]):
            speeds = [limits[index].top ** 0.5 for index in (i, p)]
            encounters.append(Encounter(i, p, meeting.s_a, meeting.s_b, speeds[0], speeds[1]))
    stops: list[list[tuple[float, int]]] = [[] for _ in paths]
    for verdict in algorithm_2(encounters, scenario.stop_time, tau):
        at, loser = verdict.encounter, verdict.stops
        if loser is None:
            continue
        distance, winner = (at.d_i, at.p) if loser == at.i else (at.d_p, at.i)
        need = scenario.need(scenario.robots[loser], scenario.robots[winner])
        place = _place_before(paths[loser], paths[winner], distance, need)
        stops[loser].append((place, winner))
    return [
        _with_stops(limits[index], places, scenario.stop_time) for index, places in enumerate(stops)
    ]


def _place_before(path: Nurbs, other: Nurbs, s: float, need: float) -> float:
    """Return the last place before s that is `need` away from the other's path, else 0; all [m].

    The paper does not fix b: the robot only has to stop outside of the collision zone.
    """
    line = shapely.linestrings(other.at_arc(np.arange(0.0, other.length + _STEP, _STEP)))
    back = np.arange(s, 0.0, -_STEP)
    far = shapely.distance(shapely.points(path.at_arc(back)), line) >= need + _STEP
    return float(back[np.argmax(far)]) if far.any() else 0.0


def _with_stops(limits: SpeedLimits, places: list[tuple[float, int]], stop_time: float) -> Motion:
    """Return the motion that rests for stop_time [s] at each place, in order of the path."""
    waits: list[Wait] = []
    for s, owner in sorted(places):
        if waits and s - waits[-1].s < 1e-3:
            waits[-1] = Wait(waits[-1].s, waits[-1].depart + stop_time, owner)
            continue
        arrival = Motion(limits, [*waits, Wait(s, 0.0, owner)]).arrivals[-1] if s > 0.0 else 0.0
        waits.append(Wait(s, arrival + stop_time, owner))
    return Motion(limits, waits)
