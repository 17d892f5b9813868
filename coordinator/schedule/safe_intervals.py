"""The earliest motion, with waits, of one robot among others whose motions are known.

Decides: where and until when one robot waits.  Must not know: who should go first
(priority_order.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from coordinator.motion.velocity_profile import Motion, Wait
from coordinator.schedule.conflict_zones import Indices
from coordinator.schedule.forbidden_interval_kernels import BOTH, FIRST, forbid
from coordinator.schedule.junctions import FEW, Junctions
from coordinator.schedule.safe_interval_kernels import (
    DEPARTURE,
    Approach,
    Departure,
    search,
    search_among,
)
from coordinator.schedule.timetable import Motions
from coordinator.schedule.waiting_kernels import PLACE, ForbiddenTimes


@dataclass(frozen=True)
class Begun:
    """The fixed part of a motion under way: its earlier rests, and its last rest, at s [m].

    The robot leaves the last rest between `release` and `leave_by` [s], and may stop again only
    after the place `beyond` [m].  What zones forbid up to the place `settled` [m] does not count.
    """

    waits: tuple[Wait, ...]
    s: float
    release: float
    leave_by: float
    beyond: float
    settled: float = 0.0


ANY_TIME: Final = Departure(0.0, math.inf)

_EARLIER: Final = 0.02
"""A robot may wait in a zone that others have yet to pass if it arrives earlier by this [s]."""


def earliest_motion(
    junctions: Junctions,
    motions: Motions,
    index: int,
    modes: Indices | None = None,
    departure: Departure = ANY_TIME,
    latest: float = math.inf,
    anywhere: bool = True,
    quickest: bool = False,
) -> Motion | None:
    """Return a robot's earliest motion among the known motions of others; None if there is none.

    The robot waits where it cannot block anybody, outside of zones that others have yet to pass.
    With `anywhere` it may wait inside of them if there is no other way, or if that is quicker in a
    small fleet; if `quickest` is set, always.  modes (zones,): what each of its zones demands
    (forbidden_interval_kernels.py); by default BOTH if the other robot has a motion, FIRST if it
    has none.  The robot has to arrive before `latest` [s].
    """
    few = len(junctions.tracks) <= FEW
    manners = (False,) if quickest else (True, False) if anywhere else (True,)
    arrival, waits = math.inf, list[Wait]()
    for polite in manners:
        if arrival == math.inf or few:
            approach = junctions.approach(index, few or not polite)
            if not polite:
                departure = departure._replace(latest=min(arrival - _EARLIER, latest))
            other = _waits(junctions, motions, index, approach, modes, departure, polite)
            if other[0] < arrival - _EARLIER:
                arrival, waits = other
            if arrival < departure.release + float(approach.rest[0]) + _EARLIER:
                break  # no other places to wait at can save _EARLIER
    return Motion(junctions.tracks[index].limits, waits) if arrival < latest else None


def _waits(
    junctions: Junctions,
    motions: Motions,
    index: int,
    approach: Approach,
    modes: Indices | None,
    departure: Departure,
    polite: bool,
) -> tuple[float, list[Wait]]:
    """Return when the robot arrives [s], infinite if never, and its waits."""
    if modes is None:
        modes = np.where(motions.placed[approach.rows.other], BOTH, FIRST)
    rests, arrival = search_among(approach, modes, motions.table, junctions.tau, departure, polite)
    return float(arrival), _as_waits(junctions, index, approach, rests)


def rest_of_motion(
    junctions: Junctions, motions: Motions, index: int, begun: Begun, modes: Indices
) -> Motion | None:
    """Return the earliest motion that completes a begun one; None if there is none.

    modes (m,): the order that each of the robot's zones demands.
    """
    for polite in (True, False):
        approach = junctions.approach_from(index, begun.s, begun.beyond, anywhere=not polite)
        track, rows, known = junctions.tracks[index], approach.rows, approach.known
        low, high = forbid(rows, modes, motions.table, track.elapsed, junctions.tau, known)
        past = rows.cell <= track.cell_at(max(begun.s, begun.settled))
        begin = np.where(past, math.inf, known.begin)
        forbidden = ForbiddenTimes(
            rows.first, rows.cell, begin, known.end, low, high, approach.span
        )
        departure = Departure(begun.release, begun.leave_by)
        rests, arrival = search(approach.ride, forbidden, approach.rest, departure, polite)
        if arrival < math.inf:
            found = _as_waits(junctions, index, approach, rests)
            if begun.s > 0.0 and (not found or found[0].s > begun.s):
                depart = float(rests[0, DEPARTURE])
                found.insert(0, Wait(begun.s, depart, -1))
            return Motion(track.limits, [*begun.waits, *found])
    return None


def _as_waits(
    junctions: Junctions, index: int, approach: Approach, rests: npt.NDArray[np.float64]
) -> list[Wait]:
    """Return the rests that the search found as waits, without those that nothing requires."""
    waits: list[Wait] = []
    zones, other = junctions.zones_of(index), approach.rows.other
    for station, depart, zone in rests.tolist():
        s, k = float(approach.ride.stations[int(station), PLACE]), int(zone)
        owner = (int(other[k]), int(zones[k])) if k >= 0 else (-1, -1)
        at_rest = s > 0.0 and not approach.ride.at_once
        if at_rest or k >= 0 or (s <= 0.0 and depart > 0.0):
            waits.append(Wait(s, depart, *owner))
    return waits
