"""Graphs of places on generated floors, judged by distances to the ways along edges."""

import numpy as np
import pytest
import shapely

from coordinator.ground.grown_floor import GrownFloor
from coordinator.places.move_kernels import SOLVED
from coordinator.places.moves import find_moves
from coordinator.places.place_graph import place_graph
from sim.floors.generator import generate

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
