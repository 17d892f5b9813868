"""A fleet core made from a proven plan document.

Decides: that a plan without a proof never becomes a fleet.
"""

from __future__ import annotations

import math

from coordinator.base.errors import PlanError
from coordinator.fleet.core import Fleet
from coordinator.fleet.epoch_times import EpochTimes
from coordinator.fleet.events import Part
from coordinator.fleet.grants import Grants
from coordinator.fleet.member import Member
from coordinator.fleet.orders import OrderBook
from coordinator.plan.course import Course
from coordinator.plan.document import PlanDocument, RobotPlan
from coordinator.plan.shares_of_tau import Shares, shares_of
from coordinator.plan.wire import PackedPlan, address
from coordinator.proof.motion_pieces import Flights
from coordinator.proof.precedence import staircase_failures
from coordinator.scenario.link_times import link_times
from coordinator.schedule.staircase_making import with_staircases
from protocol.timing import SECOND


def muster(plan: PackedPlan, boot: int, orders: OrderBook | None = None) -> Fleet:
    """Return the fleet core for a plan; raise PlanError if the plan is not proven.

    `boot` is the coordinator's boot id, 32 random bits.
    """
    document = plan.document
    parts, times = parts_of(plan, boot), link_times(document.link)
    members = [
        Member(
            id=robot.id,
            radius=robot.radius,
            speed=parts[robot.id].speed,
            plan=parts[robot.id].plan,
            accel=_brakes(robot),
            timeout_ns=times.report_timeout_ns,
            part_epoch=document.epoch,
        )
        for robot in document.robots
    ]
    return Fleet(
        document.scenario,
        boot,
        members,
        EpochTimes(document.epoch, round(_shares_of(document).headroom * SECOND)),
        grants_of(plan),
        orders,
    )


def grants_of(plan: PackedPlan) -> Grants:
    """Return the authority of a plan's robots; raise PlanError if its staircases are not proven.

    A plan that was read from a file has no staircases yet; they are made and proven here.
    """
    document = plan.document
    if plan.staircases is None:
        plan = with_staircases(plan)
        assert plan.staircases is not None
        flights = Flights(plan.driven)
        if failures := staircase_failures(flights, plan.staircases, document.margin):
            raise PlanError("staircases do not cover all conflicts: " + "; ".join(failures))
    headroom_ms = math.ceil(1000.0 * _shares_of(document).headroom)
    courses = [Course(one, 0.0) for one in plan.driven]
    return Grants(plan.staircases, [one.id for one in plan.driven], headroom_ms, courses)


def _shares_of(document: PlanDocument) -> Shares:
    return shares_of([r.limits for r in document.robots if r.limits], document.link)


def parts_of(plan: PackedPlan, boot: int) -> dict[str, Part]:
    """Return each robot's part in a proven plan; raise PlanError if the plan is not proven."""
    proof = plan.document.proof
    if proof is None or not proof.holds:
        raise PlanError("a plan whose proof does not hold is not sent to robots")
    return {
        robot.id: Part(address(plan.messages[robot.id], boot), max(v for _, v in robot.profile))
        for robot in plan.document.robots
    }


def _brakes(robot: RobotPlan) -> float:
    """Return the deceleration that a plan counts on [m/s^2]; 0 if the plan does not state it."""
    if robot.limits is None:
        return 0.0
    return math.inf if robot.limits.max_accel is None else robot.limits.max_accel
