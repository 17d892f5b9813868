"""Bends are proven between all places: narrow peaks are found, and nothing else is refused."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from msgspec import structs

from coordinator.curves.nurbs import nurbs
from coordinator.curves.nurbs_kernels import arc_table, series
from coordinator.plan.document import Limits
from coordinator.plan.wire import drive
from coordinator.planning.planner import plan_scenario
from coordinator.proof.limit_kernels import too_sharp
from coordinator.proof.limits import limit_failures
from protocol.timeline import Timeline
from tests.coordinator.curves.random_curves import random_curve
from tests.scenarios import a_robot, a_scenario, box
from tests.sweeps import seeds


def sharpest(curve, knots_s, squares, power=1, count=200_000):
    """The greatest v^2 times a power of curvature by dense sampling of places."""
    s = np.unique(np.concatenate((np.linspace(0.0, curve.length, count), knots_s)))
    leg = np.clip(np.searchsorted(knots_s, s, side="right") - 1, 0, len(knots_s) - 2)
    part = (s - knots_s[leg]) / np.diff(knots_s)[leg]
    first, last = squares[leg].T
    bend = np.abs(curve.curvature(curve.parameter_at(s)))
    return float(np.max((first + np.clip(part, 0.0, 1.0) * (last - first)) * bend**power))


def asked(curve, knots_s, squares, most, power=1):
    form = series(*curve.lifted)
    return too_sharp(form, arc_table(*form), knots_s, squares, power, most)


@pytest.mark.parametrize("power", [1, 2])
@pytest.mark.parametrize("seed", seeds(12))
def test_a_limit_is_proven_above_the_sharpest_place_and_refused_below_it(seed, power):
    dice = np.random.default_rng(seed)
    curve = random_curve(dice)
    knots_s = np.linspace(0.0, curve.length, 5)
    squares = dice.uniform(0.1, 1.0, (4, 2))
    most = sharpest(curve, knots_s, squares, power)
    assert asked(curve, knots_s, squares, 1.001 * most, power) == -1.0
    at = asked(curve, knots_s, squares, 0.999 * most, power)
    assert 0.0 <= at <= curve.length


def test_a_peak_of_millimetres_is_found():
    points = [(0, 0), (1, 0), (1.98, 0), (2, 0.01), (2.02, 0), (3, 0), (4, 0)]
    curve = nurbs(3, [0, 0, 0, 0, 0.496, 0.5, 0.504, 1, 1, 1, 1], points)
    ends, ones = np.array([0.0, curve.length]), np.ones((1, 2))
    most = float(np.abs(curve.curvature(np.linspace(0.0, 1.0, 100_001))).max())
    assert asked(curve, ends, ones, 0.999 * most) == pytest.approx(0.5 * curve.length, abs=0.1)
    assert asked(curve, ends, ones, 1.001 * most) == -1.0


def test_a_straight_line_is_never_too_sharp():
    curve = nurbs(3, [0, 0, 0, 0, 1, 1, 1, 1], [(1, 1), (2, 2), (3, 3), (5, 5)])
    assert asked(curve, np.array([0.0, curve.length]), np.full((1, 2), 100.0), 1e-6) == -1.0


CORNERS = {
    "a right angle of degree 1": (1, [0, 0, 1, 2, 2], [(0, 0), (5, 0), (5, 5)]),
    "a reversal": (1, [0, 0, 1, 2, 2], [(0, 0), (5, 0), (0, 0.001)]),
    "a cubic with a threefold knot": (
        3,
        [0, 0, 0, 0, 1, 1, 1, 2, 2, 2, 2],
        [(0, 0), (2, 0), (4, 0), (5, 0), (5, 1), (5, 3), (5, 5)],
    ),
}


@pytest.mark.parametrize("name", CORNERS)
def test_corners_where_spans_meet_are_refused(name):
    degree, knots, points = CORNERS[name]
    curve = nurbs(degree, knots, points)
    length = curve.length
    line = Timeline([0.0, 0.5, length - 0.5, length], [0.0, 0.8, 0.8, 0.0], [], [])
    plan = SimpleNamespace(brake_mmps2=1_000)
    driven = SimpleNamespace(id="A", curve=curve, timeline=line, plan=plan)
    limits = Limits(max_speed=1.0, max_accel=1.0, max_lateral_accel=1.0)
    assert any("corner" in said for said in limit_failures(driven, limits))


@pytest.mark.parametrize(
    ("told", "is_kept"), [(0, False), (999, True), (1_000, True), (1_001, False)]
)
def test_a_robot_may_not_be_told_to_brake_harder_than_it_can(told, is_kept):
    curve = nurbs(1, [0, 0, 1, 1], [(0, 0), (4, 0)])
    line = Timeline([0.0, 1.0, 3.0, 4.0], [0.0, 0.8, 0.8, 0.0], [], [])
    plan = SimpleNamespace(brake_mmps2=told)
    driven = SimpleNamespace(id="A", curve=curve, timeline=line, plan=plan)
    failures = limit_failures(driven, Limits(max_speed=1.0, max_accel=1.0))
    assert any("brake" in said for said in failures) is not is_kept


@pytest.mark.parametrize(("rate", "holds"), [(None, True), (1.0, True), (0.7, False), (0.1, False)])
def test_a_robot_may_not_turn_faster_than_it_can(rate, holds):
    """A quarter of a circle of radius 1 m at 0.8 m/s, between two straight stretches of 2 m."""
    curve = a_quarter_between_straights()
    length = curve.length
    line = Timeline([0.0, 0.5, length - 0.5, length], [0.0, 0.8, 0.8, 0.0], [], [])
    driven = SimpleNamespace(
        id="A", curve=curve, timeline=line, plan=SimpleNamespace(brake_mmps2=1_000)
    )
    limits = Limits(max_speed=1.0, max_accel=1.0, max_turn_rate=rate)
    failures = limit_failures(driven, limits)
    assert [said for said in failures if "turns faster" not in said] == []
    assert (failures == []) is holds


def a_quarter_between_straights():
    half = math.sqrt(0.5)
    points = [(0, 0), (1, 0), (2, 0), (3, 0), (3, 1), (3, 2), (3, 3)]
    weights = [1.0, 1.0, 1.0, half, 1.0, 1.0, 1.0]
    return nurbs(2, [0, 0, 0, 2, 2, 3, 3, 5, 5, 5], points, weights)


def test_plans_keep_to_turn_rates_that_their_bends_do_not_allow_at_speed():
    slow = a_scenario(
        [a_robot("A", (1.0, 4.0), (9.0, 4.0), max_turn_rate=0.3)],
        obstacles=[box(4.0, 2.0, 6.0, 8.0)],
    )
    free = structs.replace(
        slow, robots=tuple(structs.replace(one, max_turn_rate=math.inf) for one in slow.robots)
    )
    assert greatest_turn_rate(slow) <= 0.3 * 1.001 < 0.5 < greatest_turn_rate(free)


def greatest_turn_rate(scenario):
    """Of a scenario's first robot, as its message says, by dense sampling [rad/s]."""
    driven = drive(plan_scenario(scenario))[0]
    line = driven.timeline
    s = np.linspace(0.0, line.length, 20_000)
    bend = np.abs(driven.curve.curvature(driven.curve.parameter_at(s)))
    leg = np.clip(np.searchsorted(line.s0, s, side="right") - 1, 0, len(line.s0) - 1)
    ends = np.append(line.s0, line.length)
    part = (s - ends[leg]) / (ends[leg + 1] - ends[leg])
    squares = np.square(line.v0)[leg] * (1.0 - part) + np.square(line.v1)[leg] * part
    return float(np.max(np.sqrt(squares) * bend))


def test_a_course_may_not_begin_faster_than_its_robot_can_drive():
    """It goes on from another course, and slows down from its first place on."""
    curve = nurbs(1, [0, 0, 1, 1], [(0, 0), (4, 0)])
    plan = SimpleNamespace(brake_mmps2=1_000)
    for first, is_kept in ((1.0, True), (1.2, False)):
        line = Timeline([0.0, 1.0, 3.0, 4.0], [first, 0.8, 0.8, 0.0], [], [])
        driven = SimpleNamespace(id="A", curve=curve, timeline=line, plan=plan)
        failures = limit_failures(driven, Limits(max_speed=1.0, max_accel=1.0), from_rest=False)
        assert (failures == []) is is_kept
