"""Corner cases of paths: places that touch, round pillars, sharp turns, robots inside things."""

import math
import random

import numpy as np
import pytest
import shapely

from coordinator.base.errors import PlanError
from coordinator.ground.free_space import NO_DISCS
from coordinator.ground.polygon_kernels import push
from coordinator.motion.cornering import Handling
from tests.coordinator.ground.test_configuration_space import SLACK, find, ground_of, way_length
from tests.coordinator.ground.test_corner_kernels import solid_of_space
from tests.coordinator.paths.test_path_planner import path_of
from tests.coordinator.paths.test_smoothing import curve_along, nearest
from tests.floors import box
from tests.oracles_floor import VisibilityGraph, convex_corners
from tests.scenarios import a_robot


def test_a_place_between_arc_and_tangent_polygon_is_reached_from_everywhere():
    obstacle, reach, dice = box(4, 3, 6, 5), 0.3, random.Random(0)
    ground, solid = ground_of([obstacle], reach), shapely.box(4, 3, 6, 5)
    inner, outer = (solid.buffer(r, quad_segs=64) for r in (reach - 1e-4, reach))
    graph = VisibilityGraph(inner, convex_corners(outer))
    for _ in range(30):
        angle, apart = dice.uniform(0.0, math.pi / 2), dice.uniform(1.0, 1.019) * reach
        place = np.array([6 + apart * math.cos(angle), 5 + apart * math.sin(angle)])
        goal = np.array([dice.choice((1.0, 9.0)), dice.uniform(0.5, 7.5)])
        for way in (
            ground.shortest_way(place, goal, NO_DISCS),
            ground.shortest_way(goal, place, NO_DISCS),
        ):
            assert way is not None
            assert shapely.distance(solid, shapely.LineString(way)) > reach - 2 * SLACK
            assert way_length(way) < 1.01 * graph.length(place, goal)


def test_two_places_beside_corners_do_not_see_each_other_through_what_is_between():
    for ends in (((6.03, 5.2992), (3.97, 5.2992)), ((6.3003, 5.0105), (6.0105, 5.3003))):
        way = find([box(4, 3, 6, 5)], *ends, reach=0.3)
        assert shapely.distance(shapely.box(4, 3, 6, 5), shapely.LineString(way)) > 0.3 - 2 * SLACK


def test_no_line_slips_between_two_edges_of_a_round_pillar():
    for count in (16, 20, 24, 32, 64):
        for radius in np.arange(0.1, 2.0, 0.05):
            ring = [
                (
                    5 + radius * math.cos(2 * math.pi * k / count),
                    4 + radius * math.sin(2 * math.pi * k / count),
                )
                for k in range(count)
            ]
            ground = ground_of([ring], 0.2, box(-3, -4, 13, 12))
            for k in range(count // 2):
                ray = 6.0 * np.array(
                    [math.cos(2 * math.pi * k / count), math.sin(2 * math.pi * k / count)]
                )
                assert not ground.clear(np.array([5.0, 4.0]) - ray, np.array([5.0, 4.0]) + ray)


def test_a_place_just_outside_of_a_disc_is_reached_from_behind_it():
    ground = ground_of([], 0.2)
    disc = np.array([[5.0, 4.0, 1.0]])
    angle = math.radians(2.0)
    place = np.array([5 + 1.03 * math.cos(angle), 4 + 1.03 * math.sin(angle)])
    for ends in (((3.0, 5.5), place), ((3.0, 2.5), place), ((1.0, 4.0), place)):
        way = ground.shortest_way(np.array(ends[0]), place, disc)
        straight = math.dist(*ends)
        assert way is not None
        assert way_length(way) < 1.5 * straight


def test_a_via_at_a_sharp_turn_is_passed_exactly_with_unequal_legs():
    curve = path_of([a_robot("A", (2.5, 4.9), (7.9, 4.5), via=((1.9, 1.7),))])
    assert nearest(curve, (1.9, 1.7)) < 1e-4


@pytest.mark.parametrize("degrees", [110, 150, 175, 180, -130])
@pytest.mark.parametrize("legs", [(2.0, 6.0), (0.5, 3.0), (4.0, 1.0)])
def test_a_via_at_a_turn_too_sharp_to_round_is_passed_exactly(degrees, legs):
    theta = math.radians(degrees)
    way = [
        (0, 0),
        (legs[0], 0),
        (legs[0] + legs[1] * math.cos(theta), legs[1] * math.sin(theta) + 1e-9),
    ]
    for lateral in (0.2, 1.0, math.inf):
        curve = curve_along(way, exact=[1], lateral=lateral, accel=1.0)
        assert nearest(curve, (legs[0], 0.0)) < 1e-4


@pytest.mark.parametrize("apart", [1e-4, 5e-4, 1.3e-3, 4e-3])
@pytest.mark.parametrize("leaves", [True, False])
def test_a_robot_that_touches_a_round_pillar_swings_out_and_does_not_turn_back(apart, leaves):
    """The ground is grown by straight edges: a place may lie within it by less than their sagitta.

    A way from there, or to there, backs out of the ground first.
    """
    outer = 0.3 / math.cos(math.pi / 24)
    angles = np.arange(0.5, 24.5) * math.pi / 12
    pillar = [(3 + outer * math.cos(a), 3 + outer * math.sin(a)) for a in angles.tolist()]
    solid = shapely.Polygon(pillar)
    for degrees in range(0, 360, 5):
        angle = math.radians(degrees)
        ray = shapely.LineString(((3, 3), (3 + math.cos(angle), 3 + math.sin(angle))))
        place = ray.intersection(solid.buffer(0.22 + apart, quad_segs=256).exterior).coords[0]
        beyond = (3 - 1.5 * math.cos(angle + 0.5), 3 - 1.5 * math.sin(angle + 0.5))
        ends = (place, beyond) if leaves else (beyond, place)
        curve = path_of([a_robot("A", *ends, radius=0.2)], [pillar])
        bends = np.abs(curve.curvature(np.linspace(0.0, curve.knots[-1], 2001)))
        assert 1.0 / bends.max() > 0.04


def test_pushing_keeps_its_budget_for_robots_that_turn_on_the_spot():
    pillar = solid_of_space([box(4.2, 0.2, 5, 3)], reach=0.2)
    polygon, exact = (
        np.array([(0, 0), (5.201, -0.001), (5.2, 4)], float),
        np.zeros(3, dtype=np.bool_),
    )
    moved = push(polygon, exact, 1, 2, 0.1, Handling(accel=0.2, lateral=0.2).numbers(), pillar)
    assert (
        np.hypot(*np.diff(moved, axis=0).T).sum() - np.hypot(*np.diff(polygon, axis=0).T).sum()
        <= 0.1
    )


def test_a_way_from_a_place_to_itself_has_no_length():
    for obstacles in ([], [box(4, 3, 6, 5)]):
        assert way_length(find(obstacles, (1, 1), (1, 1))) == 0.0


def test_robots_inside_an_obstacle_get_no_path():
    told = r"^A: stands at \(4.00, 4.00\), which is inside obstacle 0$"
    with pytest.raises(PlanError, match=told):
        path_of([a_robot("A", (4.0, 4.0), (6.0, 4.0))], [box(2, 1, 8, 7)], check=False)
