"""Robots that fail while a fleet arms: they are silent, or do not arm.

Decides: what makes a robot fail, whether it is lost or the fault is its own, and what shows that a
robot heard the GO.  Must not know: what the fleet then does.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from coordinator.fleet.member import Member
from coordinator.fleet.phases import ARM_PATIENCE
from protocol.messages import Report
from protocol.phases import BRAKING, DONE, MOVING


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
            found.append(silent(member))
        elif member.overload:
            found.append(Failing(member, member.overload))
        elif now_ns - since_ns > ARM_PATIENCE and not member.is_armed(epoch, now_ns):
            found.append(Failing(member, f"does not arm: {member.describe()}", strike=True))
    return found


def silent(member: Member) -> Failing:
    """Return what is wrong with a robot that is not heard."""
    what = "has lost its link" if member.gone else "has fallen silent"
    return Failing(member, what, lost=True)


def sets_out(report: Report) -> bool:
    """Return whether a report shows that its robot heard the GO: it moves or has moved."""
    return report.phase in (MOVING, BRAKING, DONE)
