"""Attacks that once got through: each is refused, or done in reasonable time, for good."""

import tracemalloc

import numpy as np
import pytest
from msgspec.structs import replace

from coordinator.base.errors import PlanError
from coordinator.plan.document import Path
from coordinator.plan.wire import pack, unpack
from coordinator.planning.planner import plan_scenario
from protocol.curve import Curve
from tests.scenarios import a_robot, a_scenario, box

LINE = (3, [0, 0, 0, 0, 1, 1, 1, 1], [(1, 3), (2.3, 2), (3.7, 4), (5, 3)])


@pytest.fixture(scope="module")
def straight():
    return plan_scenario(a_scenario([a_robot("A", (1, 3), (5, 3))]))


@pytest.mark.parametrize("weights", [[1, 1e4, 1, 1], [1, 100, 0.01, 1], [1, 1, 1e-5, 1]])
def test_weights_that_hide_most_of_a_curve_from_the_quadrature_are_refused(straight, weights):
    degree, knots, points = LINE
    robot = straight.robots[0]
    length = Curve(degree, knots, *map(list, zip(*points, strict=True)), weights).length
    path = Path(degree=degree, knots=knots, control_points=points, weights=weights)
    profile = [(0.0, 0.3), (float(np.float32(length)), 0.3)]
    wild = replace(robot, path=path, profile=profile, stops=[], length=length, limits=None)
    with pytest.raises(ValueError, match=r"weights|arc length"):
        unpack(pack(straight, wild, 0), 0.2)


def test_moderate_weights_are_accepted(straight):
    degree, knots, points = LINE
    weights = [1.0, 0.8, 1.2, 1.0]
    length = Curve(degree, knots, *map(list, zip(*points, strict=True)), weights).length
    path = Path(degree=degree, knots=knots, control_points=points, weights=weights)
    profile = [(0.0, 0.3), (float(np.float32(length)), 0.3)]
    robot = replace(straight.robots[0], path=path, profile=profile, stops=[], limits=None)
    assert unpack(pack(straight, robot, 0), 0.2).curve.length == pytest.approx(length, abs=1e-4)


def test_a_curve_that_jumps_is_refused():
    xs = [1.0, 1.3, 1.6, 1.8, 4.2, 4.5, 4.8, 5.0]
    with pytest.raises(ValueError, match="jumps"):
        Curve(3, [0.0] * 4 + [1.0] * 4 + [2.0] * 4, xs, [3.0] * 8, [1.0] * 8)


@pytest.mark.parametrize("both_ways", [False, True])
def test_the_proof_of_robots_side_by_side_needs_little_memory(both_ways):
    robots = [
        a_robot("A", (1, 3), (41, 3)),
        a_robot("B", *[(1, 3.6), (41, 3.6)][:: -1 if both_ways else 1]),
    ]
    scenario = a_scenario(robots, size=(42, 6))
    tracemalloc.start()
    document = plan_scenario(scenario)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert document.proof.least_separation == pytest.approx(0.6, abs=1e-3)
    assert peak < 300e6


@pytest.mark.parametrize(
    ("start", "goal", "radius", "longest"),
    [
        ((5, 10, 0.0), (12, 10, 0.0), 1.0, 1.001),
        ((5, 5, 0.0), (5.5, 5, 0.0), 0.0, 1.001),
        ((5, 5), (5.4, 5, 0.0), 0.0, 1.001),
        ((5, 5, 0.0), (15, 7, 0.0), 1.0, 1.1),
        ((5, 5, 0.0), (12, 12, 1.5708), 1.0, 1.35),
    ],
)
def test_headings_in_the_open_cost_no_absurd_way(start, goal, radius, longest):
    robot = a_robot("A", start, goal, min_turn_radius=radius)
    document = plan_scenario(a_scenario([robot], size=(20, 20)))
    direct = np.hypot(goal[0] - start[0], goal[1] - start[1])
    assert document.robots[0].length <= longest * direct


def test_a_robot_may_stand_as_near_to_a_wall_as_the_scenario_check_allows():
    for start, goal in (((0.25, 3), (5, 3)), ((1, 3), (7.75, 5.75))):
        robot = a_robot("A", start, goal, radius=0.2)
        assert plan_scenario(a_scenario([robot], size=(8, 6), margin=0.05)).proof.holds


def test_a_turn_that_does_not_fit_is_told_with_the_best_radius_found():
    robot = a_robot("A", (5, 10, 0.0), (5, 12, 3.14159), min_turn_radius=2.0)
    with pytest.raises(PlanError, match=r"best turn found .* radius of 0\.\d+ m"):
        plan_scenario(a_scenario([robot], size=(7, 16)))


def test_where_there_is_room_a_robot_goes_around_circles_to_turn_as_wide_as_it_must():
    robot = a_robot("A", (5, 10, 0.0), (5, 12, 3.14159), min_turn_radius=2.0)
    document = plan_scenario(a_scenario([robot], size=(20, 20)))
    assert document.proof.holds
    assert document.robots[0].length < 5 * 2 * np.pi * 2.0


@pytest.mark.parametrize(
    ("a", "b", "obstacles"),
    [
        ((1, 3), (7, 3), [box(3.8, 0, 4.2, 2.5), box(3.8, 3.5, 4.2, 6)]),
        ((3.7, 3), (4.3, 3), []),
        ((3, 3), (4.2, 3), []),
        ((1, 3), (7, 3), [box(0, 0, 8, 2.25), box(0, 3.75, 8, 6)]),
    ],
    ids=["through a door", "close by", "a step apart", "in a corridor"],
)
def test_two_robots_swap_places(a, b, obstacles):
    robots = [a_robot("A", a, b, max_speed=0.5), a_robot("B", b, a, max_speed=0.5)]
    document = plan_scenario(a_scenario(robots, size=(8, 6), obstacles=obstacles))
    assert document.proof.holds
    assert document.notes
