"""Checks of orders and demand: whom and what they name, and where they send robots.

Decides: which orders can be given at all, how far apart the places of a demand are, and the wording
of each fault.  Must not know: ranges of numbers (scenario/checks.py), when orders are given.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
import shapely

from coordinator.scenario.id_checks import doubled_ids
from coordinator.scenario.model import Demand, Order, Point, Pose, Scenario
from coordinator.scenario.place_checks import (
    MOST_PAIRS,
    ROUNDING,
    Numbers,
    Spot,
    missing_steps,
    near_pairs,
)

OWN: Final = ("join-", "leave-", "room-", "way-")
"""Ids of orders that begin so are the coordinator's own."""

OWN_IN_WORDS: Final = f"ids that begin with {', '.join(OWN)} are the coordinator's own"

LEAST_FREE: Final = 2
"""A demand has at least this many places that no robot holds or is bound for at first."""

_NAMED: Final = 4
"""At most this many orders of a cycle are named; of a longer one they are counted."""


def order_problems(scenario: Scenario) -> Iterator[str]:
    """Yield what is wrong with a scenario's orders and its demand, except for want of room."""
    orders = scenario.orders
    yield from doubled_ids("orders", [order.id for order in orders])
    for index, order in enumerate(orders):
        if order.id.startswith(OWN):
            yield f"orders[{index}].id: {order.id!r} is not allowed: {OWN_IN_WORDS}"
    if scenario.demand is not None:
        yield from _demand_ids(scenario, scenario.demand)
    yield from _unknown_names(scenario)
    yield from _cycles(orders)
    for index, order in enumerate(orders):
        yield from missing_steps(f"orders[{index}]", _places(index, order))
    if scenario.demand is not None and scenario.demand.places:
        yield from _demand_problems(scenario, scenario.demand)


def _demand_ids(scenario: Scenario, demand: Demand) -> Iterator[str]:
    """Yield a message for each id that the orders of the demand, ROBOT-1 and so on, must not have.

    A robot's name decides those ids, and no other order may have one of them.
    """
    robots = {robot.id for robot in scenario.robots}
    for index, robot in enumerate(scenario.robots):
        if f"{robot.id}-" in OWN:
            yield f"robots[{index}].id: {robot.id!r} gets orders by a demand: {OWN_IN_WORDS}"
    for index, order in enumerate(scenario.orders):
        robot_id, _, number = order.id.rpartition("-")
        counts = range(1, demand.per_robot + 1)
        if robot_id in robots and number.isdecimal() and int(number) in counts:
            yield f"orders[{index}].id: {order.id!r} is the id of an order of the demand"


def order_spots(scenario: Scenario) -> Iterator[Spot]:
    """Yield the places to which orders and demand send robots.

    Where the coordinator chooses the robot, the place must have room for the smallest one.
    """
    radii = {robot.id: robot.radius for robot in scenario.robots}
    least = min(filter(math.isfinite, radii.values()), default=math.nan)
    for index, order in enumerate(scenario.orders):
        need = radii.get(order.robot, least) + scenario.margin
        for field, place in _places(index, order):
            yield Spot(field, place[0], place[1], need)
    for index, place in enumerate(scenario.demand.places if scenario.demand else ()):
        yield Spot(f"demand.places[{index}]", place[0], place[1], least + scenario.margin)


def _places(index: int, order: Order) -> list[tuple[str, Point | Pose]]:
    """Return (field, place) of an order's via points and its goal, in the order of driving."""
    vias = [(f"orders[{index}].via[{i}]", via) for i, via in enumerate(order.via)]
    return [*vias, (f"orders[{index}].goal", order.goal)]


def _unknown_names(scenario: Scenario) -> Iterator[str]:
    """Yield a message for each name of no robot, or no order; none where some name is invalid."""
    robots = {robot.id for robot in scenario.robots}
    ids = {order.id for order in scenario.orders}
    for index, order in enumerate(scenario.orders):
        if order.robot and order.robot not in robots and robots and "" not in robots:
            yield f"orders[{index}].robot: {order.robot!r} is no robot of the scenario"
        if order.after and order.after not in ids and "" not in ids:
            yield f"orders[{index}].after: {order.after!r} is no order of the scenario"


def _cycles(orders: Sequence[Order]) -> Iterator[str]:
    """Yield a message for each cycle of orders that wait for one another."""
    before = {order.id: order.after for order in orders if order.id and order.after}
    places = {order.id: index for index, order in enumerate(orders)}
    seen: set[str] = set()
    for order in orders:
        chain: list[str] = []
        name = order.id
        while name in before and name not in seen:
            seen.add(name)
            chain.append(name)
            name = before[name]
        if name in chain:
            others = [repr(one) for one in chain[chain.index(name) + 1 :]]
            listed = ", ".join(others) if len(others) <= _NAMED else f"{len(others)} others"
            way = f", by way of {listed}" if others else ""
            yield f"orders[{places[name]}].after: {name!r} would wait for itself{way}"


def _demand_problems(scenario: Scenario, demand: Demand) -> Iterator[str]:
    """Yield a message for each two places that are too near together, and if too few are free."""
    radii = np.array([robot.radius for robot in scenario.robots if math.isfinite(robot.radius)])
    places = np.array([place[:2] for place in demand.places])
    if not len(radii) or not math.isfinite(scenario.margin):
        return
    largest = np.full(len(places), radii.max())
    pairs = near_pairs(places, largest, scenario.margin)
    need = 2.0 * radii.max() + scenario.margin
    for first, second, gap in itertools.islice(pairs, MOST_PAIRS):
        yield (
            f"demand.places[{second}]: is {gap:.6g} m from places[{first}], "
            f"two of the largest robots + margin need {need:.6g} m"
        )
    if next(pairs, None) is not None:
        yield f"demand.places: over {MOST_PAIRS} pairs are too near, the rest is not listed"
    free = len(places) - _taken(scenario, places, float(radii.min()))
    if free < LEAST_FREE:
        yield (
            f"demand.places: {free} of {len(places)} are free at first, at least {LEAST_FREE} "
            "must be places that no robot stands at or drives to"
        )


def _taken(scenario: Scenario, places: Numbers, least: float) -> int:
    """Return at how many places robots stand or will at first, so that no other has room there.

    `least` [m]: the radius of the smallest robot.
    """
    goals = np.array([robot.goal[:2] for robot in scenario.robots])
    reach = np.array([robot.radius for robot in scenario.robots]) + least + scenario.margin
    tree = shapely.STRtree(shapely.points(places[np.isfinite(places[:, 0])]))
    known = np.isfinite(goals[:, 0]) & np.isfinite(reach)
    _, taken = tree.query(
        shapely.points(goals[known]), predicate="dwithin", distance=reach[known] - ROUNDING
    )
    return len(set(taken.tolist()))
