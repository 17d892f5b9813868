"""Motions that were found without conflict zones, held against these.

Decides: which of the motions cannot stay.  Must not know: how they were found.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from coordinator.schedule.forbidden_interval_kernels import BOTH, forbid, meetings
from coordinator.schedule.junctions import Junctions
from coordinator.schedule.safe_intervals import earliest_motion
from coordinator.schedule.timetable import Motions


def meeting(junctions: Junctions, motions: Motions, priorities: Sequence[int]) -> set[int]:
    """Return of any two robots that meet the one of lower priority, or that arrives later."""
    last = _last_first(motions, priorities)
    return {
        min(index, other, key=last.__getitem__)
        for index in range(len(last))
        for other in _met(junctions, motions, index)
    }


def place_again(
    junctions: Junctions, motions: Motions, chosen: Collection[int], priorities: Sequence[int]
) -> bool:
    """Give chosen robots their earliest motions among the others; return whether there are some."""
    last = _last_first(motions, priorities)
    for index in chosen:
        motions.put(index, None)
    for index in sorted(chosen, key=last.__getitem__, reverse=True):
        found = earliest_motion(junctions, motions, index)
        if found is None:
            return False
        motions.put(index, found)
    return True


def _last_first(motions: Motions, priorities: Sequence[int]) -> list[tuple[int, float, int]]:
    """Return keys that sort robots by priority and then by arrival, those who give way first."""
    return [
        (priority, -motion.finish, -index)
        for index, (priority, motion) in enumerate(zip(priorities, motions.all(), strict=True))
    ]


def _met(junctions: Junctions, motions: Motions, index: int) -> list[int]:
    """Return the robots that a robot meets on its motion."""
    track, (rows, known) = junctions.tracks[index], junctions.rows_of(index)
    modes = np.full(len(rows.other), BOTH)
    forbid(rows, modes, motions.table, track.elapsed, junctions.tau, known)
    met = meetings(rows, known, motions.table, index, track.cell)
    return [int(other) for other in np.unique(rows.other[met])]
