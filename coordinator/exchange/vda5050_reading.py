"""Reads VDA 5050 orders of any program as given paths of a scenario's robots.

Decides: what an order must contain, the defaults for what it leaves out, and the wording of each
problem.  Must not know: files, floors (the scenario with the floor, if any, is an argument).
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np

from coordinator.base.errors import unreadable
from coordinator.curves.nurbs import Nurbs
from coordinator.curves.splines import joined, joined_count
from coordinator.exchange.vda5050_finder import Finder
from coordinator.exchange.vda5050_nodes import check_ends, read_nodes
from coordinator.exchange.vda5050_sequence import in_sequence
from coordinator.paths.corners import corners
from coordinator.paths.given_path import exact, path_of
from coordinator.plan.checks import PathNames
from coordinator.plan.path_parts import MOST_POINTS, given_faults, too_many
from coordinator.scenario.checks import (
    COORDINATE,
    ROBOT_QUANTITIES,
    Quantity,
    printable,
    show,
)
from coordinator.scenario.model import (
    TURN_RATE,
    GivenPath,
    Point,
    Robot,
    Scenario,
    Workspace,
)
from coordinator.scenario.place_checks import LEAST_STEP

_NAMES: Final = PathNames(
    knots="knotVector", points="controlPoints", weights="controlPoints.weight"
)
_WEIGHT: Final = Quantity()
_KNOT: Final = Quantity(least=-math.inf, most=math.inf)
_SPEEDS: Final = ("maximumSpeed", "maxSpeed")

_GAP: Final = 1e-3
"""Trajectories are joined if one ends within this distance [m] of where the next one begins."""

_ROOM: Final = 1.0
"""A floor that is made for the paths reaches this much farther [m] than the robots need."""


class Ordered(NamedTuple):
    """What an order states: the robot, its curve, and limits that apply everywhere on it.

    speed [m/s]: the lowest speed limit of any edge, inf if none is stated.  deviation [m]: the
    least deviation that a node allows, inf if none is stated.
    """

    robot: str
    curve: Nurbs
    speed: float
    deviation: float


class Assumed(NamedTuple):
    """Defaults for what orders do not state.

    radius [m]; max_speed [m/s]; rounding [m]: by how much corners may be cut.
    """

    radius: float
    max_speed: float
    rounding: float


def read_order(text: bytes, file: str, problems: list[str]) -> Ordered | None:
    """Return what an order states; None if it is invalid.

    All its problems are added to `problems`, one line each.
    """
    found = Finder(printable(file), [])
    try:
        order = json.loads(text)
    except (ValueError, RecursionError) as error:
        order = {}
        found.note("order", f"is not JSON: {unreadable(error)}")
    else:
        if not isinstance(order, dict):
            found.note("order", f"{show(order)} is not an object")
            order = {}
    if not found.problems:
        robot = robot_name(order, found)
        parts, speed = _parts(order, found)
        deviation = read_nodes(order, found)
    problems += found.problems
    if found.problems:
        return None
    return Ordered(robot, joined(parts), speed, deviation)


def scenario_of(
    orders: Iterable[Ordered], name: str, assumed: Assumed, like: Scenario | None
) -> Scenario:
    """Return a scenario whose robots drive the paths of orders.

    Floor, margin, tau, and the limits of robots of the same name are those of the scenario `like`.
    Without it the floor is a rectangle around all paths.  A path with corners gets a rounding.
    """
    known = {} if like is None else {robot.id: robot for robot in like.robots}
    robots = tuple(_robot(order, assumed, known) for order in orders)
    if like is not None:
        return Scenario(
            **{key: getattr(like, key) for key in like.__struct_fields__}
            | {"robots": robots, "name": name}
        )
    bare = Scenario(name=name, workspace=Workspace(boundary=()), robots=robots)
    places = np.array(
        [point for robot in robots if robot.path for point in robot.path.control_points]
    )
    room = assumed.radius + bare.margin + _ROOM
    (x0, y0), (x1, y1) = (places.min(axis=0) - room).tolist(), (places.max(axis=0) + room).tolist()
    floor = Workspace(boundary=((x0, y0), (x1, y0), (x1, y1), (x0, y1)))
    return Scenario(name=name, workspace=floor, robots=robots)


def _robot(order: Ordered, assumed: Assumed, known: Mapping[str, Robot]) -> Robot:
    """Return the robot of an order; it is never faster than the order permits."""
    path = path_of(order.curve)
    cut = min(assumed.rounding, order.deviation)
    path = GivenPath(
        degree=path.degree,
        control_points=path.control_points,
        knots=path.knots,
        weights=path.weights,
        rounding=cut if corners(order.curve) else 0.0,
    )
    twin = known.get(order.robot)
    speed = min(order.speed, assumed.max_speed if twin is None else twin.max_speed)
    if twin is None and math.isfinite(order.speed):
        speed = order.speed
    return Robot(
        id=order.robot,
        start=path.control_points[0],
        goal=path.control_points[-1],
        path=path,
        radius=assumed.radius if twin is None else twin.radius,
        max_speed=speed,
        max_accel=speed if twin is None else twin.max_accel,
        max_lateral_accel=speed if twin is None else twin.max_lateral_accel,
        min_turn_radius=0.0 if twin is None else twin.min_turn_radius,
        max_turn_rate=TURN_RATE if twin is None else twin.max_turn_rate,
        priority=0 if twin is None else twin.priority,
    )


def robot_name(order: Mapping[str, Any], found: Finder) -> str:
    """Return the serial number as a robot's id; a dash replaces characters that ids cannot have."""
    name = order.get("serialNumber")
    if not isinstance(name, str) or not name:
        found.note("serialNumber", "is missing" if name is None else f"{show(name)} is not a name")
        return ""
    name = re.sub(r"[^A-Za-z0-9_.-]", "-", name)[:32]
    return name if name.strip(".") else name.replace(".", "-")


