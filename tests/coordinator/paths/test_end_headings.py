"""Headings with room to turn: the path exists, keeps its radius by sampling, and is not absurd."""

import math
import random

import numpy as np
import pytest

from coordinator.paths.path_planner import Pathfinder
from tests.scenarios import a_robot, a_scenario, box
from tests.sweeps import seeds


def curve_of(start, goal, radius, obstacles=(), size=(20.0, 20.0), **fields):
    robot = a_robot("A", start, goal, min_turn_radius=radius, **fields)
    return Pathfinder(a_scenario([robot], size, obstacles)).path(0)


def assert_turns_and_headings(curve, start, goal, radius):
    u = np.linspace(0.0, curve.knots[-1], 6001)
    assert np.abs(curve.curvature(u)).max() <= 1.002 / radius
    _, along = curve.derivatives([0.0, curve.knots[-1]], 1)
    for direction, pose in zip(along, (start, goal), strict=True):
        if len(pose) == 3:
            off = math.atan2(direction[1], direction[0]) - pose[2]
            assert abs(math.remainder(off, 2.0 * math.pi)) < 1e-3


@pytest.mark.parametrize("radius", [0.1, 0.3, 0.6])
def test_any_two_poses_in_the_open_are_joined(radius):
    for seed in seeds(40):
        dice = random.Random(seed)
        poses = [
            (dice.uniform(4, 16), dice.uniform(4, 16), dice.uniform(-math.pi, math.pi))
            for _ in range(2)
        ]
        if math.dist(poses[0][:2], poses[1][:2]) < 1.0:
            continue
        curve = curve_of(*poses, radius)
        assert_turns_and_headings(curve, *poses, radius)
        straight = math.dist(poses[0][:2], poses[1][:2])
        assert curve.length < straight + 2.5 * 2.0 * math.pi * 2.5 * radius + 1.0


def test_a_robot_turns_round_to_a_goal_behind_it():
    start, goal = (10.0, 10.0, 0.0), (8.0, 10.0, math.pi)
    assert_turns_and_headings(curve_of(start, goal, 0.5), start, goal, 0.5)


def test_it_turns_to_the_side_where_there_is_room():
    start, goal = (10.0, 3.0, 0.0), (5.0, 3.0, math.pi)
    curve = curve_of(start, goal, 0.4, [box(6, 0, 14, 2.4)])
    assert_turns_and_headings(curve, start, goal, 0.4)
    assert curve.points[:, 1].max() > 3.5


@pytest.mark.parametrize(
    ("goal", "radius", "shortest"),
    [
        ((5.0, 6.0, math.pi), 0.3, math.pi * 0.5),
        ((5.0, 7.0, math.pi), 0.5, math.pi),
        ((6.0, 6.0, 0.5 * math.pi), 0.5, math.pi * 0.5),
        ((5.0, 7.0), 0.5, math.pi),
    ],
)
def test_a_turn_is_hardly_longer_than_a_circle_that_the_robot_could_drive(goal, radius, shortest):
    curve = curve_of((5.0, 5.0, 0.0), goal, radius, [])
    assert_turns_and_headings(curve, (5.0, 5.0, 0.0), goal, radius)
    assert curve.length < 1.1 * shortest


def test_via_points_are_passed_between_turns():
    start, goal, via = (5.0, 5.0, math.pi), (15.0, 5.0, math.pi), (10.0, 9.0)
    curve = curve_of(start, goal, 0.3, via=(via,))
    assert_turns_and_headings(curve, start, goal, 0.3)
    points = curve.evaluate(np.linspace(0.0, curve.knots[-1], 100_001))
    assert np.hypot(*(points - via).T).min() < 1e-3


def beside_a_box(start, goal=(9.0, 4.4)):
    """The way of a robot that starts below a box, and its length."""
    robot = a_robot("A", start, goal, max_speed=0.6)
    return Pathfinder(a_scenario([robot], obstacles=[box(3, 1.5, 7, 6.5)], margin=0.04)).path(0)


@pytest.mark.parametrize("x", [3.5, 5.0, 6.0, 6.45, 6.8])
@pytest.mark.parametrize("heading", [0.0, -0.1, -0.15, -0.2, -0.25, -0.3])
def test_a_robot_beside_a_wall_goes_on_to_the_corner_without_a_loop(x, heading):
    free = beside_a_box((x, 1.18))
    assert beside_a_box((x, 1.18, heading)).length < free.length + 0.05


@pytest.mark.parametrize("seed", seeds(40))
def test_a_heading_that_leads_along_the_way_costs_next_to_nothing(seed):
    dice = random.Random(seed)
    x, y = dice.uniform(3.5, 6.5), 1.26 - dice.uniform(0.005, 0.2)
    goal = (dice.uniform(7.5, 9.5), dice.uniform(2.0, 7.5))
    free = beside_a_box((x, y), goal)
    along = free.derivatives([0.0], 1)[1][0]
    heading = math.atan2(along[1], along[0]) - dice.uniform(0.0, 0.4)
    assert beside_a_box((x, y, heading), goal).length < free.length + 0.1
