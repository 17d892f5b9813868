"""Why each robot waits: for whom, at which zone, how long, and what the other order would cost.

Decides: the facts that a plan gives about a wait.  Must not know: how they are shown.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from coordinator.motion.velocity_profile import Motion
from coordinator.plan.document import Reason
from coordinator.scenario.model import Robot
from coordinator.schedule.conflict_search import ConflictSearch
from coordinator.schedule.junctions import Junctions
from coordinator.schedule.timetable import Motions

_NODES: Final = 4
"""Nodes that are searched for the cost of the other order at one zone."""

_MOST: Final = 200
_MOST_PLANNED: Final = 20_000
"""The other order is tried for the _MOST longest waits, and in large fleets for
_MOST_PLANNED / robots."""


def explain_waits(
    junctions: Junctions, motions: Sequence[Motion], names: Sequence[str], tries: bool = True
) -> list[Reason]:
    """Return the reasons of all waits, in the order of the robots and along their paths.

    If `tries`, the cost of the other order is computed for the longest waits.
    """
    waits = [
        (index, number, lasts)
        for index, motion in enumerate(motions)
        for number, lasts in enumerate(_lasting(motion))
        if motion.waits[number].owner >= 0
    ]
    most = min(_MOST, _MOST_PLANNED // len(names)) if tries else 0
    longest = sorted(waits, key=lambda wait: -wait[2])[:most]
    table = Motions(junctions.lengths(), motions)
    tried = {wait[:2]: _otherwise(junctions, table, *wait[:2]) for wait in longest}
    reasons = []
    for index, number, lasts in waits:
        wait = motions[index].waits[number]
        mine = junctions.zones.a[wait.zone] == index
        a0, a1, b0, b1 = junctions.zones.extent[wait.zone].tolist()
        reasons.append(
            Reason(
                robot=names[index],
                s=wait.s,
                wait=lasts,
                yields_to=names[wait.owner],
                zone=(a0, a1) if mine else (b0, b1),
                their_zone=(b0, b1) if mine else (a0, a1),
                otherwise=tried.get((index, number)),
                tried=(index, number) in tried,
            )
        )
    return reasons


def _lasting(motion: Motion) -> list[float]:
    """Return how long each wait lasts [s]."""
    at_start = bool(motion.waits) and motion.waits[0].s <= 0.0
    arrivals = motion.arrivals[0 if at_start else 1 :]
    return [max(w.depart - t, 0.0) for w, t in zip(motion.waits, arrivals, strict=True)]


def _otherwise(junctions: Junctions, motions: Motions, index: int, number: int) -> float | None:
    """Return how much later [s] both arrive in total if this one goes first; None if it cannot."""
    motion = motions.found[index]
    assert motion is not None
    wait = motion.waits[number]
    search = ConflictSearch(junctions, motions, (index, wait.owner))
    cost = search.cost_if(wait.zone, wait.owner, _NODES)
    return None if math.isinf(cost) else cost


def unkept_priorities(robots: Sequence[Robot], waits: Sequence[Reason]) -> list[str]:
    """Return one sentence listing the robots that wait for others of lower priority, or nothing."""
    priority = {robot.id: robot.priority for robot in robots}
    pairs = dict.fromkeys(
        f"{wait.robot} ({priority[wait.robot]}) waits for {wait.yields_to} "
        f"({priority[wait.yields_to]})"
        for wait in waits
        if priority[wait.robot] > priority.get(wait.yields_to, priority[wait.robot])
    )
    if not pairs:
        return []
    return [f"priorities are not kept, no order was found that keeps them: {', '.join(pairs)}"]
