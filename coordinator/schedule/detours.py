"""Detours for when no order of the robots works.

Finds pairs of robots that can pass each other in neither order, for instance two that swap places
on a line, and places that one of them has to avoid or pass: a lane beside the other's path, or a
refuge.  Decides: who takes a detour.  Must not know: how orders are searched (priority_order.py).
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely

from coordinator.curves.nurbs import Array, Nurbs
from coordinator.ground.grown_floor import GrownFloor
from coordinator.scenario.model import Point, Scenario
from coordinator.schedule.junctions import Junctions
from coordinator.schedule.priority_order import Deadlock

_LANE_ROOM = 0.01
_SPACING = 0.25
_MOST_BESIDE = 2000
_PITCH = 0.2
_GRID_POINTS = 20_000
_REFUGE_ROOM = 0.1
_REFUGES = 6
_STRETCHES = ((0.0, 1.0), (0.25, 0.75), (0.6, 1.0), (0.0, 0.4), (0.75, 1.0), (0.0, 0.25))
"""Parts of the other robot's path to stay clear of, from and to, as shares of its length."""


def blocking_pairs(junctions: Junctions, deadlock: Deadlock) -> list[tuple[int, int]]:
    """Pair a deadlock's loser with each winner that it shares zones with, last winner first."""
    loser, near = deadlock.loser, set(junctions.near(deadlock.loser))
    return [
        (min(loser, other), max(loser, other))
        for other in reversed(deadlock.winners)
        if other in near
    ]


def lanes(
    scenario: Scenario, mover: int, other: int, path: Nurbs, most: int = _MOST_BESIDE
) -> Iterator[Array]:
    """Yield sets of discs for `mover` to stay out of, so that it passes `other` on its path.

    Each set is (k, 3) [m]: x, y, radius.  The first covers the whole path, the others parts of it:
    where one set leaves no way, another may, and near an end of the path a robot can step aside
    before a door.  Sets of more than `most` discs are left out, because the time to find a way
    around them grows with the third power of their number.
    """
    robot = scenario.robots[mover]
    reach = scenario.need(robot, scenario.robots[other]) + _LANE_ROOM
    anchors = np.array([robot.start[:2], *robot.via, robot.goal[:2]])
    for low, high in _STRETCHES:
        count = 2 + int((high - low) * path.length / (_SPACING * reach))
        if count > most:
            continue
        centers = path.at_arc(np.linspace(low, high, count) * path.length)
        apart = np.hypot(*(centers[:, None, :] - anchors).transpose(2, 0, 1)).min(axis=1)
        beside = centers[apart > 1.15 * reach]
        yield np.column_stack((beside, np.full(len(beside), reach)))


def refuges(
    scenario: Scenario, floor: GrownFloor, mover: int, other: int, path: Nurbs
) -> Iterator[Point]:
    """Yield places where `mover` can wait clear of `other` on its path, the shortest way first.

    The places lie on a grid, and no two are near each other.
    """
    robot = scenario.robots[mover]
    need = scenario.need(robot, scenario.robots[other]) + _LANE_ROOM
    x0, y0, x1, y1 = floor.outline.bounds
    pitch = max(_PITCH, math.sqrt((x1 - x0) * (y1 - y0) / _GRID_POINTS))
    grid = np.stack(np.meshgrid(np.arange(x0, x1, pitch), np.arange(y0, y1, pitch)), axis=-1)
    spots = grid.reshape(-1, 2)
    spots = spots[floor.distance(spots) > robot.radius + scenario.margin + _LANE_ROOM]
    places = np.linspace(0.0, path.length, 2 + int(path.length / 0.05))
    way = shapely.linestrings(path.at_arc(places))
    shapely.prepare(way)
    spots = spots[shapely.distance(way, shapely.points(spots)) > need + _REFUGE_ROOM]
    detour = np.hypot(*(spots - robot.start[:2]).T) + np.hypot(*(spots - robot.goal[:2]).T)
    taken: list[Array] = []
    for spot in spots[np.argsort(detour, kind="stable")]:
        if all(np.hypot(*(spot - place)) > 2.0 * need for place in taken):
            taken.append(spot)
            yield float(spot[0]), float(spot[1])
        if len(taken) == _REFUGES:
            return
