"""Smooth paths: clear by an independent dense check, C2, straight where the way is, exact vias."""

import itertools
import math
import random

import numpy as np
import pytest
import shapely

from coordinator.base.errors import PlanError, TurnError
from coordinator.ground.free_space import NO_DISCS, Space
from coordinator.ground.grown_floor import GrownFloor
from coordinator.motion.cornering import Handling
from coordinator.paths.path_planner import Pathfinder
from coordinator.paths.smoothing import smooth
from coordinator.scenario.model import Robot, Scenario, Workspace
from tests.floors import KINDS, box, random_floor, random_places, solid_of
from tests.sweeps import enough, seeds

WIDE = box(-50, -50, 50, 50)
MARGIN = 0.02
FLOAT32 = 2.5e-6
"""What the numbers of the wire may take from the clearance of a robot that stands flush [m]."""


def space_on(obstacles=(), reach=0.2, discs=NO_DISCS, boundary=WIDE):
    ground = GrownFloor(boundary, obstacles).ground(reach)
    return Space(ground, reach, discs=np.asarray(discs, float))


def curve_along(polygon, exact=(), space=None, headed=(False, False), **handling):
    polygon = np.array(polygon, dtype=float)
    flags = np.zeros(len(polygon), dtype=np.bool_)
    flags[[0, -1, *exact]] = True
    return smooth(polygon, flags, space or space_on(), Handling(**handling), headed).curve


def nearest(curve, place):
    """How near a curve comes to a place, sampled finer and finer."""
    u = np.linspace(0.0, curve.knots[-1], 4001)
    for _ in range(3):
        gaps = np.hypot(*(curve.evaluate(u) - place).T)
        k = int(gaps.argmin())
        u = np.linspace(u[max(k - 1, 0)], u[min(k + 1, len(u) - 1)], 1001)
    return float(gaps.min())


def turned(theta, leg=3.0):
    return [(0, 0), (leg, 0), (leg + leg * math.cos(theta), leg * math.sin(theta))]


def tightest(curve):
    knots = np.unique(curve.knots)
    parts = [np.linspace(a, b, 60) for a, b in itertools.pairwise(knots)]
    return 1.0 / max(np.abs(curve.curvature(np.concatenate(parts))).max(), 1e-9)


def assert_c2(curve):
    """Single inner knots make a cubic C2; its second derivative must meet at each of them."""
    inner = curve.knots[3:-3]
    size = np.diff(inner)
    assert (size > 0.0).all()
    low, high = (curve.derivatives(inner[:-1] + size * part, 2)[2] for part in (0.25, 0.75))
    arriving, leaving = (1.5 * high - 0.5 * low)[:-1], (1.5 * low - 0.5 * high)[1:]
    third = (np.hypot(*(high - low).T) / size).max()
    assert np.hypot(*(arriving - leaving).T).max(initial=0.0) < 1e-2 + 1e-4 * third


def clear_by(curve, solid, reach, count=2500):
    """Whether dense samples, at all spans and along the whole, keep a distance."""
    knots = np.unique(curve.knots)
    spans = [np.linspace(a, b, 12) for a, b in itertools.pairwise(knots)]
    u = np.concatenate((np.linspace(0.0, knots[-1], count), *spans))
    return not shapely.dwithin(solid, shapely.points(curve.evaluate(u)), reach).any()


def robots_on_500_floors():
    """One robot without headings or vias on each of the floors, where there is room for two."""
    for seed in seeds(510):
        floor, dice = random_floor(seed), random.Random(seed)
        places = random_places(floor, 2, seed)
        if len(places) < 2:
            continue
        robot = Robot(
            id="R1", start=tuple(places[0]), goal=tuple(places[1]), radius=floor.reach - MARGIN,
            max_speed=0.8, max_accel=0.8, max_lateral_accel=dice.choice((0.1, 0.8, 0.8, math.inf)),
        )  # fmt: skip
        workspace = Workspace(
            boundary=tuple(floor.boundary), obstacles=tuple(map(tuple, floor.obstacles))
        )
        scenario = Scenario(name="t", workspace=workspace, robots=(robot,), margin=MARGIN)
        yield floor, places, Pathfinder(scenario)


def test_on_500_floors_curves_are_clear_c2_float32_and_hardly_longer_than_the_shortest_polygon():
    ratios = []
    for floor, ends, finder in robots_on_500_floors():
        way = finder.floor.ground(floor.reach).shortest_way(*ends, NO_DISCS)
        if way is None:
            with pytest.raises(PlanError, match=r"^R1: has no way from"):
                finder.path(0)
            continue
        curve = finder.path(0)
        assert clear_by(curve, solid_of(floor), floor.reach - FLOAT32), floor
        assert_c2(curve)
        for numbers in (curve.knots, curve.points):
            np.testing.assert_array_equal(numbers, numbers.astype(np.float32))
        np.testing.assert_allclose(curve.evaluate([0.0, curve.knots[-1]]), ends, atol=1e-6)
        ratios.append(curve.length / np.hypot(*np.diff(way, axis=0).T).sum())
    assert len(ratios) > enough(450)
    assert np.median(ratios) <= 1.01
    assert max(ratios) <= 1.03


