"""Smooth paths: the documented formulas, C2, exact places, straight where the way is straight."""

import math

import numpy as np
import pytest

from coordinator.errors import PlanError
from coordinator.paths import Pathfinder
from coordinator.scenario import Robot, Scenario, Workspace
from coordinator.smoothing import smooth
from tests.oracles import naive_point


def anywhere(points):
    return np.ones(len(points), dtype=np.bool_)


def curve_along(polygon, exact=(), clear=anywhere, **options):
    polygon = np.array(polygon, dtype=float)
    flags = np.zeros(len(polygon), dtype=np.bool_)
    flags[[0, -1, *exact]] = True
    return smooth(polygon, flags, clear, **options)


def nearest(curve, place):
    s = np.linspace(0.0, curve.length, 20001)
    return float(np.hypot(*(curve.at_arc(s) - place).T).min())


def turned(theta, leg=1.0):
    return [(0, 0), (leg, 0), (leg + leg * math.cos(theta), leg * math.sin(theta))]


@pytest.mark.parametrize("degrees", [10, 45, 90, 99, -60])
def test_a_corner_is_cut_and_bent_as_the_formulas_say(degrees):
    theta, width = math.radians(degrees), 1.5
    curve = curve_along(turned(theta, 3.0))
    half = abs(theta) / 2
    assert nearest(curve, (3.0, 0.0)) == pytest.approx(width / 3 * math.sin(half), abs=1e-5)
    bend = np.abs(curve.curvature(np.linspace(0, curve.knots[-1], 4001)))
    wanted = 2 * math.sin(half) / (width * math.cos(half) ** 2)
    assert bend.max() == pytest.approx(wanted, rel=2e-3)


def test_the_bend_has_the_sign_of_the_turn():
    for degrees in (60, -60):
        curve = curve_along(turned(math.radians(degrees)))
        middle = curve.curvature(curve.parameter_at(curve.length / 2))[0]
        assert math.copysign(1, middle) == math.copysign(1, degrees)


def test_a_straight_way_stays_straight():
    curve = curve_along([(0, 0), (1, 0.5), (2, 1), (8, 4)], exact=[1, 2])
    points = curve.at_arc(np.linspace(0, curve.length, 101))
    assert np.abs(points[:, 1] - points[:, 0] / 2).max() < 1e-6
    assert curve.length == pytest.approx(math.hypot(8, 4), abs=1e-5)
    assert len(curve.points) == 4


def test_legs_are_straight_between_narrow_corners():
    curve = curve_along([(0, 0), (6, 0), (6, 6)])
    assert np.abs(curve.at_arc(np.linspace(0, 4.4, 50))[:, 1]).max() < 1e-5


def test_the_curve_has_a_continuous_second_derivative():
    zigzag = [(0, 0), (2, 0), (3, 1.5), (5, 1), (5, 3), (3, 3.2)]
    curve = curve_along(zigzag, exact=[2, 4])
    knots = np.unique(curve.knots)[1:-1]
    for order in range(3):
        before = curve.derivatives(knots - 1e-7, 2)[order]
        after = curve.derivatives(knots + 1e-7, 2)[order]
        np.testing.assert_allclose(before, after, atol=2e-4)
    assert np.diff(np.unique(curve.knots)).min() > 1e-6


@pytest.mark.parametrize("degrees", [0, 20, 80, 98, 120, 170, 180])
def test_via_points_are_passed_exactly(degrees):
    curve = curve_along(turned(math.radians(degrees), 2.0), exact=[1])
    assert nearest(curve, (2.0, 0.0)) < 1e-4
    u = np.linspace(0, curve.knots[-1], 2001)
    gaps = np.hypot(*(curve.evaluate(u) - [2.0, 0.0]).T)
    low, high = u[max(gaps.argmin() - 1, 0)], u[gaps.argmin() + 1]
    closest = np.hypot(*(curve.evaluate(np.linspace(low, high, 20001)) - [2.0, 0.0]).T).min()
    assert closest < 1e-6