def _parts(order: Mapping[str, Any], found: Finder) -> tuple[list[Nurbs], float]:
    """Return the curves of an order's edges, in sequence, and the lowest speed limit [m/s]."""
    before = len(found.problems)
    edges = found.items(order, "edges", "edges")
    if not edges and len(found.problems) == before:
        found.note("edges", "is empty, so there is nothing to drive")
    named = [(f"edges[{i}]", edge) for i, edge in enumerate(edges)]
    for where, edge in named:
        if not isinstance(edge, dict):
            found.note(where, f"{show(edge)} is not an object")
    if len(found.problems) > before:
        return [], math.inf
    named = in_sequence(named, found)
    in_order = len(found.problems) == before
    speed = min((_speed(edge, where, found) for where, edge in named), default=math.inf)
    curves = [(where, _trajectory(edge, where, found)) for where, edge in named]
    check_ends(order, named, found)
    if in_order:
        _check_gaps(curves, found)
    parts = [curve for _, curve in curves if curve is not None]
    count = joined_count(parts)
    if count > MOST_POINTS:
        found.note("edges", f"their control points are {too_many(count)}")
    return parts, speed


def _speed(edge: Mapping[str, Any], where: str, found: Finder) -> float:
    given = [key for key in _SPEEDS if edge.get(key) is not None]
    allowed = ROBOT_QUANTITIES["max_speed"]
    speeds = [found.number(edge[key], f"{where}.{key}", allowed) for key in given]
    return min(speeds, default=math.inf)


def _trajectory(edge: Mapping[str, Any], where: str, found: Finder) -> Nurbs | None:
    """Return an edge's curve; the defaults are degree 1, weights of 1 and uniform knots."""
    where = f"{where}.trajectory"
    value = edge.get("trajectory")
    if not isinstance(value, dict):
        found.note(where, "is missing" if value is None else f"{show(value)} is not an object")
        return None
    before = len(found.problems)
    degree = value.get("degree", 1)
    if type(degree) is not int:
        found.note(f"{where}.degree", f"{show(degree)} is not a whole number")
    points, weights = _control_points(value, where, found)
    knots: tuple[float, ...] = ()
    if value.get("knotVector") is not None:
        given = found.items(value, "knotVector", f"{where}.knotVector")
        places = (f"{where}.knotVector[{i}]" for i in range(len(given)))
        knots = tuple(found.number(u, at, _KNOT) for u, at in zip(given, places, strict=True))
        if not knots and len(found.problems) == before:
            found.note(f"{where}.knotVector", "is empty; leave it out for evenly spaced knots")
    if len(found.problems) > before:
        return None
    path = GivenPath(degree=degree, control_points=points, knots=knots, weights=weights)
    faults = given_faults(path, where, _NAMES)
    found.problems.extend(f"{found.file}: {fault}" for fault in faults)
    if faults:
        return None
    curve = exact(path)
    if not np.ptp(curve.points, axis=0).max() > LEAST_STEP:
        found.note(f"{where}.controlPoints", "are all in one place, so there is nothing to drive")
        return None
    return curve


def _control_points(
    trajectory: Mapping[str, Any], where: str, found: Finder
) -> tuple[tuple[Point, ...], tuple[float, ...]]:
    points, weights = [], []
    values = found.items(trajectory, "controlPoints", f"{where}.controlPoints")
    if len(values) > MOST_POINTS:
        found.note(f"{where}.controlPoints", f"are {too_many(len(values))}")
        return (), ()
    for i, value in enumerate(values):
        place = f"{where}.controlPoints[{i}]"
        if not isinstance(value, dict):
            found.note(place, f"{show(value)} is not an object with x and y")
            continue
        x, y = (found.number(value.get(axis), f"{place}.{axis}", COORDINATE) for axis in "xy")
        points.append((x, y))
        weights.append(found.number(value.get("weight", 1.0), f"{place}.weight", _WEIGHT))
    return tuple(points), tuple(weights)


def _check_gaps(curves: list[tuple[str, Nurbs | None]], found: Finder) -> None:
    """Note where an edge does not begin where the one before it ends."""
    for (_, before), (where, after) in pairwise(curves):
        if before is None or after is None:
            continue
        gap = float(np.hypot(*(after.points[0] - before.points[-1])))
        if gap > _GAP:
            x, y = after.points[0]
            found.note(
                f"{where}.trajectory",
                f"begins at ({x:g}, {y:g}) m, {gap:.3g} m from where the edge before it ends",
            )