def test_all_kinds_of_floors_take_part():
    kinds = [floor.kind for floor, _, _ in robots_on_500_floors()]
    assert {kind for kind in KINDS if kinds.count(kind) > enough(20)} == set(KINDS)


@pytest.mark.parametrize("degrees", [10, 45, 90, 99, -60])
def test_a_free_corner_is_as_wide_as_costs_no_speed(degrees):
    theta = math.radians(degrees)
    curve = curve_along(turned(theta), speed=1.0, lateral=1.0, accel=1.0)
    half = abs(theta) / 2
    width = min(2 * math.sin(half) / math.cos(half) ** 2, 2.7)
    assert nearest(curve, (3.0, 0.0)) == pytest.approx(width / 3 * math.sin(half), abs=1e-4)
    assert tightest(curve) == pytest.approx(
        width * math.cos(half) ** 2 / (2 * math.sin(half)), rel=2e-3
    )


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


def test_doubled_vertices_change_nothing():
    once = curve_along([(0, 0), (3, 0), (3, 4)])
    twice = curve_along([(0, 0), (0, 0), (3, 0), (3, 0), (3, 4), (3, 4)])
    np.testing.assert_array_equal(once.points, twice.points)
    np.testing.assert_array_equal(once.knots, twice.knots)


@pytest.mark.parametrize("lateral", [0.2, 1.0, math.inf])
@pytest.mark.parametrize("degrees", [0, 20, 80, 99, -45])
def test_via_points_are_passed_exactly(degrees, lateral):
    curve = curve_along(turned(math.radians(degrees), 2.0), exact=[1], lateral=lateral, accel=1.0)
    assert nearest(curve, (2.0, 0.0)) < 1e-5


def test_several_via_points_close_together_are_passed_exactly():
    vias = [(1.0, 0.0), (1.3, 0.4), (1.0, 0.9), (1.6, 1.2)]
    curve = curve_along([(0, 0), *vias, (3, 3)], exact=[1, 2, 3, 4])
    for via in vias:
        assert nearest(curve, via) < 1e-5


@pytest.mark.parametrize("degrees", [120, 170, 180, -150])
def test_turns_too_sharp_to_round_are_driven_as_two(degrees):
    curve = curve_along(turned(math.radians(degrees), 4.0), lateral=1.0, accel=1.0)
    assert_c2(curve)
    assert tightest(curve) > 0.05
    np.testing.assert_allclose(curve.evaluate(0.0)[0], (0, 0), atol=1e-6)


def test_a_corner_narrows_until_it_is_clear():
    pillar = [box(1.6, 0.25, 1.9, 3.0)]
    polygon = [(0, 0), (2.2, 0), (2.2, 4)]
    with_pillar = curve_along(polygon, space=space_on(pillar), lateral=0.5, accel=0.5)
    assert clear_by(with_pillar, shapely.box(1.6, 0.25, 1.9, 3.0), 0.2 - 1e-6)
    free = curve_along(polygon, lateral=0.5, accel=0.5)
    assert not clear_by(free, shapely.box(1.6, 0.25, 1.9, 3.0), 0.2)
    assert tightest(with_pillar) < tightest(free)


def test_curves_keep_off_other_robots_places():
    disc = (1.7, 0.5, 0.45)
    curve = curve_along([(0, 0), (2.2, 0), (2.2, 4)], space=space_on(discs=[disc]), lateral=0.5)
    assert nearest(curve, disc[:2]) > 0.45 - 1.1e-3
    assert nearest(curve_along([(0, 0), (2.2, 0), (2.2, 4)], lateral=0.5), disc[:2]) < 0.44


def test_a_corner_without_room_is_refused():
    walls = [box(-1, 0.2, 1.8, 3), box(-1, -3, 5, -0.2), box(2.2, -0.2, 5, 3)]
    with pytest.raises(PlanError, match="no smooth way past"):
        curve_along([(0, 0), (2, 0), (2, 2)], space=space_on(walls, reach=0.2))


def test_a_turn_tighter_than_the_robot_turns_is_refused_and_a_wider_one_is_kept():
    polygon = [(0, 0), (2, 0), (2, 2)]
    with pytest.raises(TurnError, match=r"min_turn_radius is 0\.9 m") as caught:
        curve_along(polygon, min_turn_radius=0.9)
    assert 0.3 < caught.value.radius < 0.9
    assert tightest(curve_along(polygon, min_turn_radius=0.5)) >= 0.499


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
