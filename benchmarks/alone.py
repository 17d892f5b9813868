"""When each robot of a plan would arrive if it were alone: on its path, without a wait.

Decides: what delays are measured from.  Must not know: schedules.
"""

from __future__ import annotations

from coordinator.curves.nurbs import Nurbs, nurbs
from coordinator.motion.velocity_profile import Motion, limits_on
from coordinator.plan.document import PlanDocument
from coordinator.scenario.model import Robot, Scenario


def alone(document: PlanDocument, scenario: Scenario) -> list[float]:
    """Return each robot's least finish time [s] on its path in the plan."""
    paths = [one.path for one in document.robots]
    curves = [nurbs(one.degree, one.knots, one.control_points, one.weights) for one in paths]
    return [
        finish_on(curve, robot, scenario)
        for curve, robot in zip(curves, scenario.robots, strict=True)
    ]


def finish_on(curve: Nurbs, robot: Robot, scenario: Scenario) -> float:
    """Return when a robot that drives along a curve without a wait arrives [s]."""
    speed = scenario.planned_speed(robot)
    limits = limits_on(curve, speed, robot.max_accel, robot.max_lateral_accel, robot.max_turn_rate)
    return float(Motion(limits, []).finish)


def rests(document: PlanDocument) -> int:
    """Return how often robots of a plan wait, at their starts or on the way."""
    return sum(len(robot.stops) + (robot.start_time > 0.0) for robot in document.robots)
