"""Compiled: all zones of one robot as rows.

Decides: how the rows of many zones lie one after another.  Must not know: times.
"""

from __future__ import annotations

import numpy as np

from coordinator.base.compiled import compiled
from coordinator.curves.nurbs import Array
from coordinator.curves.nurbs_kernels import Indices
from coordinator.schedule.zone_kernels import zone_rows


@compiled
def robot_rows(
    me: int,
    zones: Indices,
    others: Indices,
    first_pair: Indices,
    pairs: Indices,
    first_chord: Indices,
    s: Array,
    points: Array,
    reach: Array,
    cell: float,
    room: int,
) -> tuple[Indices, Array]:
    """Return where the rows of each zone begin (zones + 1,), and all rows (k, low, high).

    s (n,), points (n, 2): the chords of all robots, those of robot i from first_chord[i]; reach
    (zones,) [m], cell [m] and rows as in zone_kernels.zone_rows; `room` rows are enough.
    """
    first, rows = np.zeros(len(zones) + 1, np.int64), np.empty((room, 3))
    mine = slice(first_chord[me], first_chord[me + 1])
    for k in range(len(zones)):
        zone, other = zones[k], others[k]
        theirs = slice(first_chord[other], first_chord[other + 1])
        here = pairs[first_pair[zone] : first_pair[zone + 1]]
        side = 0 if me < other else 1
        count = zone_rows(
            s[mine], points[mine], s[theirs], points[theirs],
            here, side, reach[k], cell, rows[first[k] :],
        )  # fmt: skip
        first[k + 1] = first[k] + count
    return first, rows[: first[-1]]
