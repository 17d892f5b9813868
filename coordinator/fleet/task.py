"""A task: an order of one fleet and what has become of it, and what operators' messages give.

Decides: what is told of an order, and the names of a fleet's own orders.  Must not know: which
orders there are, when a task is done.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final

from coordinator.scenario import plain
from coordinator.scenario.model import Order, Pose, Robot
from coordinator.scenario.order_checks import OWN
from protocol import messages as protocol_messages
from protocol.messages import CANCELLED, ORDER_DONE, REFUSED, UNDER_WAY, WAITING, OrderState

JOIN, LEAVE, *_ = OWN
"""How the ids of the orders begin by which robots join and leave."""

_REASON: Final = 300
"""Reasons are cut to this many characters, so that a message can state them."""


@dataclass
class Task:
    """An order and what has become of it; times in ms since the first GO, None if not known.

    `robot`: who does it, "" until one is chosen.  `makes_room`: the coordinator's own order, for a
    robot that is in the way; it then goes back to `returns_to`, by an order that `is_return`, once
    no other order is open.  `purpose`: what an order of the coordinator's own is for, said while it
    is under way.  `revision`: the course by which it is done.  `is_urgent`: its robot
    leaves what it does for it, as soon as it drives the course `leaves` or a later one.
    """

    order: Order
    released_ms: int
    robot: str = ""
    state: int = WAITING
    accepted_ms: int | None = None
    planned_arrival_ms: int | None = None
    arrived_ms: int | None = None
    alone_ms: int | None = None
    reason: str = ""
    makes_room: bool = False
    purpose: str = ""
    is_urgent: bool = False
    revision: int = 0
    leaves: int = 0
    rooms: int = 0
    """How often others made room for it; for robots that go back, for all of them that had to make
    room for each other, one after the other, up to this one."""

    put_back: int = 0
    """How often its robot was sent on by it and was given up on the way."""

    cannot: set[str] = field(default_factory=set)
    """Robots that have no way to the goal, even alone."""

    returns_to: Pose | None = None
    is_return: bool = False
    joins: Robot | None = None
    """The robot that joins the fleet by this order, at the order's goal."""

    @property
    def is_over(self) -> bool:
        """Whether nothing more becomes of the order."""
        return self.state in (ORDER_DONE, CANCELLED, REFUSED)

    def message(self) -> OrderState:
        """Return what the coordinator says of the order."""
        reason = self.reason or (self.purpose if self.state == UNDER_WAY else "")
        return OrderState(
            id=self.order.id,
            state=self.state,
            robot=self.robot,
            released_ms=self.released_ms,
            accepted_ms=self.accepted_ms,
            planned_arrival_ms=self.planned_arrival_ms,
            arrived_ms=self.arrived_ms,
            alone_ms=self.alone_ms,
            reason=reason[:_REASON],
        )


def order_of(message: protocol_messages.Order) -> Order:
    """Return the order that an operator's message gives."""
    x, y, *heading = message.goal
    goal: Pose = (x, y, heading[0]) if heading else (x, y)
    return Order(
        id=message.id,
        goal=goal,
        robot=message.robot,
        via=message.via,
        release=message.release_ms / 1000.0,
        after=message.after,
        dwell=message.dwell_ms / 1000.0,
        priority=message.priority,
    )


def known_order(order: Order, boot: int) -> protocol_messages.Order:
    """Return the answer to an operator's message of this boot id with the id of another order."""
    return protocol_messages.Order(boot, order.id, order.goal, order.robot)


def robot_of(join: protocol_messages.Join) -> Robot:
    """Return the robot that an operator takes into the fleet."""
    accel = join.max_accel_mps2 or join.max_speed_mps
    return Robot(
        id=join.robot,
        start=join.place,
        goal=join.place,
        radius=join.radius_m,
        max_speed=join.max_speed_mps,
        max_accel=accel,
        max_lateral_accel=accel,
        min_turn_radius=join.min_turn_radius_m,
        max_turn_rate=join.max_turn_rate,
    )


def task_of(fields: dict[str, Any]) -> Task:
    """Return the task that plain data state; raise TypeError or KeyError if they state none."""
    joins, place = fields["joins"], fields.get("returns_to")
    known = {
        "order": plain.order_of(fields["order"]),
        "cannot": set(fields["cannot"]),
        "joins": None if joins is None else plain.robot_of(joins),
        "returns_to": None if place is None else tuple(place),
    }
    return Task(**{**fields, **known})


def task_over(state: OrderState, goal: Pose, robot: str) -> Task:
    """Return an order that is over, of which nothing but its end and where it led is known."""
    return Task(
        Order(id=state.id, goal=goal, robot=robot),
        state.released_ms or 0,
        state.robot,
        state.state,
        state.accepted_ms,
        state.planned_arrival_ms,
        state.arrived_ms,
        state.alone_ms,
        state.reason,
    )
