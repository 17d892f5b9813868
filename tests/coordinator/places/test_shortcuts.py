"""Joined moves, driven one after the other past robots at rest."""

import random

import numpy as np
import pytest
import shapely

from coordinator.places.shortcuts import Moves, straightened

NEED = 0.9


def on_a_lattice(seed, size=5, robots=9, count=120):
    """Random moves of robots between neighbouring cells that nobody is at."""
    dice = random.Random(seed)
    cells = [(x, y) for x in range(size) for y in range(size)]
    at = dice.sample(cells, robots)
    starts, who, ways = np.array(at, dtype=float), [], []
    while len(who) < count:
        robot = dice.randrange(robots)
        x, y = at[robot]
        dx, dy = dice.choice([(1, 0), (-1, 0), (0, 1), (0, -1)])
        there = (x + dx, y + dy)
        if there in cells and there not in at:
            who.append(robot)
            ways.append(np.array([at[robot], there], dtype=float))
            at[robot] = there
    return Moves(who, ways, starts, np.full((robots, robots), NEED))


def drive(moves):
    """Drive the moves, each clear of all others at rest; return where everybody ends."""
    at = moves.starts.copy()
    for robot, way in zip(moves.robots, moves.ways, strict=True):
        assert np.array_equal(at[robot], way[0])
        others = np.delete(at, robot, axis=0)
        assert shapely.distance(shapely.linestrings(way), shapely.points(others)).min() >= NEED
        at[robot] = way[-1]
    return at


@pytest.mark.parametrize("seed", range(20))
def test_joined_moves_lead_to_the_same_places_past_robots_at_rest(seed):
    moves = on_a_lattice(seed)
    joined = straightened(moves, lambda _robot, _start, _end: True)
    assert np.array_equal(drive(joined), drive(moves))
    assert len(joined.ways) < len(moves.ways)


def test_moves_past_something_solid_are_not_joined():
    moves = on_a_lattice(1)
    kept = straightened(moves, lambda _robot, _start, _end: False)
    assert kept.robots == moves.robots
