"""A fleet core made from a proven plan document.

Decides: that a plan without a proof never becomes a fleet.
"""

from __future__ import annotations

import math

from coordinator.base.errors import PlanError
from coordinator.fleet.core import Fleet
from coordinator.fleet.delay import Delay
from coordinator.fleet.epoch_times import EpochTimes
from coordinator.fleet.events import Part
from coordinator.fleet.grants import Grants
from coordinator.fleet.member import Member
from coordinator.plan.document import PlanDocument, RobotPlan
from coordinator.plan.fault_budget import Budget, budget_for
from coordinator.plan.wire import PackedPlan, address, pack_times
from coordinator.proof.precedence import staircase_failures
from coordinator.scenario.link_times import link_times
from coordinator.schedule.staircase_making import with_staircases
from protocol.timing import MILLISECOND, SECOND


def muster(plan: PackedPlan, boot: int) -> Fleet:
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
        )
        for robot in document.robots
    ]
    finish = max(robot.finish_time for robot in document.robots)
    budget = _budget_of(document)
    behind = budget.late + budget.travel
    return Fleet(
        document.scenario,
        boot,
        members,
        EpochTimes(
            document.epoch,
            round(finish * SECOND),
            round(_settling(budget) * SECOND),
            round(behind * SECOND),
        ),
        Delay(round(document.tau * SECOND), round(budget.travel * SECOND)),
        grants_of(plan),
    )


def grants_of(plan: PackedPlan) -> Grants:
    """Return the authority of a plan's robots; raise PlanError if its staircases are not proven.

    A plan that was read from a file has no staircases yet; they are made and proven here.
    """
    document = plan.document
    if plan.staircases is None:
        plan = with_staircases(plan)
        assert plan.staircases is not None
        if failures := staircase_failures(plan.driven, plan.staircases, document.margin):
            raise PlanError("staircases do not cover all conflicts: " + "; ".join(failures))
    budget = _budget_of(document)
    headroom = _settling(budget) * SECOND // MILLISECOND
    return Grants(plan.staircases, [robot.id for robot in document.robots], int(headroom))


def _budget_of(document: PlanDocument) -> Budget:
    return budget_for([r.limits for r in document.robots if r.limits], document.link)


def _settling(budget: Budget) -> float:
    """Return the time [s] until all robots rest once they are no longer sent Commands."""
    return budget.lease + budget.travel + budget.brake + budget.clocks


def parts_of(plan: PackedPlan, boot: int) -> dict[str, Part]:
    """Return each robot's part in a proven plan; raise PlanError if the plan is not proven."""
    proof = plan.document.proof
    if proof is None or not proof.holds:
        raise PlanError("a plan whose proof does not hold is not sent to robots")
    return {
        robot.id: Part(address(plan.messages[robot.id], boot), max(v for _, v in robot.profile))
        for robot in plan.document.robots
    }


def times_of(plan: PackedPlan, driven: PlanDocument, boot: int) -> dict[str, bytes]:
    """Return the NewTimes messages for the robots whose times differ from the driven plan's."""
    parts, document = parts_of(plan, boot), plan.document
    was = {robot.id: robot for robot in driven.robots}
    return {
        robot.id: pack_times(parts[robot.id].plan, document.revision)
        for robot in document.robots
        if robot != was[robot.id]
    }


def _brakes(robot: RobotPlan) -> float:
    """Return the deceleration that a plan counts on [m/s^2]; 0 if the plan does not state it."""
    if robot.limits is None:
        return 0.0
    return math.inf if robot.limits.max_accel is None else robot.limits.max_accel
