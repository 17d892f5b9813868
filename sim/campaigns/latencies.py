"""How soon a fleet froze because of a robot that died, and how long it stood.

Decides: the moments from which these times count.  Must not know: how a run was made.
"""

from __future__ import annotations

from itertools import pairwise

import msgspec

from protocol.phases import BRAKING, FREEZE, GO, MOVING
from protocol.timing import SECOND
from sim.world.strikes import Struck
from sim.world.virtual_fleet import World


class Latencies(msgspec.Struct, frozen=True):
    """How long the whole fleet stood [s].

    freeze: from the death of a robot under way to the FREEZE that it led to, if there was one;
    resume: from a FREEZE to the next GO.
    """

    freeze: tuple[float, ...] = ()
    resume: tuple[float, ...] = ()


def latencies(world: World) -> Latencies:
    """Measure the latencies after every death of a robot under way in phase GO."""
    turns = [(one.now_ns, one.phase) for one in world.fleet.incidents if one.phase is not None]
    freeze = []
    for one in world.struck:
        frozen = [now_ns for now_ns, phase in turns if phase == FREEZE and now_ns >= one.now_ns]
        if _is_death(one) and frozen:
            freeze.append(round((frozen[0] - one.now_ns) / SECOND, 3))
    return Latencies(tuple(freeze), tuple(_resumes(turns)))


def _is_death(one: Struck) -> bool:
    """Return whether a robot that was under way fell silent for good or for over a minute."""
    silent = one.fault.kind == "kill" or (one.fault.kind == "hang" and one.fault.value > 60.0)
    return silent and one.fleet_phase == GO and one.robot_phase in (MOVING, BRAKING)


def _resumes(turns: list[tuple[int, int]]) -> list[float]:
    """Return the times from each FREEZE to the GO after it."""
    found, frozen_ns = [], 0
    for (before_ns, before), (now_ns, phase) in pairwise(turns):
        if before == FREEZE:
            frozen_ns = frozen_ns or before_ns
        if phase == GO and frozen_ns:
            found.append(round((now_ns - frozen_ns) / SECOND, 3))
            frozen_ns = 0
    return found
