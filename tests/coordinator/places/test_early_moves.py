"""Moves that start at times, judged by where the robots are at samples, and by trying all moves."""

import itertools
import math
import random

import numpy as np
import pytest

from benchmarks.flow import circle
from coordinator.paths.path_planner import Pathfinder
from coordinator.places.early_moves import early_moves, early_plans
from coordinator.places.move_kernels import SOLVED, Edges, Team, costs_to
from coordinator.places.moves import find_moves
from coordinator.places.place_graph import Graph, place_graph

NEED = 0.8
GAP = 0.3
STEP = 0.05


def graph_of(cells, starts, goals):
    """Places in the middle of free cells of 1 m, joined to their neighbours by straight edges."""
    places = sorted(cells)
    number = {cell: k for k, cell in enumerate(places)}
    pairs = sorted(
        (number[x, y], number[x + dx, y + dy])
        for x, y in places
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1))
        if (x + dx, y + dy) in number
    )
    origin, to = np.array(pairs, dtype=np.int64).T.copy()
    at = np.array(places, dtype=float)
    edges = Edges(
        np.searchsorted(origin, np.arange(len(places) + 1)),
        to,
        np.ones(len(pairs)),
        np.arange(0, 2 * len(pairs) + 1, 2),
        np.array(pairs, dtype=np.int64).ravel(),
        np.zeros(2 * len(pairs)),
        origin,
        np.array([pairs.index((b, a)) for a, b in pairs]),
    )
    fits, count = np.ones((1, len(pairs)), dtype=bool), len(starts)
    starts, goals = (np.array([number[cell] for cell in ends]) for ends in (starts, goals))
    nothing = np.zeros(len(pairs))
    left = [costs_to(goals[k : k + 1], edges, fits[0], nothing) for k in range(count)]
    team = Team(
        np.zeros(count, dtype=np.int64), starts, goals, np.array(left),
        np.zeros(count, dtype=np.int64), np.arange(len(places)) == goals[:, None],
        np.full((1, 1), NEED), fits, np.zeros(count, np.bool_),
    )  # fmt: skip
    return Graph(at, edges, [at[list(pair)] for pair in pairs], team)


def random_graph(seed, width=6, height=5, robots=8, share=0.2):
    dice = random.Random(seed)
    while True:
        floor = itertools.product(range(width), range(height))
        cells = [cell for cell in floor if dice.random() > share]
        graph = graph_of(cells, dice.sample(cells, robots), dice.sample(cells, robots))
        outcome, moves = find_moves(graph, 0)
        if outcome == SOLVED:
            return graph, moves


def legs_of(plans, robot):
    size = plans.size[robot]
    return list(zip(plans.edge[robot, :size].tolist(), plans.start[robot, :size], strict=True))


def where(graph, plans, times):
    """Where every robot is at some times: (robots, times, 2)."""
    found = []
    for robot, start in enumerate(graph.team.start):
        knots, places = [-1.0], [graph.places[start]]
        for edge, begin in legs_of(plans, robot):
            knots += [begin, begin + 1.0]
            places += [graph.places[graph.edges.origin[edge]], graph.places[graph.edges.to[edge]]]
        found.append(np.column_stack([np.interp(times, knots, xs) for xs in np.array(places).T]))
    return np.array(found)


@pytest.mark.parametrize("seed", range(25))
def test_robots_keep_apart_at_all_times_and_arrive_no_later_than_by_moves_in_turn(seed):
    graph, moves = random_graph(seed)
    plans, in_turn = early_plans(graph, moves, GAP)
    for robot, (start, goal) in enumerate(zip(graph.team.start, graph.team.goal, strict=True)):
        here, free = start, 0.0
        for edge, begin in legs_of(plans, robot):
            assert graph.edges.origin[edge] == here
            assert begin >= free - 1e-9
            here, free = graph.edges.to[edge], begin + 1.0
        assert here == goal
        assert plans.arrival[robot] == pytest.approx(free)
    times = np.arange(0.0, plans.arrival.max() + 1.0, STEP)
    at = where(graph, plans, times)
    for late in range(round(GAP / STEP) + 1):
        apart = np.hypot(*np.moveaxis(at[:, None, late:] - at[None, :, : len(times) - late], 3, 0))
        apart[np.arange(len(at)), np.arange(len(at))] = math.inf
        assert apart.min() > NEED - 0.001
    assert plans.arrival.sum() <= in_turn + 1e-3
    assert plans.arrival.sum() >= graph.team.left[range(len(at)), graph.team.start].sum() - 1e-6


