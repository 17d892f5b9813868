"""Makes VDA 5050 orders from a plan, one per robot.

Nodes are at the start, the stops and the goal.  An edge's trajectory is the piece of the curve
between its nodes, cut by knot insertion.  The base reaches to the first place where the robot waits
for another; the rest is the horizon, which a master control releases in time.  Each wait is a
blocking action with its duration, so that an order contains everything that a plan does.

Decides: which parts of a plan an order states.  Must not know: files, clocks (the time is an
argument).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final, NamedTuple

from coordinator.curves.bounds import parameter_of
from coordinator.curves.knots import piece
from coordinator.curves.nurbs import Nurbs, nurbs
from coordinator.exchange.vda5050 import (
    Action,
    ControlPoint,
    Edge,
    Node,
    NodePosition,
    Order,
    Parameter,
    Trajectory,
    Version,
)
from coordinator.plan.document import PlanDocument, RobotPlan

MANUFACTURER: Final = "splinefleet"


class _Place(NamedTuple):
    """A node: arc length [m], curve parameter, and the wait from `arrive` to `depart` [s]."""

    s: float
    u: float
    arrive: float = 0.0
    depart: float = 0.0
    yields_to: str = ""

    @property
    def waits(self) -> bool:
        return self.depart > self.arrive


def orders_of(
    document: PlanDocument, timestamp: str, version: Version = "2.1.0"
) -> dict[str, Order]:
    """Return the orders by robot id; `timestamp` is the time of the orders, ISO 8601, UTC."""
    return {
        robot.id: _order(document, robot, index, timestamp, version)
        for index, robot in enumerate(document.robots)
    }


def _order(
    document: PlanDocument, robot: RobotPlan, header: int, timestamp: str, version: Version
) -> Order:
    path = robot.path
    curve = nurbs(path.degree, path.knots, path.control_points, path.weights)
    places = _places(robot, curve)
    base = next((i for i, place in enumerate(places) if place.waits), len(places))
    nodes = [
        _node(document.scenario, robot.id, curve, i, place, released=i <= base)
        for i, place in enumerate(places)
    ]
    edges = [_edge(robot, curve, i, places, released=i < base) for i in range(len(places) - 1)]
    return Order(
        header_id=header,
        timestamp=timestamp,
        version=version,
        manufacturer=MANUFACTURER,
        serial_number=robot.id,
        order_id=f"{document.scenario}-{document.epoch}-{robot.id}",
        order_update_id=0,
        nodes=nodes,
        edges=edges,
    )


def _places(robot: RobotPlan, curve: Nurbs) -> list[_Place]:
    """Return the start, the stops and the goal."""
    end = float(curve.knots[-1])
    at = parameter_of(curve, [stop.s for stop in robot.stops]).tolist()
    stops = [
        _Place(stop.s, u, stop.arrive, stop.depart, stop.yields_to)
        for stop, u in zip(robot.stops, at, strict=True)
    ]
    start = _Place(0.0, 0.0, 0.0, robot.start_time, robot.start_yields_to)
    return [start, *stops, _Place(curve.length, end)]


def _node(
    scenario: str, robot: str, curve: Nurbs, index: int, place: _Place, *, released: bool
) -> Node:
    points, first = curve.derivatives([place.u], 1)
    (x, y), (dx, dy) = points[0].tolist(), first[0].tolist()
    return Node(
        node_id=f"{robot}-{index}",
        sequence_id=2 * index,
        released=released,
        node_position=NodePosition(x=x, y=y, theta=math.atan2(dy, dx), map_id=scenario),
        actions=[_wait(robot, index, place)] if place.waits else [],
    )


def _wait(robot: str, index: int, place: _Place) -> Action:
    """Return the wait at a node as an action.

    Its parameters are `duration` [s], `until` [s of plan time] and `yieldsTo`, the robot that is
    waited for.
    """
    parameters = [
        Parameter("duration", place.depart - place.arrive),
        Parameter("until", place.depart),
    ]
    if place.yields_to:
        parameters.append(Parameter("yieldsTo", place.yields_to))
    return Action("wait", f"{robot}-{index}-wait", "HARD", parameters)


def _edge(
    robot: RobotPlan, curve: Nurbs, index: int, places: list[_Place], *, released: bool
) -> Edge:
    begin, end = places[index], places[index + 1]
    fastest = max(v for _, v in robot.profile)
    return Edge(
        edge_id=f"{robot.id}-{index}-{index + 1}",
        sequence_id=2 * index + 1,
        released=released,
        start_node_id=f"{robot.id}-{index}",
        end_node_id=f"{robot.id}-{index + 1}",
        max_speed=fastest,
        maximum_speed=fastest,
        length=end.s - begin.s,
        trajectory=trajectory_of(piece(curve, begin.u, end.u)),
        actions=[],
    )


def trajectory_of(curve: Nurbs) -> Trajectory:
    """Return a curve as a trajectory with the same control points and with knots from 0 to 1."""
    return Trajectory(
        degree=curve.degree,
        knot_vector=(curve.knots / curve.knots[-1]).tolist(),
        control_points=list(_control_points(curve)),
    )


def _control_points(curve: Nurbs) -> Iterator[ControlPoint]:
    for (x, y), weight in zip(curve.points.tolist(), curve.weights.tolist(), strict=True):
        yield ControlPoint(x, y, weight)
