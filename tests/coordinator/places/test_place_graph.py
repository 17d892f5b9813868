"""Graphs of places on generated floors, judged by distances to the ways along edges."""

import numpy as np
import pytest
import shapely

from coordinator.ground.grown_floor import GrownFloor
from coordinator.places.move_kernels import SOLVED
from coordinator.places.moves import find_moves
from coordinator.places.place_graph import place_graph
from sim.floors.generator import generate
from tests.scenarios import a_robot, a_scenario, box

CURVES = 0.008
"""How far [m] paths of several legs leave the ways along edges."""


@pytest.mark.parametrize("kind", ["dense", "aisles", "doorway"])
def test_robots_that_move_keep_clear_of_those_that_are_not_in_the_way(kind):
    scenario = generate(kind, 12, 1)
    floor = GrownFloor(scenario.workspace.boundary, scenario.workspace.obstacles)
    graph = place_graph(scenario, floor, [robot.radius for robot in scenario.robots])
    edges, team = graph.edges, graph.team
    need = scenario.need(*scenario.robots[:2])
    ends = {*team.start.tolist(), *team.goal.tolist()}
    points = shapely.points(graph.places)
    for e, way in enumerate(graph.ways):
        near = slice(edges.near_first[e], edges.near_first[e + 1])
        closed = edges.near[near][edges.gap[near] < team.need[0, 0]]
        far = np.setdiff1d(np.arange(len(points)), closed)
        gaps = shapely.distance(shapely.linestrings(way), points[far])
        both = [v in ends and {edges.origin[e], edges.to[e]} & ends != set() for v in far.tolist()]
        assert (gaps >= need + np.where(both, 0.0, CURVES)).all()


@pytest.mark.parametrize("seed", range(12))
def test_robots_in_single_lanes_get_moves_that_keep_clear_of_everybody_at_rest(seed):
    scenario = generate("aisles", 20, seed)
    floor = GrownFloor(scenario.workspace.boundary, scenario.workspace.obstacles)
    graph = place_graph(scenario, floor, [robot.radius for robot in scenario.robots])
    outcome, moves = find_moves(graph)
    assert outcome == SOLVED
    at = np.array([robot.start for robot in scenario.robots])
    need = scenario.need(*scenario.robots[:2])
    for mover, edge in moves.tolist():
        way = graph.ways[edge]
        assert np.allclose(way[0], at[mover])
        others = shapely.points(np.delete(at, mover, axis=0))
        assert shapely.distance(shapely.linestrings(way), others).min() >= need
        at[mover] = way[-1]
    assert np.allclose(at, [robot.goal for robot in scenario.robots])


def graph_of(robots, size, obstacles=()):
    scenario = a_scenario(robots, size=size, obstacles=obstacles)
    floor = GrownFloor(scenario.workspace.boundary, scenario.workspace.obstacles)
    return place_graph(scenario, floor, [robot.radius for robot in scenario.robots])


def test_a_start_and_a_goal_that_differ_by_a_rounding_are_one_place():
    x = 0.1 + 0.2
    graph = graph_of([a_robot("A", (x, 1), (3, 1)), a_robot("B", (3, 3), (0.3, 1))], (4, 4))
    assert x != 0.3
    assert graph.team.start[0] == graph.team.goal[1]


def test_a_small_robot_beside_a_large_one_does_not_fill_a_hall_with_places():
    robots = [
        a_robot("A", (2, 2), (28, 2), radius=0.1),
        a_robot("B", (28, 28), (2, 28), radius=1.0),
    ]
    graph = graph_of(robots, (30, 30))
    assert len(graph.places) < 4_000
    assert len(graph.ways) < 100 * len(graph.places)
    walls = shapely.box(0, 0, 30, 30).exterior
    apart = shapely.distance(walls, shapely.points(graph.places))
    near = apart < 1.0 + 0.05
    assert near.sum() > 300, "where only the small one can be there are places for it"
    assert (~near).sum() < 250


def test_on_a_very_large_floor_places_are_farther_apart():
    robots = [
        a_robot("A", (2, 2), (98, 2), radius=0.1),
        a_robot("B", (98, 98), (2, 98), radius=0.1),
    ]
    graph = graph_of(robots, (100, 100), [box(5, 5, 95, 95)])
    assert len(graph.places) < 8_000