@pytest.mark.parametrize("seed", range(25))
def test_in_the_order_of_their_starts_moves_can_be_driven_one_after_the_other(seed):
    graph, moves = random_graph(seed)
    at = graph.team.start.copy()
    early, share, _ = early_moves(graph, moves, GAP)
    assert 0.0 < share <= 1.0
    for robot, edge in early.tolist():
        assert graph.edges.origin[edge] == at[robot]
        assert graph.edges.to[edge] not in np.delete(at, robot)
        at[robot] = graph.edges.to[edge]
    assert at.tolist() == graph.team.goal.tolist()


def least_sum(graph, most):
    """The least sum of arrivals by at most `most` moves, each of which starts as soon as it can."""
    line = np.linspace(0.0, 1.0, 401)
    ways = [way[0] + line[:, None] * (way[1] - way[0]) for way in graph.ways]
    clear = np.zeros((len(ways), len(ways)))
    for e, f in itertools.product(range(len(ways)), repeat=2):
        gaps = np.hypot(*(ways[e][:, None] - ways[f][None, :]).T).min(axis=0)
        clear[e, f] = -math.inf if gaps.min() >= NEED else line[gaps < NEED].max() + GAP
    best = math.inf
    goals = graph.team.goal.tolist()

    def go(at, free, done):
        nonlocal best
        left = [graph.team.left[k, v] for k, v in enumerate(at)]
        if sum(free) + sum(left) >= best or len(done) + sum(left) > most:
            return
        if at == goals:
            best = sum(free)
            return
        for robot, here in enumerate(at):
            for e in range(graph.edges.first[here], graph.edges.first[here + 1]):
                if graph.edges.to[e] in at:
                    continue
                begin = max(
                    [free[robot], *(b + clear[f, e] for other, f, b in done if other != robot)]
                )
                there, then = at.copy(), free.copy()
                there[robot], then[robot] = int(graph.edges.to[e]), begin + 1.0
                go(there, then, [*done, (robot, e, begin)])

    go(graph.team.start.tolist(), [0.0] * len(goals), [])
    return best


def test_a_robot_steps_into_a_bay_and_back_as_early_as_possible():
    cells = [*((x, 0) for x in range(5)), (1, 1)]
    graph = graph_of(cells, [(1, 0), (4, 0)], [(4, 0), (0, 0)])
    best = least_sum(graph, 10)
    _, moves = find_moves(graph)
    found = early_plans(graph, moves, GAP)[0].arrival.sum()
    assert found == pytest.approx(best, abs=0.02)
    assert best > 8.0


@pytest.mark.parametrize("seed", range(6))
def test_two_robots_among_few_places_arrive_as_early_as_possible(seed):
    graph, moves = random_graph(seed, 3, 3, 2, 0.15)
    found = early_plans(graph, moves, GAP)[0].arrival.sum()
    best = least_sum(graph, int(graph.team.left[[0, 1], graph.team.start].sum()) + 4)
    assert found == pytest.approx(best, abs=0.02)


def test_places_less_than_a_rounding_error_apart_do_not_lead_to_each_other_for_ever():
    scenario = circle(14)
    radii = [robot.radius for robot in scenario.robots]
    graph = place_graph(scenario, Pathfinder(scenario).floor, radii)
    outcome, moves = find_moves(graph)
    assert outcome == SOLVED
    plans, in_turn = early_plans(graph, moves, GAP, effort=500)
    assert plans.arrival.sum() < in_turn