def test_several_via_points_close_together_are_passed_exactly():
    vias = [(1.0, 0.0), (1.3, 0.4), (1.0, 0.9), (1.6, 1.2)]
    curve = curve_along([(0, 0), *vias, (3, 3)], exact=[1, 2, 3, 4])
    for via in vias:
        u = np.linspace(0, curve.knots[-1], 200001)
        assert np.hypot(*(curve.evaluate(u) - via).T).min() < 1e-5


def test_the_curve_begins_and_ends_where_asked():
    curve = curve_along([(0.1, 0.2), (3, 1), (4.4, 5.5)])
    for u, place in ((0.0, (0.1, 0.2)), (curve.knots[-1], (4.4, 5.5))):
        found = naive_point(3, curve.knots, curve.points, curve.weights, u)
        assert np.hypot(*(found - place)) < 1e-6


def test_all_numbers_are_those_of_the_wire():
    curve = curve_along([(0.1, 0.2), (3, 1), (4.4, 5.5)])
    for numbers in (curve.knots, curve.points):
        np.testing.assert_array_equal(numbers, numbers.astype(np.float32))


def test_a_corner_narrows_until_it_is_clear():
    def off_the_pillar(points):
        return np.hypot(points[:, 0] - 1.85, points[:, 1] - 0.35) > 0.3

    curve = curve_along([(0, 0), (2.2, 0), (2.4, 4)], clear=off_the_pillar)
    assert off_the_pillar(curve.at_arc(np.linspace(0, curve.length, 3000))).all()
    free = curve_along([(0, 0), (2.2, 0), (2.4, 4)])
    assert not off_the_pillar(free.at_arc(np.linspace(0, free.length, 3000))).all()


def test_a_corner_without_room_is_refused():
    def on_the_legs(points):
        return (np.abs(points[:, 1]) < 1e-4) | (np.abs(points[:, 0] - 2.0) < 1e-4)

    with pytest.raises(PlanError, match="no smooth way past"):
        curve_along([(0, 0), (2, 0), (2, 2)], clear=on_the_legs)


def test_a_turn_tighter_than_the_robot_turns_is_refused_and_a_wider_one_is_kept():
    with pytest.raises(PlanError, match=r"min_turn_radius is 0\.9 m"):
        curve_along([(0, 0), (2, 0), (2, 2)], min_turn_radius=0.9)
    curve = curve_along([(0, 0), (2, 0), (2, 2)], min_turn_radius=0.5)
    bend = np.abs(curve.curvature(np.linspace(0, curve.knots[-1], 5001))).max()
    assert 1 / bend >= 0.499


def heading_at(curve, end):
    first = curve.derivatives(0.0 if end == "start" else curve.knots[-1], 1)[1][0]
    return math.atan2(first[1], first[0])


@pytest.mark.parametrize("goal_heading", [-3.0, -1.6, 0.0, 1.6, 3.1])
@pytest.mark.parametrize("start_heading", [None, 0.0, 2.9])
@pytest.mark.parametrize("via", [(), ((5.0, 5.0),), ((6.5, 5.0), (9.0, 5.0))])
def test_headings_are_kept_however_sharply_the_path_must_turn(start_heading, goal_heading, via):
    start = (3.0, 5.0) if start_heading is None else (3.0, 5.0, start_heading)
    robot = Robot(
        id="A", start=start, goal=(7.0, 5.2, goal_heading), via=via, radius=0.2,
        max_speed=1.0, max_accel=1.0, max_lateral_accel=1.0,
    )  # fmt: skip
    floor = Workspace(boundary=((0, 0), (12, 0), (12, 10), (0, 10)))
    scenario = Scenario(name="t", workspace=floor, robots=(robot,))
    curve = Pathfinder(scenario).path(0)
    if start_heading is not None:
        assert abs(math.remainder(heading_at(curve, "start") - start_heading, math.tau)) < 1e-3
    assert abs(math.remainder(heading_at(curve, "goal") - goal_heading, math.tau)) < 1e-3
    for place in via:
        assert nearest(curve, place) < 1e-3
