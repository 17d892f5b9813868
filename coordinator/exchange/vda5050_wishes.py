"""Reads a VDA 5050 order of any program as places that a robot of a running fleet is to pass.

The coordinator finds the way between the places itself: trajectories are not kept.

Decides: what of an order counts here, and the wording of each problem.  Must not know: files, how
an order reaches a fleet.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from coordinator.base.errors import unreadable
from coordinator.exchange.vda5050_finder import Finder
from coordinator.exchange.vda5050_reading import robot_name
from coordinator.exchange.vda5050_sequence import in_sequence
from coordinator.scenario.checks import COORDINATE, Quantity, printable, show
from coordinator.scenario.model import Point
from protocol.messages import MOST_VIAS

_WAIT: Final = "wait"
_DURATION: Final = Quantity("s", most=86_400.0, from_least=True)
_HEADING: Final = Quantity("rad", least=-7.0, most=7.0)


class Wished(NamedTuple):
    """Where an order wants a robot: goal x, y [m] and perhaps heading [rad], places to pass [m].

    dwell [s]: how long it stands at the goal.  later: how many nodes are not released yet.
    """

    id: str
    robot: str
    goal: tuple[float, ...]
    via: tuple[Point, ...]
    dwell: float
    later: int


def read_wished(text: bytes, file: str, problems: list[str]) -> Wished | None:
    """Return what an order wants; None if it is invalid, with a line for each of its problems.

    Only released nodes count.  The first of several is where the robot is, and not passed again.
    """
    found = Finder(printable(file), problems)
    before = len(problems)
    try:
        order = json.loads(text)
    except (ValueError, RecursionError) as error:
        found.note("order", f"is not JSON: {unreadable(error)}")
        return None
    if not isinstance(order, dict):
        found.note("order", f"{show(order)} is not an object")
        return None
    robot, name = robot_name(order, found), _order_name(order, found)
    named = [(f"nodes[{i}]", one) for i, one in enumerate(found.items(order, "nodes", "nodes"))]
    for where, node in named:
        if not isinstance(node, dict):
            found.note(where, f"{show(node)} is not an object")
    nodes = in_sequence([one for one in named if isinstance(one[1], dict)], found)
    base = [one for one in nodes if one[1].get("released", True) is True]
    if not base and len(problems) == before:
        found.note("nodes", "none is released, so there is nowhere to drive to")
    places = [_place(node, where, found) for where, node in base]
    dwell = sum(_wait(*one, found, is_last=one is base[-1]) for one in base)
    via = places[1:-1]
    if len(via) > MOST_VIAS:
        found.note("nodes", f"{len(via)} to pass are more than {MOST_VIAS}")
    if len(problems) > before:
        return None
    passed = tuple((place[0], place[1]) for place in via)
    return Wished(name, robot, places[-1], passed, dwell, len(nodes) - len(base))


def _order_name(order: Mapping[str, Any], found: Finder) -> str:
    name = order.get("orderId")
    if not isinstance(name, str) or not name:
        found.note("orderId", "is missing" if name is None else f"{show(name)} is not a name")
        return ""
    return re.sub(r"[^A-Za-z0-9_.-]", "-", name)[:32]


def _place(node: Mapping[str, Any], where: str, found: Finder) -> tuple[float, ...]:
    """Return a node's place [m], with its heading [rad] if it states one."""
    position = node.get("nodePosition")
    where = f"{where}.nodePosition"
    if not isinstance(position, dict):
        what = "is missing" if position is None else f"{show(position)} is not an object"
        found.note(where, what)
        return (0.0, 0.0)
    place = [found.number(position.get(axis), f"{where}.{axis}", COORDINATE) for axis in "xy"]
    if position.get("theta") is not None:
        place.append(found.number(position["theta"], f"{where}.theta", _HEADING))
    return tuple(place)


def _wait(where: str, node: Mapping[str, Any], found: Finder, *, is_last: bool) -> float:
    """Return how long a robot stands at a node [s]; note actions that robots here do not know."""
    seconds = 0.0
    actions = [] if node.get("actions") is None else found.items(node, "actions", where)
    for i, action in enumerate(actions):
        place = f"{where}.actions[{i}]"
        kind = action.get("actionType") if isinstance(action, dict) else None
        if kind != _WAIT:
            found.note(place, f"{show(kind)} is no action that these robots know; wait is one")
        elif not is_last:
            found.note(place, "a robot waits at the last node alone")
        else:
            given = {
                str(one.get("key")): one.get("value")
                for one in found.items(action, "actionParameters", place)
                if isinstance(one, dict)
            }
            seconds += found.number(given.get("duration"), f"{place}.duration", _DURATION)
    return seconds
