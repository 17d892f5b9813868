"""When no order works: somebody has to bend.

Finds pairs of robots that can pass each other in neither order (two that swap places on a line),
and gives one of them a path that keeps off the other's, beside it like a passing lane.
Decides: who takes another way.  Must not know: how orders are searched (schedule.py).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from coordinator.errors import PlanError
from coordinator.floor import Floor
from coordinator.junctions import Junctions
from coordinator.nurbs import Array, Nurbs
from coordinator.scenario import Point, Robot, Scenario
from coordinator.schedule import Deadlock

_LANE_ROOM = 0.01
_SPACING = 0.25
_PITCH = 0.2
_GRID_POINTS = 20_000
_REFUGE_ROOM = 0.1
_REFUGES = 6
_STRETCHES = ((0.0, 1.0), (0.25, 0.75), (0.6, 1.0), (0.0, 0.4), (0.75, 1.0), (0.0, 0.25))
"""Parts of another robot's path to keep beside of, as shares of its length."""


def blocking_pairs(junctions: Junctions, deadlock: Deadlock) -> list[tuple[int, int]]:
    """Return the loser of a deadlock with each winner that it meets, the last one first."""
    loser, near = deadlock.loser, set(junctions.near(deadlock.loser))
    return [
        (min(loser, other), max(loser, other))
        for other in reversed(deadlock.winners)
        if other in near
    ]


def lanes(scenario: Scenario, mover: int, other: int, path: Nurbs) -> Iterator[Array]:
    """Yield sets of places for `mover` to keep off, so that it passes `other` on its path.

    Each is (k, 3) [m]: x, y, radius.  First the whole path, then parts of it: where one leaves no
    way another may, and beside an end of the path a robot can step aside before a door.
    """
    robot = scenario.robots[mover]
    reach = scenario.need(robot, scenario.robots[other]) + _LANE_ROOM
    anchors = np.array([robot.start[:2], *robot.via, robot.goal[:2]])
    for low, high in _STRETCHES:
        count = 2 + int((high - low) * path.length / (_SPACING * reach))
        centers = path.at_arc(np.linspace(low, high, count) * path.length)
        apart = np.hypot(*(centers[:, None, :] - anchors).transpose(2, 0, 1)).min(axis=1)
        beside = centers[apart > 1.15 * reach]
        yield np.column_stack((beside, np.full(len(beside), reach)))


def refuges(
    scenario: Scenario, floor: Floor, mover: int, other: int, path: Nurbs
) -> Iterator[Point]:
    """Yield places where `mover` can wait clear of `other` on its path, the shortest way first.

    Looked for on a grid; no two are near each other.
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


def say_stuck(scenario: Scenario, paths: Sequence[Nurbs], pair: tuple[int, int]) -> PlanError:
    """Return the error that says who blocks whom, where, and what would help."""
    a, b = scenario.robots[pair[0]], scenario.robots[pair[1]]
    need = scenario.need(a, b)
    facts = [*_facts(a, b, paths[pair[1]], need), *_facts(b, a, paths[pair[0]], need)]
    because = ", ".join(facts) or "each is in the other's way"
    return PlanError(
        f"{a.id} and {b.id} block each other whoever goes first: {because}; no way around was "
        "found. A wider passage, a via point or another goal would help"
    )


def say_ring(scenario: Scenario, paths: Sequence[Nurbs], ring: Sequence[int]) -> PlanError:
    """Return the error for robots of which each has to go before the next, in a ring."""
    robots = [scenario.robots[index] for index in ring]
    facts = []
    for k, me in enumerate(robots):
        other, way = robots[(k + 1) % len(ring)], paths[ring[(k + 1) % len(ring)]]
        need = scenario.need(me, other)
        starts = [fact for fact in _facts(me, other, way, need) if "start" in fact]
        goals = [fact for fact in _facts(other, me, paths[ring[k]], need) if "goal" in fact]
        facts += (starts or goals)[:1]
    names = ", ".join(robot.id for robot in robots)
    return PlanError(
        f"{names} block each other in a ring: {', '.join(facts)}; no way around was found. "
        "A wider passage, a via point or another goal would help"
    )


def _facts(me: Robot, other: Robot, way: Nurbs, need: float) -> list[str]:
    """Say which of my places lie on another robot's way."""
    points = way.at_arc(np.linspace(0.0, way.length, 2 + int(way.length / 0.05)))
    facts = []
    for name, place in (("start", me.start), ("goal", me.goal)):
        if _nearest(points, np.array(place[:2])) < need:
            facts.append(
                f"{me.id}'s {name} ({place[0]:.2f}, {place[1]:.2f}) lies on {other.id}'s way"
            )
    return facts


def _nearest(points: Array, place: Array) -> float:
    return float(np.hypot(*(points - place).T).min())
