"""The fields of VDA 5050 orders that this project writes, for versions 2.1 and 3.0.

Decides: which fields an order has.  A field whose name differs between the versions is written
under both names.  Must not know: plans (vda5050_orders.py), or what orders of other programs look
like (vda5050_reading.py).

Source: https://github.com/VDA5050/VDA5050, json_schemas/order.schema
"""

from __future__ import annotations

from typing import Literal

import msgspec

Version = Literal["2.1.0", "3.0.0"]


class ControlPoint(msgspec.Struct, frozen=True):
    """A place x, y [m] and its weight, above 0."""

    x: float
    y: float
    weight: float


class Trajectory(msgspec.Struct, frozen=True, rename="camel"):
    """A NURBS with clamped knots from 0 to 1; there are control points + degree + 1 knots."""

    degree: int
    knot_vector: list[float]
    control_points: list[ControlPoint]


class Parameter(msgspec.Struct, frozen=True):
    """A parameter of an action: its key and value."""

    key: str
    value: float | str


class Action(msgspec.Struct, frozen=True, rename="camel"):
    """An action that the robot performs at a node."""

    action_type: str
    action_id: str
    blocking_type: Literal["NONE", "SOFT", "HARD"]
    action_parameters: list[Parameter] = []


class NodePosition(msgspec.Struct, frozen=True, rename="camel"):
    """A place [m] with a heading [rad] on a map."""

    x: float
    y: float
    theta: float
    map_id: str


class Node(msgspec.Struct, frozen=True, rename="camel"):
    """A place on the way, in the base if `released`, else in the horizon."""

    node_id: str
    sequence_id: int
    released: bool
    node_position: NodePosition
    actions: list[Action]


class Edge(msgspec.Struct, frozen=True, rename="camel"):
    """The way between two nodes: `length` [m], speeds [m/s].

    `max_speed` is the name of `maximum_speed` in version 2.  Edges of version 3 have no node ids.
    """

    edge_id: str
    sequence_id: int
    released: bool
    start_node_id: str
    end_node_id: str
    max_speed: float
    maximum_speed: float
    length: float
    trajectory: Trajectory
    actions: list[Action]
    orientation: float = 0.0
    orientation_type: Literal["GLOBAL", "TANGENTIAL"] = "TANGENTIAL"


class Order(msgspec.Struct, frozen=True, rename="camel"):
    """One robot's order."""

    header_id: int
    timestamp: str
    version: str
    manufacturer: str
    serial_number: str
    order_id: str
    order_update_id: int
    nodes: list[Node]
    edges: list[Edge]
