"""Robots that start or end exactly as near as they may are planned, and keep that distance."""

import math
import random
import re

import numpy as np
import pytest

from coordinator.base.errors import PlanError
from coordinator.ground.tight_places import near_places
from coordinator.plan.plan_file import to_json
from coordinator.planning.planner import plan_scenario
from coordinator.scenario.checks import find_problems
from coordinator.scenario.margin import LEAST_MARGIN
from coordinator.scenario.model import Scenario, Workspace
from tests.oracle_dense import closest
from tests.oracles import tracks
from tests.scenarios import a_robot, a_scenario, box

PAD = 0.0005
BEYOND = (0.0, 1e-6, 1e-4, 3e-4, 6e-4, 1.4e-3)
"""How much farther apart than the need robots stand [m]."""


def float32_error(origin):
    """What rounding the places of two robots to float32 may take from their distance [m]."""
    return 2.0 * math.sqrt(2.0) * float(np.spacing(np.float32(origin))) / 2.0


def two_robots(seed, beyond, which, origin=0.0):
    """Two robots side by side at their starts, or goals, that drive apart or beside each other."""
    dice = random.Random(seed)
    margin, turn = dice.choice((0.02, 0.05)), dice.uniform(-math.pi, math.pi)
    radii = [dice.choice((0.1, 0.15, 0.2, 0.317)) for _ in range(2)]
    x, y = origin + dice.uniform(5.5, 6.5), origin + dice.uniform(5.5, 6.5)
    apart = sum(radii) + margin + beyond
    spread = (dice.uniform(0.5, 1.5), dice.uniform(0.5, 1.5)) if dice.random() < 0.7 else (0.0, 0.0)
    robots = []
    for side, (radius, wide) in enumerate(zip(radii, spread, strict=True)):
        sign = 2 * side - 1
        near = x + side * apart * math.cos(turn), y + side * apart * math.sin(turn)
        course = turn + 0.5 * math.pi - sign * wide
        far = near[0] + 4.0 * math.cos(course), near[1] + 4.0 * math.sin(course)
        heading = (turn + 0.5 * math.pi,) if which == "headed start" else ()
        ends = (far, near) if which == "goal" else ((*near, *heading), far)
        accel = dice.choice((0.3, 1.0, math.inf))
        robots.append(a_robot("AB"[side], *ends, radius=radius, max_accel=accel))
    floor = Workspace(boundary=box(origin, origin, origin + 12.0, origin + 12.0), obstacles=())
    return Scenario(name="near", workspace=floor, robots=tuple(robots), margin=margin, tau=0.5)


@pytest.mark.parametrize("which", ["start", "goal", "headed start"])
@pytest.mark.parametrize("beyond", BEYOND)
@pytest.mark.parametrize("seed", range(8))
def test_robots_that_stand_as_near_as_they_may_drive_apart(seed, beyond, which):
    scenario = two_robots(seed, beyond, which)
    assert find_problems(scenario) == []
    plan = plan_scenario(scenario, effort=2)
    slack = closest(tracks(to_json(plan)), plan.tau, plan.margin).slack
    assert min(slack, plan.proof.least_slack) > min(beyond, 0.0) - 4.5e-5


@pytest.mark.parametrize("origin", [100.0, 1000.0, 3000.0, 7900.0])
@pytest.mark.parametrize("seed", range(4))
def test_far_from_the_origin_they_miss_no_more_than_float32_takes(seed, origin):
    scenario = two_robots(seed, 1e-6, "start", origin)
    assert find_problems(scenario) == []
    plan = plan_scenario(scenario, effort=2)
    slack = closest(tracks(to_json(plan)), plan.tau, plan.margin).slack
    assert slack > -4.5e-5 - float32_error(origin)


def test_a_row_of_robots_that_touch_leaves_one_by_one():
    apart = 0.2 + 0.2 + 0.05
    robots = [
        a_robot(f"R{k}", (2.0 + apart * k, 2.0), (16.0 - apart * k, 6.0 + 0.5 * k))
        for k in range(6)
    ]
    plan = plan_scenario(a_scenario(robots, size=(18, 10)))
    assert closest(tracks(to_json(plan)), plan.tau, plan.margin).slack > -4.5e-5


PLACE_ON_A_WAY = r"R\d(,| and) R\d .*R\d's (start|goal) \(\S+, \S+\) lies on R\d's way"


def a_chain(seed, count):
    """Robots side by side as near as they may, or nearly, at their starts and at their goals."""
    dice = random.Random(seed)
    places = np.array([[dice.uniform(3.5, 8.5) for _ in range(2)] for _ in range(2)])
    turns = np.array([dice.uniform(-math.pi, math.pi) for _ in range(2)])
    ways = np.column_stack((np.cos(turns), np.sin(turns)))
    margin, robots = dice.choice((LEAST_MARGIN, 0.02, 0.05)), []
    for k in range(count):
        radius = dice.choice((0.1, 0.15, 0.2))
        if robots:
            apart = radius + robots[-1].radius + margin
            places = places + np.array([[apart + dice.choice(BEYOND)] for _ in range(2)]) * ways
        accel = dice.choice((0.3, 1.0, math.inf))
        ends = [(float(x), float(y)) for x, y in places]
        robots.append(a_robot(f"R{k}", *ends, radius=radius, max_accel=accel))
    return a_scenario(robots, size=(12, 12), margin=margin, tau=dice.choice((0.2, 0.5)))


@pytest.mark.parametrize(("count", "least"), [(2, 14), (3, 9)])
def test_robots_near_at_both_ends_are_planned_or_refused_and_never_fail_their_proof(count, least):
    slacks, refusals = [], []
    for seed in range(16):
        scenario = a_chain(seed, count)
        try:
            plan = plan_scenario(scenario, effort=1)
        except PlanError as error:
            refusals.append(str(error))
        else:
            slacks.append(closest(tracks(to_json(plan)), plan.tau, plan.margin).slack)
    assert all(re.search(PLACE_ON_A_WAY, refusal) for refusal in refusals)
    assert len(slacks) >= least
    assert min(slacks) > -4.5e-5


@pytest.mark.parametrize("tau", [0.2, 0.3, 0.5])
def test_one_that_steps_aside_to_end_as_near_as_it_may_is_not_driven_through(tau):
    robots = [
        a_robot("A", (9.91545, 7.256026), (2.414348, 7.171088), max_accel=0.375),
        a_robot("B", (10.111832, 7.545741), (2.067175, 7.215484), radius=0.1, max_accel=0.375),
    ]
    scenario = a_scenario(robots, size=(12, 12), margin=0.05, tau=tau)
    plan = plan_scenario(scenario, effort=1)
    assert closest(tracks(to_json(plan)), plan.tau, plan.margin).slack > -4.5e-5


def test_zones_ask_as_much_as_ever_of_robots_that_stand_apart():
    scenario = a_scenario([a_robot("A", (2, 2), (8, 2)), a_robot("B", (2.452, 2), (8, 6))])
    near = near_places(scenario, PAD)
    assert near.less.tolist() == [0.0, 0.0]
    assert near.errors.tolist() == [5e-4, 5e-4]


def test_a_goal_on_another_robots_start_asks_for_an_order_and_for_no_less():
    robots = [a_robot("A", (2, 2), (8, 2)), a_robot("B", (5, 6), (2.3, 2))]
    assert near_places(a_scenario(robots), PAD).less.tolist() == [0.0, 0.0]


def test_starts_nearer_than_that_are_refused_by_name():
    scenario = two_robots(0, -1e-5, "start")
    with pytest.raises(PlanError, match="A and B block each other"):
        plan_scenario(scenario, effort=2)
