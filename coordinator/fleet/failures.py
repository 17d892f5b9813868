"""Who fails a fleet that arms or moves: robots that are silent, late, or do not go along.

Decides: what makes a robot fail, whether it is lost or has itself to blame; what shows that a
robot was told to go.  Must not know: what the fleet then does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

from coordinator.fleet.member import Member
from coordinator.fleet.phases import ARM_PATIENCE
from protocol.messages import Report
from protocol.phases import BRAKING, DONE, FROZEN, LATE, LEASE_OUT, MOVING


class Failing(NamedTuple):
    """A robot and what is wrong with it; lost: it is silent; strike: it has itself to blame."""

    member: Member
    what: str
    lost: bool = False
    strike: bool = False


def that_do_not_arm(
    members: Iterable[Member], epoch: int, since_ns: int, now_ns: int
) -> list[Failing]:
    """Return who fails an epoch that has been waited for since a time."""
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
    """Return who fails a fleet under way; `spared` are those to be heard anew first."""
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
    """Tell whether a robot shows that it was told to go: it moves, has moved, or heard it late."""
    stopped = report.phase == FROZEN and report.fault in (LEASE_OUT, LATE)
    return stopped or report.phase in (MOVING, BRAKING, DONE)
