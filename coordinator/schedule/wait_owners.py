"""The robot that each wait is for, found once all motions are known.

The search for a robot's waits names the robot that forbids the last moment of a wait.  Another
robot may force most of the wait, at the zone before which the waiting robot stands.

Decides: which robot and which zone are named as the reason of a wait.  Must not know: how
waits are found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from coordinator.curves.nurbs import Array
from coordinator.motion.velocity_profile import Motion, Wait
from coordinator.schedule.conflict_zones import Indices
from coordinator.schedule.forbidden_interval_kernels import BOTH, forbid
from coordinator.schedule.junctions import Junctions
from coordinator.schedule.timetable import Motions
from coordinator.schedule.waiting_kernels import Closed, ForbiddenTimes, closed_departures

_MOST: Final = 0.5
"""A zone that forbids this share of a wait explains it."""


def with_owners(
    junctions: Junctions, motions: Sequence[Motion], all_waits: bool = False
) -> list[Motion]:
    """Return the same motions, each wait with the robot and the zone that force it.

    The zone is the first one ahead which forbids half of the wait or more, since for a zone farther
    ahead the robot could wait farther ahead.  If there is none, it is the zone that forbids most.

    By default a wait without an owner stays one, a rest that no robot forces; with `all_waits` its
    owner is looked for, too.
    """
    table = Motions(junctions.lengths(), motions)
    return [
        _owned(junctions, table, index, motion, all_waits)
        if any(all_waits or wait.owner >= 0 for wait in motion.waits)
        else motion
        for index, motion in enumerate(motions)
    ]


def _owned(
    junctions: Junctions, table: Motions, index: int, motion: Motion, all_waits: bool
) -> Motion:
    """Return a robot's motion, its waits with the robot and zone that forbid earlier departures."""
    track, (rows, known) = junctions.tracks[index], junctions.rows_of(index)
    mine = junctions.zones_of(index)
    span = junctions.spans(index)
    modes = np.full(len(rows.other), BOTH)
    low, high = forbid(rows, modes, table.table, track.elapsed, junctions.tau, known)
    forbidden = ForbiddenTimes(rows.first, rows.cell, known.begin, known.end, low, high, span)
    places = [0.0, *(wait.s for wait in motion.waits if wait.s > 0.0), track.limits.length]
    ride = track.ride(places)
    size = len(rows.cell) + len(mine) + 1
    found = Closed(np.empty(size), np.empty(size), np.empty(size, np.int64))
    at_start = motion.waits[0].s <= 0.0
    arrivals = motion.arrivals[0 if at_start else 1 :]
    waits: list[Wait] = []
    for p, (wait, arrival) in enumerate(zip(motion.waits, arrivals, strict=True), not at_start):
        count = closed_departures(ride, forbidden, p, p + 1, found)
        k = -1
        if (all_waits or wait.owner >= 0) and wait.depart > arrival:
            closed = np.column_stack((found.begins, found.ends))[:count].clip(arrival, wait.depart)
            k = _forcing(closed, found.owners[:count], span, _MOST * (wait.depart - arrival))
        waits.append(wait if k < 0 else replace(wait, owner=int(rows.other[k]), zone=int(mine[k])))
    return Motion(motion.limits, waits)


def _forcing(closed: Array, owners: Indices, span: Array, enough: float) -> int:
    """Return which zone forces a wait; -1 if no zone forbids any part of it.

    closed (n, 2) [s]: departures within the wait that zone owners (n,) forbids; span (zones, 2)
    [m]: where the robot enters and leaves each zone; a zone that forbids `enough` [s] explains the
    wait.
    """
    if len(owners) == 0:
        return -1
    shares = np.bincount(owners, closed[:, 1] - closed[:, 0], len(span))
    forcing = np.flatnonzero(shares >= enough)
    if len(forcing):
        return int(forcing[np.argmin(span[forcing, 0])])
    most = int(np.argmax(shares))
    return most if shares[most] > 0.0 else -1
