"""Finds from plans alone for whom robots wait, since no message states it.

Decides: which rests have a reason.  Must not know: how the plan was made.
"""

from __future__ import annotations

import math

from msgspec.structs import replace

from coordinator.findings.meetings import Meetings
from coordinator.plan.document import PlanDocument, Reason, RobotPlan
from coordinator.plan.wire import drive


def with_reasons(document: PlanDocument) -> PlanDocument:
    """Return the plan with the reason of every wait for which one can be found."""
    meetings = Meetings(document, drive(document))
    robots, waits = [], []
    for index, robot in enumerate(document.robots):
        told, reasons = _explained(meetings, index, robot)
        robots.append(told)
        waits += reasons
    return replace(document, robots=robots, waits=waits)


def _explained(meetings: Meetings, index: int, robot: RobotPlan) -> tuple[RobotPlan, list[Reason]]:
    """Return the robot with `yields_to` filled in, and the reasons of its waits."""
    rests = [(stop.s, stop.depart - stop.arrive) for stop in robot.stops]
    late = robot.start_time > 0.0
    if late:
        rests.insert(0, (0.0, robot.start_time))
    ends = [s for s, _ in [*rests[1:], (math.inf, 0.0)]][: len(rests)]
    owners, reasons = [], []
    for (s, lasts), end in zip(rests, ends, strict=True):
        owner, found = meetings.forcing(index, (s, end), lasts)
        owners.append(owner)
        if found is not None:
            reasons.append(
                Reason(
                    robot=robot.id,
                    s=s,
                    wait=lasts,
                    yields_to=owner,
                    zone=found.zone,
                    their_zone=found.their_zone,
                )
            )
    stops = [
        replace(stop, yields_to=owner)
        for stop, owner in zip(robot.stops, owners[1:] if late else owners, strict=True)
    ]
    return replace(robot, stops=stops, start_yields_to=owners[0] if late else ""), reasons
