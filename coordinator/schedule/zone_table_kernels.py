"""Compiled: all zones of one robot as rows.

Decides: how the rows of many zones lie one after another.  Must not know: times.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from coordinator.base.compiled import compiled
from coordinator.curves.nurbs import Array
from coordinator.curves.nurbs_kernels import Indices
from coordinator.schedule.zone_kernels import Polyline, zone_rows


class ZoneChords(NamedTuple):
    """The pairs of chords on which the zones of a fleet lie, as in conflict_zones.Zones.

    Zone z has pairs[first[z] : first[z + 1]]: a chord of its first and one of its second robot.
    """

    first: Indices
    pairs: Indices


class RobotZones(NamedTuple):
    """The zones of one robot (z,): their numbers, the other robots, and the reaches [m]."""

    zone: Indices
    other: Indices
    reach: Array


@compiled
def robot_rows(
    me: int,
    zones: RobotZones,
    chords: ZoneChords,
    first: Indices,
    lines: Polyline,
    cell: float,
    room: int,
) -> tuple[Indices, Array]:
    """Return where the rows of each zone begin (zones + 1,), and the rows of all zones (n, 3).

    The vertices of all robots are in `lines`, those of robot r from first[r] to first[r + 1].
    Reaches, `cell` [m] and rows are those of zone_kernels.zone_rows; there are at most `room` rows.
    """
    begins, rows = np.zeros(len(zones.zone) + 1, np.int64), np.empty((room, 3))
    most = 0
    for zone in zones.zone:
        most = max(most, chords.first[zone + 1] - chords.first[zone])
    spans = np.empty((most, 2))
    s, points = lines
    mine = slice(first[me], first[me + 1])
    line = Polyline(s[mine], points[mine])
    for k in range(len(zones.zone)):
        zone, other = zones.zone[k], zones.other[k]
        theirs = slice(first[other], first[other + 1])
        pairs = chords.pairs[chords.first[zone] : chords.first[zone + 1]]
        side = 0 if me < other else 1
        its = Polyline(s[theirs], points[theirs])
        count = zone_rows(line, its, pairs, side, zones.reach[k], cell, rows[begins[k] :], spans)
        begins[k + 1] = begins[k] + count
    return begins, rows[: begins[-1]]
