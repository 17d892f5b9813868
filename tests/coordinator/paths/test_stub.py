"""The stub of an idle robot: where it leads, what it keeps clear of, how it fits into float32."""

import math

import numpy as np
import pytest

from coordinator.base.errors import PlanError
from coordinator.paths.path_planner import Pathfinder
from coordinator.planning.planner import plan_scenario
from coordinator.scenario.model import Scenario, Workspace
from tests.scenarios import a_robot, a_scenario, box

NEED = 0.45


def idle(name, *pose, goal=None):
    return a_robot(name, pose, goal or pose)


def stub_of(*robots, **fields):
    """Return the ends of the first robot's stub, as steps [m] from its place."""
    path = Pathfinder(a_scenario(robots, **fields)).path(0)
    return path.points - robots[0].start[:2]


def directions(line):
    return math.atan2(*(line[1] - line[0])[::-1])


def test_it_leads_straight_ahead_from_the_place():
    for robot in (idle("I", 5.0, 4.0, 2.0), idle("I", 5.0, 4.0, goal=(5.0, 4.0, 2.0))):
        line = stub_of(robot)
        assert np.hypot(*line[0]) == 0.0
        assert 5e-4 < np.hypot(*line[1]) < 1e-3
        assert directions(line) == pytest.approx(2.0, abs=2e-3)
    assert directions(stub_of(idle("I", 5.0, 4.0))) == 0.0


def test_with_a_wall_ahead_it_leads_from_behind_to_the_place():
    line = stub_of(idle("I", 9.75, 4.0, 0.0))
    assert line[0, 0] < -5e-4
    assert np.abs(line[1]).max() < 1e-6
    assert directions(line) == 0.0


def test_without_a_heading_it_leads_along_walls_and_neighbours_that_are_flush():
    slot = [box(4.0, 1.0, 4.75, 3.0), box(5.25, 1.0, 6.0, 3.0)]
    assert directions(stub_of(idle("I", 5.0, 2.0), obstacles=slot)) == pytest.approx(math.pi / 2)
    around = [idle("A", 5.0 + NEED, 4.0), idle("B", 5.0, 4.0 + NEED), idle("C", 5.0, 4.0 - NEED)]
    assert abs(directions(stub_of(idle("I", 5.0, 4.0), *around))) == pytest.approx(math.pi)


@pytest.mark.parametrize("gap", [0.0, 0.0005, 0.0012, 0.002, 0.0029, 0.004])
def test_two_that_face_each_other_closely_are_planned(gap):
    pair = [idle("A", 5.0, 4.0, 0.0), idle("B", 5.0 + NEED + gap, 4.0, math.pi)]
    assert plan_scenario(a_scenario(pair)).proof.holds


@pytest.mark.parametrize("far", [0.0, 100.0, 1000.0, 4090.0, 7985.123])
def test_it_fits_into_float32_as_far_out_as_coordinates_go(far):
    places = [(far + 1.5 + i % 4, far + 1.5 + i // 4 + 0.0007 * i, 0.4 * i) for i in range(16)]
    floor = Workspace(boundary=box(far, far, far + 10.0, far + 8.0))
    robots = tuple(idle(f"I{i}", *place) for i, place in enumerate(places))
    assert plan_scenario(Scenario(name="far", workspace=floor, robots=robots)).proof.holds


def test_it_is_the_only_path_of_an_idle_robot():
    finder = Pathfinder(a_scenario([idle("I", 5.0, 4.0)]))
    for more in ({"detours": np.array([[6.0, 4.0, 0.3]])}, {"refuge": (6.0, 4.0)}):
        with pytest.raises(PlanError, match="I: stays at its start"):
            finder.path(0, **more)


def test_other_paths_keep_clear_of_an_idle_robot():
    robots = [a_robot("R", (1.0, 4.0), (9.0, 4.0)), idle("I", 5.0, 4.0)]
    path = Pathfinder(a_scenario(robots)).path(0)
    places = path.evaluate(np.linspace(0.0, path.knots[-1], 2001))
    assert np.hypot(*(places - (5.0, 4.0)).T).min() > NEED
