"""Moves from place to place, judged by a joint breadth-first search and by driving them."""

import itertools
import random
from collections import deque

import numpy as np
import pytest

from coordinator.places import moves as searches
from coordinator.places.move_kernels import NONE, SOLVED, Edges, Team, costs_to, some_moves
from coordinator.places.place_graph import Graph

NEED = 1.0


def graph_of(joined, starts, goals, near=()):
    """A graph of unit edges; `near`: (edge, place) pairs, either way along the edge."""
    size = 1 + max(max(pair) for pair in joined)
    pairs = sorted([*joined, *((b, a) for a, b in joined)])
    closes = [sorted({a, b} | {v for (c, d), v in near if {c, d} == {a, b}}) for a, b in pairs]
    origin, to = (np.array(ends, dtype=np.int64) for ends in zip(*pairs, strict=True))
    edges = Edges(
        np.searchsorted(origin, np.arange(size + 1)),
        to,
        np.ones(len(pairs)),
        np.cumsum([0, *map(len, closes)]),
        np.concatenate(closes).astype(np.int64),
        np.zeros(sum(map(len, closes))),
        origin,
        np.array([pairs.index((b, a)) for a, b in pairs]),
    )
    fits, count = np.ones((1, len(pairs)), dtype=bool), len(starts)
    starts, goals = np.array(starts), np.array(goals)
    left = [costs_to(goals[k : k + 1], edges, fits[0], np.zeros(len(pairs))) for k in range(count)]
    team = Team(
        np.zeros(count, dtype=np.int64),
        starts,
        goals,
        np.array(left),
        np.zeros(count, dtype=np.int64),
        np.arange(size) == goals[:, None],
        np.full((1, 1), NEED),
        fits,
        np.zeros(count, dtype=np.bool_),
    )
    return Graph(np.zeros((size, 2)), edges, [np.zeros((2, 2))] * len(pairs), team)


def may_move(edges, at, robot, edge):
    closed = set(edges.near[edges.near_first[edge] : edges.near_first[edge + 1]].tolist())
    others = at[:robot] + at[robot + 1 :]
    return edges.origin[edge] == at[robot] and not closed & set(others)


def fewest(graph):
    """The least number of moves that brings all robots to their goals, None if there is none."""
    edges, goal = graph.edges, tuple(graph.team.goal.tolist())
    start = tuple(graph.team.start.tolist())
    known, queue = {start: 0}, deque([start])
    while queue:
        at = queue.popleft()
        if at == goal:
            return known[at]
        for robot in range(len(at)):
            for edge in range(len(edges.to)):
                if may_move(edges, at, robot, edge):
                    after = (*at[:robot], int(edges.to[edge]), *at[robot + 1 :])
                    if after not in known:
                        known[after] = known[at] + 1
                        queue.append(after)
    return None


def drive(graph, moves):
    """Drive the moves, each of which has to be possible; all robots have to arrive."""
    at = tuple(graph.team.start.tolist())
    for robot, edge in moves.tolist():
        assert may_move(graph.edges, at, robot, edge)
        at = (*at[:robot], int(graph.edges.to[edge]), *at[robot + 1 :])
    assert at == tuple(graph.team.goal.tolist())


def random_graph(seed):
    dice = random.Random(seed)
    size = dice.randint(4, 7)
    joined = {(dice.randrange(v), v) for v in range(1, size)}
    for _ in range(dice.randint(0, 2)):
        a, b = sorted(dice.sample(range(size), 2))
        joined.add((a, b))
    near = [(pair, dice.randrange(size)) for pair in sorted(joined) if dice.random() < 0.15]
    robots = dice.randint(2, min(4, size - 1))
    starts, goals = (dice.sample(range(size), robots) for _ in range(2))
    return graph_of(sorted(joined), starts, goals, near)


@pytest.mark.parametrize("seed", range(60))
def test_moves_are_found_whenever_there_are_any_and_are_the_fewest(seed):
    graph = random_graph(seed)
    best = fewest(graph)
    outcome, moves = searches.find_moves(graph)
    assert outcome == (NONE if best is None else SOLVED)
    if best is not None:
        drive(graph, moves)
        assert len(moves) == best


@pytest.mark.parametrize("seed", range(60))
def test_the_search_for_many_robots_finds_moves_whenever_there_are_any(seed):
    graph = random_graph(seed)
    best = fewest(graph)
    if not np.isfinite(graph.team.left[np.arange(len(graph.team.start)), graph.team.start]).all():
        assert best is None
        return
    outcome, moves = some_moves(graph.edges, graph.team, 200_000)
    assert outcome == (NONE if best is None else SOLVED)
    if best is not None:
        drive(graph, moves)
        drive(graph, searches._shortened(graph, moves))


def test_three_robots_exchange_places_at_a_junction():
    graph = graph_of([(0, 1), (1, 2), (2, 3), (3, 4), (2, 5), (5, 6)], [0, 4, 6], [4, 6, 0])
    outcome, moves = searches.find_moves(graph)
    assert outcome == SOLVED
    assert len(moves) == fewest(graph)
    drive(graph, moves)


def test_robots_are_brought_to_their_goals_one_after_the_other():
    lanes = [[10 * lane + k for k in range(6)] for lane in range(3)]
    joined = [(a, b) for lane in lanes for a, b in itertools.pairwise(lane)]
    names = {v: k for k, v in enumerate(sorted({v for pair in joined for v in pair}))}
    joined = [(names[a], names[b]) for a, b in joined]
    joined += [(0, 6), (6, 12), (5, 11), (11, 17)]
    starts, goals = [1, 2, 3, 7, 8, 9, 13, 14], [9, 8, 7, 3, 2, 14, 1, 13]
    graph = graph_of(joined, starts, goals)
    outcome, moves = searches.one_after_the_other(graph)
    assert outcome == SOLVED
    drive(graph, moves)
    short = searches._shortened(graph, moves)
    drive(graph, short)
    assert len(short) <= len(moves)
