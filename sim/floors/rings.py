"""Robots on a ring: those that go round an island, and those that go straight across.

Decides: the places, which are not random: starts and goals alternate around a circle.  Must not
know: who drives first.
"""

from __future__ import annotations

import math
from random import Random
from typing import Final

from coordinator.base.errors import InputError
from coordinator.scenario.model import Point, Workspace
from sim.floors.layout import (
    MARGIN,
    SLACK,
    Box,
    Layout,
    Region,
    Ring,
    Trip,
    Wish,
    floor_of,
    millimetres,
)

SIDES: Final = 48
"""Corners of the island and of the outer wall of a ring."""
TURN: Final = 0.35
"""Goals on a ring lie about this share of a turn ahead of the starts."""
SPREAD: Final = 0.125
"""The goals' distances ahead differ from TURN by up to this share of a turn."""
LEAST_CIRCLE: Final = 4.0
"""The least radius [m] of a circle unless a size is given."""


def ring(wish: Wish, dice: Random) -> Layout:
    """Return a roundabout: all robots go counter-clockwise; starts and goals are on the outer side.

    The road around the island is wide enough for two robots side by side to pass parked ones.
    """
    outside = wish.reach + SLACK
    road = outside + 2.0 * (wish.need + SLACK) + wish.reach
    if wish.size is not None and min(wish.size) <= 2.0 * (road + MARGIN):
        raise InputError([f"--size: a ring needs more than {2 * (road + MARGIN):.3g} m each way"])
    radius, middle = _circle(wish, outside)
    wall = _polygon(middle, (radius + outside) / math.cos(math.pi / SIDES))
    island = _polygon(middle, radius + outside - road)
    floor = Workspace(boundary=wall, obstacles=(island,))
    count = wish.robots
    ahead = 2 * round(TURN * count - 0.5) + 1 if count > 1 else 1
    order = list(range(count))
    window = max(1, round(SPREAD * count))
    for begin in range(0, count, window):
        part = order[begin : begin + window]
        dice.shuffle(part)
        order[begin : begin + window] = part
    return _seated(floor, radius, middle, [2 * goal + ahead for goal in order], dice)


def circle(wish: Wish, dice: Random) -> Layout:
    """Return an empty floor where the goal of each robot is on the other side of a circle.

    An odd number of robots goes straight through the middle.  With an even number the opposite
    place is another robot's start, so each goal is half a place farther, and all straight ways are
    tangents of a small circle.
    """
    radius, middle = _circle(wish, 0.5 * wish.lane)
    ahead = wish.robots + (wish.robots + 1) % 2
    goals = [2 * index + ahead for index in range(wish.robots)]
    floor = floor_of((2.0 * middle[0], 2.0 * middle[1]))
    return _seated(floor, radius, middle, goals, dice)


def _circle(wish: Wish, outside: float) -> tuple[float, Point]:
    """Return radius and middle [m] of a circle with room for a start and a goal per robot."""
    apart = wish.apart + SLACK
    if wish.size is None:
        radius = max(LEAST_CIRCLE, 0.5 * apart / math.sin(math.pi / (2 * wish.robots)))
        side = math.ceil(2.0 * (radius + outside)) / 2.0
        return radius, (side, side)
    width, height = wish.size
    radius = 0.5 * min(width, height) - outside
    most = int(0.5 * math.pi / math.asin(0.5 * apart / radius)) if radius > 0.5 * apart else 0
    if wish.robots > most:
        floor = f"{width:g} m x {height:g} m"
        raise InputError(
            [f"--robots: {wish.robots} do not fit around a floor of {floor}, only {most} do"]
        )
    return radius, (0.5 * width, 0.5 * height)


def _seated(
    floor: Workspace, radius: float, middle: Point, goals: list[int], dice: Random
) -> Layout:
    """Return the layout of robots that start on every second seat, with their goals on given seats.

    Seats are places at equal distances around the circle.  Which robot gets which seat, and where
    the first seat lies, is random.
    """
    seats = 2 * len(goals)
    first = dice.uniform(0.0, math.tau)
    trips = []
    for index, goal in enumerate(goals):
        angles = [first + math.tau * seat / seats for seat in (2 * index, goal)]
        start, end = (_on_circle(middle, radius, angle) for angle in angles)
        trips.append(Trip(Region(Box(*start, *start)), Region(Box(*end, *end))))
    dice.shuffle(trips)
    return Layout(floor, tuple(trips), least_trip=0.0)


def _polygon(middle: Point, radius: float) -> Ring:
    return millimetres(
        _on_circle(middle, radius, math.tau * corner / SIDES) for corner in range(SIDES)
    )


def _on_circle(middle: Point, radius: float, angle: float) -> Point:
    return middle[0] + radius * math.cos(angle), middle[1] + radius * math.sin(angle)
