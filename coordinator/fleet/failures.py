"""Robots that fail while a fleet arms or moves: they are silent, late, or do not set out.

Decides: what makes a robot fail, whether it is lost or the fault is its own, and what shows that a
robot heard the GO.  Must not know: what the fleet then does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

from coordinator.fleet.member import Member
from coordinator.fleet.phases import ARM_PATIENCE
from protocol.messages import Report
from protocol.phases import BRAKING, DONE, FROZEN, LATE, LEASE_OUT, MOVING


class Failing(NamedTuple):
    """A robot and what is wrong with it.

    `lost`: the robot is silent.  `strike`: the fault is its own and counts as a strike.
    """

    member: Member
    what: str
    lost: bool = False
    strike: bool = False


def that_do_not_arm(
    members: Iterable[Member], epoch: int, since_ns: int, now_ns: int
) -> list[Failing]:
    """Return the robots that are silent or not armed; the epoch has waited since `since_ns`."""
    found = []
    for member in members:
        if member.is_silent(now_ns):
            found.append(Failing(member, "has fallen silent", lost=True))
        elif now_ns - since_ns > ARM_PATIENCE and not member.is_armed(epoch, now_ns):
            found.append(Failing(member, f"does not arm: {member.describe()}", strike=True))
    return found


def on_the_way(
    moving: Iterable[Member],
    spared: Callable[[Member], bool],
    start_ns: int,
    deadline_ns: int,
    now_ns: int,
) -> list[Failing]:
    """Return the robots that fail while the fleet is under way.

    `spared` returns whether a robot is excepted, because the coordinator was away and has not had
    the time to hear it again.
    """
    found = []
    for member in moving:
        if spared(member):
            continue
        if member.is_silent(now_ns):
            found.append(Failing(member, "has fallen silent", lost=True))
        elif member.has_not_set_out(start_ns, now_ns):
            found.append(Failing(member, "has not set out", strike=True))
        elif now_ns > deadline_ns:
            found.append(Failing(member, "has not arrived in time", strike=True))
    return found


def sets_out(report: Report) -> bool:
    """Return whether a report shows that its robot heard the GO.

    It does if the robot moves, has moved, or heard the GO too late.
    """
    stopped = report.phase == FROZEN and report.fault in (LEASE_OUT, LATE)
    return stopped or report.phase in (MOVING, BRAKING, DONE)
