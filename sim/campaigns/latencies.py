"""How quickly a fleet reacted to the deaths of its robots.

Decides: the moments from which these times count.  Must not know: how a run was made.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import msgspec
import numpy as np

from protocol.phases import BRAKING, FREEZE, GO, MOVING
from protocol.timing import SECOND
from sim.judging.blackbox import BlackBox
from sim.world.strikes import Struck
from sim.world.virtual_fleet import World

_STILL = 1e-6
"""A shorter distance [m] between two rows counts as no motion."""


class Latencies(msgspec.Struct, frozen=True):
    """Latencies [s], with one entry for each robot that died while it was under way.

    freeze: death to FREEZE; rest: death to the last motion of any robot that had no fault itself;
    share: `rest` divided by the plan's tau; resume: FREEZE to the next GO, one entry per FREEZE.
    """

    freeze: tuple[float, ...] = ()
    rest: tuple[float, ...] = ()
    share: tuple[float, ...] = ()
    resume: tuple[float, ...] = ()


def latencies(world: World, boxes: Mapping[str, BlackBox]) -> Latencies:
    """Measure the latencies after every death of a robot under way in phase GO."""
    told = world.fleet.incidents
    turns = [(one.now_ns, one.phase) for one in told if one.phase is not None]
    faulty = {one.fault.robot for one in world.struck}
    healthy = [box for name, box in boxes.items() if name not in faulty]
    freeze, rest, share = [], [], []
    for one in world.struck:
        frozen = [now_ns for now_ns, phase in turns if phase == FREEZE and now_ns >= one.now_ns]
        if not _is_death(one) or not frozen:
            continue
        went = [now_ns for now_ns, phase in turns if phase == GO and now_ns > frozen[0]]
        death = (one.now_ns - world.began_ns) / SECOND
        end = (went[0] - world.began_ns) / SECOND if went else np.inf
        last = max((_last_motion(box, death, end) for box in healthy), default=death)
        freeze.append(round((frozen[0] - one.now_ns) / SECOND, 3))
        rest.append(round(last - death, 3))
        tau = world.mission.documents[one.epoch].tau
        share.append(round((last - death) / tau, 4) if tau > 0.0 else np.inf)
    return Latencies(tuple(freeze), tuple(rest), tuple(share), tuple(_resumes(turns)))


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


def _last_motion(box: BlackBox, since: float, until: float) -> float:
    """Return when a robot last moved between two times, `since` if it did not."""
    if len(box.t) < 2:
        return since
    moved = np.hypot(*np.diff(box.places, axis=0).T) > _STILL
    ends = box.t[1:][moved & (box.t[:-1] < until) & (box.t[1:] > since)]
    return float(ends[-1]) if len(ends) else since
