"""Motions that were found without conflict zones, held against these.

Decides: which of the motions cannot stay.  Must not know: how they were found.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from coordinator.motion.velocity_profile import Motion
from coordinator.schedule.forbidden_interval_kernels import BOTH, forbid, meetings
from coordinator.schedule.junctions import Junctions
from coordinator.schedule.safe_intervals import earliest_motion
from coordinator.schedule.timetable import Motions


def placed(junctions: Junctions, motions: Sequence[Motion]) -> Motions:
    """Return these motions side by side."""
    table = Motions(junctions.lengths())
    for index, motion in enumerate(motions):
        table.put(index, motion)
    return table


def meeting(junctions: Junctions, motions: Motions) -> set[int]:
    """Return of any two robots that meet the one that arrives later."""
    finish = [motion.finish for motion in motions.all()]
    return {
        max(index, other, key=lambda one: (finish[one], one))
        for index in range(len(finish))
        for other in _met(junctions, motions, index)
    }


def place_again(junctions: Junctions, motions: Motions, chosen: Collection[int]) -> bool:
    """Give chosen robots their earliest motions among the others; return whether there are some."""
    finish = [motion.finish for motion in motions.all()]
    for index in chosen:
        motions.put(index, None)
    for index in sorted(chosen, key=lambda one: (finish[one], one)):
        found = earliest_motion(junctions, motions, index)
        if found is None:
            return False
        motions.put(index, found)
    return True


def _met(junctions: Junctions, motions: Motions, index: int) -> list[int]:
    """Return the robots that a robot meets on its motion."""
    track, (rows, known) = junctions.tracks[index], junctions.rows_of(index)
    modes = np.full(len(rows.other), BOTH)
    forbid(rows, modes, motions.table, track.elapsed, junctions.tau, known)
    met = meetings(rows, known, motions.table, index, track.cell)
    return [int(other) for other in np.unique(rows.other[met])]
