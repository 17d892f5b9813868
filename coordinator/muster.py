"""A fleet core made from a proven plan document.

Decides: that a plan without a proof never becomes a fleet.
"""

from __future__ import annotations

from coordinator.errors import PlanError
from coordinator.fleet import Fleet
from coordinator.member import Member
from coordinator.plan import PlanDocument
from coordinator.wire import pack
from protocol.timing import SECOND


def muster(document: PlanDocument, boot: int) -> Fleet:
    """Return the fleet core for a plan; PlanError when the plan is not proven.

    `boot` is the coordinator's boot id, 32 random bits.
    """
    if document.proof is None or not document.proof.holds:
        raise PlanError("a plan whose proof does not hold is not sent to robots")
    members = [
        Member(
            id=robot.id,
            radius=robot.radius,
            speed=max(v for _, v in robot.profile),
            plan=pack(document, robot, boot),
        )
        for robot in document.robots
    ]
    finish = max(robot.finish_time for robot in document.robots)
    return Fleet(document.scenario, boot, document.epoch, members, round(finish * SECOND))
