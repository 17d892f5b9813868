"""Floors on which robots stand in each other's way: aisles, bays, a doorway, crowds, puzzles.

Decides: every robot's start and goal, which lie on seats; robots often have to make room for each
other, though there is room for it.  Must not know: how robots do that.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from random import Random
from typing import Final

from coordinator.base.errors import InputError
from coordinator.scenario.model import Point, Workspace
from sim.floors.layout import (
    SLACK,
    Box,
    Layout,
    Region,
    Ring,
    Size,
    Trip,
    Wish,
    floor_of,
    millimetres,
)

SHELF: Final = 0.8
"""Depth [m] of the shelves between aisles."""
SEATS_AN_AISLE: Final = 8
ROBOTS_AN_AISLE: Final = 4
"""On average; the other seats of an aisle are free."""
COVERED: Final = 0.15
"""Share of a dense floor that the robots' discs cover, unless a size is given."""
DENSE_TRIES: Final = 20_000
SHUFFLES: Final = 40
"""Moves per cell by which a puzzle is shuffled."""


def aisles(wish: Wish, dice: Random) -> Layout:
    """Return single-lane aisles between shelves, with robots standing in them.

    Robots go from a seat in an aisle to another one, past each other in the halls at both ends.
    """
    lane, seat = 2.0 * wish.reach, wish.need + 2.0 * SLACK
    count = max(2, math.ceil(wish.robots / ROBOTS_AN_AISLE))
    hall, long = 2.0 * lane, SEATS_AN_AISLE * seat
    size = _given(wish, (count * (lane + SHELF) - SHELF, 2.0 * hall + long), "aisles")
    shelves = [
        Box(x - SHELF, hall, x, hall + long).ring
        for x in (k * (lane + SHELF) for k in range(1, count))
    ]
    seats = [
        (column * (lane + SHELF) + 0.5 * lane, hall + (row + 0.5) * seat)
        for column in range(count)
        for row in range(SEATS_AN_AISLE)
    ]
    starts, goals = dice.sample(seats, wish.robots), dice.sample(seats, wish.robots)
    return _seated(floor_of(size, shelves), starts, goals)


def bays(wish: Wish, dice: Random) -> Layout:
    """Return a dead-end lane with two bays, in which the robots of a row change places."""
    lane, seat = 2.0 * wish.reach, wish.need + 2.0 * SLACK
    row = max(wish.robots, 2)
    size = _given(wish, ((row + 3) * seat + 2.0 * lane, 2.0 * lane + SLACK), "bays")
    width, height = size
    mouth = width - 2.0 * lane - seat, width - lane
    edges = [0.0, mouth[0], mouth[0] + lane, mouth[1], mouth[1] + lane]
    walls = [Box(edges[0], lane, edges[1], height), Box(edges[2], lane, edges[3], height)]
    starts = [((k + 0.5) * seat + 2.0 * SLACK, 0.5 * lane) for k in range(wish.robots)]
    return _seated(floor_of(size, [wall.ring for wall in walls]), starts, _moved(starts, dice))


def doorway(wish: Wish, dice: Random) -> Layout:
    """Return two rooms with a door that one robot passes; the robots of both change rooms."""
    seat = wish.need + 4.0 * SLACK
    side = math.ceil(math.sqrt(2.0 * math.ceil(wish.robots / 2.0))) + 1
    room, wall = side * seat + 2.0 * wish.reach - seat, 0.2
    size = _given(wish, (2.0 * room + wall, room), "doorway")
    door = 2.0 * wish.reach
    low = 0.5 * (room - door)
    walls = [Box(room, 0.0, room + wall, low).ring, Box(room, low + door, room + wall, room).ring]
    left = [
        (wish.reach + i * seat, wish.reach + j * seat)
        for i, j in itertools.product(range(side), repeat=2)
    ]
    right = [(2.0 * room + wall - x, y) for x, y in left]
    half = (wish.robots + 1) // 2
    rooms = [dice.sample(seats, len(seats)) for seats in (left, right, left, right)]
    starts = [*rooms[0][:half], *rooms[1][: wish.robots - half]]
    goals = [*rooms[3][:half], *rooms[2][: wish.robots - half]]
    return _seated(floor_of(size, walls), starts, goals)


def dense(wish: Wish, dice: Random) -> Layout:
    """Return an open floor of which the robots cover a good part, at random places."""
    side = math.sqrt(wish.robots * math.pi * wish.radius**2 / COVERED)
    size = wish.size or (math.ceil(10.0 * max(side, 4.0 * wish.reach)) / 10.0,) * 2
    floor = floor_of(size)
    return _seated(floor, _scattered(wish, size, dice), _scattered(wish, size, dice))


def puzzle(wish: Wish, dice: Random) -> Layout:
    """Return a box with as many cells as robots and one hole or a few, shuffled by moves."""
    side = max(2, math.ceil(math.sqrt(wish.robots + 1)))
    seat = wish.need + SLACK
    span = (side - 1) * seat + 2.0 * wish.reach
    size = _given(wish, (span, span), "puzzle")
    cells = [
        (wish.reach + column * seat, wish.reach + row * seat)
        for row, column in itertools.product(range(side), repeat=2)
    ]
    holds = [index if index < wish.robots else -1 for index in range(len(cells))]
    for _ in range(SHUFFLES * len(cells)):
        at = dice.randrange(len(cells))
        step = dice.choice((1, -1, side, -side))
        to = at + step
        if holds[at] < 0 or not 0 <= to < len(cells) or holds[to] >= 0:
            continue
        if abs(step) == 1 and at // side != to // side:
            continue
        holds[at], holds[to] = -1, holds[at]
    goals = [cells[holds.index(robot)] for robot in range(wish.robots)]
    return _seated(floor_of(size), cells[: wish.robots], goals)


def _given(wish: Wish, size: Size, kind: str) -> Size:
    """Return the size that a kind has, rounded up; InputError when another one is asked for."""
    if wish.size is not None:
        raise InputError([f"--size: {kind} have the size that their robots need"])
    return math.ceil(size[0] * 1000.0) / 1000.0, math.ceil(size[1] * 1000.0) / 1000.0


def _moved(places: Sequence[Point], dice: Random) -> list[Point]:
    """Return the same places in another order, if there is one."""
    moved = list(places)
    while len(moved) > 1 and moved == list(places):
        dice.shuffle(moved)
    return moved


def _scattered(wish: Wish, size: Size, dice: Random) -> Ring:
    """Return random places, each two of them as far apart as robots at rest have to be."""
    found: list[Point] = []
    for _ in range(DENSE_TRIES):
        if len(found) == wish.robots:
            return millimetres(found)
        x, y = (dice.uniform(wish.reach, side - wish.reach) for side in size)
        if all(math.hypot(x - a, y - b) >= wish.need + SLACK for a, b in found):
            found.append((x, y))
    raise InputError([f"--robots: {wish.robots} do not fit on this floor, only {len(found)} do"])


def _seated(floor: Workspace, starts: Sequence[Point], goals: Sequence[Point]) -> Layout:
    trips = [
        Trip(Region(Box(*start, *start)), Region(Box(*goal, *goal)))
        for start, goal in zip(starts, goals, strict=True)
    ]
    return Layout(floor, tuple(trips), least_trip=0.0)
