"""How soon others were sent around a robot that died.

Decides: the moments from which these times count.  Must not know: how a run was made.
"""

from __future__ import annotations

import msgspec

from protocol.phases import BRAKING, GO, MOVING
from protocol.timing import SECOND
from sim.world.strikes import Struck
from sim.world.virtual_fleet import World


class Latencies(msgspec.Struct, frozen=True):
    """How long others waited [s].

    around: from the death of a robot under way until others were sent around it, if they were.
    """

    around: tuple[float, ...] = ()


def latencies(world: World) -> Latencies:
    """Measure the latencies after every death of a robot under way in phase GO."""
    given_up = {
        one.robot: one.now_ns
        for one in reversed(world.fleet.incidents)
        if one.text == f"others go around {one.robot}"
    }
    around = [
        round((given_up[one.fault.robot] - one.now_ns) / SECOND, 3)
        for one in world.struck
        if _is_death(one) and given_up.get(one.fault.robot, 0) >= one.now_ns
    ]
    return Latencies(tuple(around))


def _is_death(one: Struck) -> bool:
    """Return whether a robot that was under way fell silent for good or for over a minute."""
    silent = one.fault.kind == "kill" or (one.fault.kind == "hang" and one.fault.value > 60.0)
    return silent and one.fleet_phase == GO and one.robot_phase in (MOVING, BRAKING)
