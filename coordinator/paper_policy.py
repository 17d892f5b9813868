"""Algorithm 2 of the paper as printed: one stop of fixed length at each crossing, pair by pair.

For comparison only.  It adds T for every earlier stop of a robot, also for stops that lie behind
the crossing in question, and it knows neither widths nor new conflicts that a stop creates; its
plans are proven like any other, and mostly the proof fails.  docs/paper.md lists the errata.
Decides: who stops at which crossing.  Must not know: zones and waits (schedule.py).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

from coordinator.crossings import find_crossings
from coordinator.motion import Motion, SpeedLimits, Wait
from coordinator.nurbs import Nurbs
from coordinator.scenario import Scenario


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


def algorithm_2(encounters: Iterable[Encounter], stop_time: float, tau: float) -> list[Verdict]:
    """Run Algorithm 2 over crossings in the order given; stop_time T and tau in seconds."""
    stopped: dict[int, int] = {}
    verdicts = []
    for at in encounters:
        t_i = at.d_i / at.v_i + stop_time * stopped.get(at.i, 0)
        t_p = at.d_p / at.v_p + stop_time * stopped.get(at.p, 0)
        loser = None
        if abs(t_i - t_p) <= tau:
            loser = at.i if at.v_p >= at.v_i else at.p
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
        at = verdict.encounter
        if verdict.stops is None:
            continue
        distance, winner = (at.d_i, at.p) if verdict.stops == at.i else (at.d_p, at.i)
        before = scenario.need(scenario.robots[at.i], scenario.robots[at.p])
        stops[verdict.stops].append((max(distance - before, 0.0), winner))
    return [
        _with_stops(limits[index], places, scenario.stop_time) for index, places in enumerate(stops)
    ]


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
