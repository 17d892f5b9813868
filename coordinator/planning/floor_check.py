"""Whether a floor is well formed for its fleet: no robot that rests closes a way of another.

On such a floor every order comes to its end (Cap, Vokrinek and Kleiner 2015): a robot that finds no
way among the others can wait until all of them rest.

Decides: which places close a way.  Must not know: plans, times, orders under way.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import shapely

from coordinator.scenario.model import Point, Scenario

_ROOM = 1e-3
"""Ways are this much [m] wider than needed, because circles are replaced by polygons."""

_QUARTER = 16
"""Segments of a quarter of a circle."""


class ClosedWay(NamedTuple):
    """A place that closes the way between two other places while a robot rests there [m]."""

    name: str
    place: Point
    one: str
    other: str


def closed_ways(scenario: Scenario) -> list[ClosedWay]:
    """Return the places to rest that close a way for the largest robot, with one such way each.

    Places to rest are the starts, goals and homes of robots, and the goals of orders and demand.
    """
    largest = max((robot.radius for robot in scenario.robots), default=0.0)
    reach = largest + scenario.margin
    floor = shapely.Polygon(scenario.workspace.boundary)
    solid = [shapely.Polygon(ring) for ring in scenario.workspace.obstacles]
    free = floor.buffer(-reach, quad_segs=_QUARTER)
    free = free.difference(shapely.union_all([one.buffer(reach - _ROOM) for one in solid]))
    places = list(_places(scenario))
    apart = 2.0 * largest + scenario.margin
    found = []
    for name, place in places:
        others = [one for one in places if math.dist(one[1], place) >= apart]
        pieces = shapely.get_parts(free)
        left = free.difference(shapely.Point(place).buffer(apart - _ROOM, quad_segs=_QUARTER))
        parts = shapely.get_parts(left)
        groups: dict[int, tuple[int, str]] = {}
        for other, at in others:
            before, after = _index(pieces, at), _index(parts, at)
            known = groups.setdefault(before, (after, other))
            if before >= 0 and after != known[0]:
                found.append(ClosedWay(name, place, known[1], other))
                break
    return found


def _index(parts: object, place: Point) -> int:
    """Return which part a place is in or nearest to; -1 if there is none."""
    distances = shapely.distance(parts, shapely.Point(place))
    return int(distances.argmin()) if len(distances) else -1


def _places(scenario: Scenario) -> Iterator[tuple[str, Point]]:
    """Yield every place where a robot may rest, with a name; each place once."""
    seen: set[Point] = set()
    named: list[tuple[str, tuple[float, ...]]] = []
    for robot in scenario.robots:
        named += [(f"{robot.id}'s start", robot.start), (f"{robot.id}'s goal", robot.goal)]
        named += [] if robot.home is None else [(f"{robot.id}'s home", robot.home)]
    named += [(f"the goal of order {order.id}", order.goal) for order in scenario.orders]
    if scenario.demand is not None:
        named += [(f"demand.places[{k}]", one) for k, one in enumerate(scenario.demand.places)]
    for name, pose in named:
        place = (pose[0], pose[1])
        if place not in seen:
            seen.add(place)
            yield name, place
