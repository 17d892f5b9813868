"""For whom a robot waits: against plans in which it does not."""

import math
from pathlib import Path

import pytest
from msgspec.structs import replace

from coordinator.planning.planner import plan_scenario
from coordinator.scenario.model import Scenario, Workspace
from coordinator.scenario_files.scenario_reader import read_scenario
from sim.floors.generator import generate
from tests.crowds import crowd, square
from tests.oracle_waits import rests, share

EXAMPLES = Path(__file__).parents[3] / "examples"


def test_a_wait_before_one_robots_zone_is_not_told_by_a_later_one_that_forces_it_too():
    """R1 stands 1 cm before R2's zone; R4, 9 m ahead, forbids most of that wait as well."""
    scenario = read_scenario(EXAMPLES / "paper_five_real.toml")
    quick = [
        replace(one, max_accel=1.25 * one.max_accel, max_turn_rate=math.inf)
        for one in scenario.robots
    ]
    scenario = replace(scenario, robots=tuple(quick), tau=2.37)
    document = plan_scenario(scenario)
    assert [(robot, other) for robot, _, other, _ in rests(document)] == [("R1", "R2")]
    told = document.waits[0]
    assert told.zone[0] - told.s < 0.05
    assert share(document, *rests(document)[0]) > 0.9


@pytest.mark.parametrize(
    ("kind", "robots", "seed"),
    [("circle", 8, 3), ("warehouse", 12, 5), ("open", 9, 2), ("corridors", 10, 4)],
)
def test_who_is_named_forces_half_of_a_wait_or_nobody_forces_more(kind, robots, seed):
    document = plan_scenario(generate(kind, robots, seed), effort=3)
    long = [rest for rest in rests(document) if rest[3] > 0.2 and rest[2]]
    assert long
    for name, number, other, lasts in long:
        named = share(document, name, number, other, lasts)
        if named < 0.4:
            others = {robot.id for robot in document.robots} - {name, other}
            assert named >= max(share(document, name, number, one, lasts) for one in others) - 0.1


def test_a_robot_may_rest_that_meets_nobody():
    """R2 of these makes room for others, whose ways then lead elsewhere."""
    trips = [
        ((0.525, 0.228), (0.427, 0.304)),
        ((0.289, 0.534), (0.156, 0.541)),
        ((0.596, 0.586), (0.52, 0.594)),
        ((0.246, 0.255), (0.169, 0.157)),
    ]
    robots = crowd(trips, 0.1, 3.0, 6.0)
    floor = Workspace(boundary=square(0.74))
    scenario = Scenario(name="near each other", workspace=floor, robots=robots, margin=0.03)
    assert plan_scenario(scenario).proof.holds
