"""Rings in which every robot goes to the next one's start: no order of whole robots works."""

from __future__ import annotations

import math

import pytest
from msgspec.structs import replace

from coordinator.base.errors import PlanError
from coordinator.plan.plan_file import to_json
from coordinator.planning.planner import plan_scenario
from coordinator.scenario.model import Robot, Scenario, Workspace
from tests.oracle_dense import closest
from tests.oracles import tracks

_FLOOR = Workspace(boundary=((0.0, 0.0), (14.0, 0.0), (14.0, 14.0), (0.0, 14.0)), obstacles=())


def ring(count: int, spacing: float) -> Scenario:
    """Return robots on a circle, each of which goes to the place of the next."""
    radius = 0.5 * spacing / math.sin(math.pi / count)
    angles = [2.0 * math.pi * k / count for k in range(count)]
    places = [(7.0 + radius * math.cos(a), 7.0 + radius * math.sin(a)) for a in angles]
    robots = tuple(
        Robot(
            id=f"R{k}",
            start=place,
            goal=places[(k + 1) % count],
            radius=0.15,
            max_speed=0.5,
            max_accel=0.5,
            max_lateral_accel=0.5,
        )
        for k, place in enumerate(places)
    )
    return Scenario(name="ring", workspace=_FLOOR, robots=robots)


@pytest.mark.parametrize("spacing", [0.85, 1.0, 1.3])
@pytest.mark.parametrize("count", [3, 5, 8, 16])
def test_a_ring_turns_by_one_place_with_everybody_waiting_half_way(count, spacing):
    plan = plan_scenario(ring(count, spacing))
    assert plan.proof is not None
    assert plan.proof.holds
    assert max(robot.finish_time for robot in plan.robots) < 10.0
    assert closest(tracks(to_json(plan)), plan.tau, plan.margin).slack >= -1e-6


def test_robots_of_a_ring_as_dense_as_they_are_step_aside():
    plan = plan_scenario(ring(5, 0.5))
    assert plan.proof is not None
    assert plan.proof.holds
    assert closest(tracks(to_json(plan)), plan.tau, plan.margin).slack >= -1e-6


def test_a_dense_ring_of_robots_that_cannot_step_aside_is_told_as_such():
    dense = ring(5, 0.5)
    robots = tuple(replace(robot, min_turn_radius=0.05) for robot in dense.robots)
    with pytest.raises(PlanError, match="block each other in a ring"):
        plan_scenario(replace(dense, robots=robots))
