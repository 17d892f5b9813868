"""Words for people on what becomes of an order, for lines and tables of the terminal.

Decides: the words.  Must not know: where they are shown, clocks.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from coordinator.fleet.task import LEAVE
from protocol.messages import ORDER_DONE, ORDER_STATES, UNDER_WAY, WAITING, Order, OrderState

LATE_MS: Final = 200
"""A robot that is late by no more than this [ms] is not said to be late."""

TimeOfDay = Callable[[int], str]
"""Returns the local time of the day at a time since the first GO [ms]."""


def since_go(ms: int) -> str:
    """Return a time since the first GO [ms] in words, for those who do not know when that was."""
    return f"{ms / 1000.0:.1f} s after the first GO"


def order_line(one: OrderState, time_of: TimeOfDay = since_go) -> str:
    """Return a sentence that says what has become of an order."""
    if one.state == WAITING:
        return f"{one.id} waits: {one.reason}" if one.reason else f"{one.id} waits"
    if one.state == UNDER_WAY:
        return f"{one.id}: {one.robot} is under way, {arrival(one, time_of)}"
    why = f": {one.reason}" if one.reason else ""
    if one.state == ORDER_DONE:
        is_done_by_it = one.robot and not one.id.startswith(LEAVE)
        by = f" by {one.robot}" if is_done_by_it else ""
        return f"{one.id} is done{by}{lateness(one)}{why}"
    return f"{one.id} is {ORDER_STATES[one.state]}{why}"


def another_order(known: Order) -> str:
    """Return a sentence for an operator whose order has the id of another order."""
    place = ", ".join(f"{number:g}" for number in known.goal)
    whose = f" for {known.robot}" if known.robot else ""
    return f"{known.id} is another order{whose}, to ({place}); use another id"


def arrival(one: OrderState, time_of: TimeOfDay) -> str:
    """Return when an order's robot arrives, or that it is there."""
    if one.arrived_ms is not None:
        return f"at the goal since {time_of(one.arrived_ms)}"
    planned = one.planned_arrival_ms
    if planned is None:
        return ""
    seconds = "" if time_of is since_go else f" ({planned / 1000.0:.1f} s)"
    return f"arrives {time_of(planned)}{seconds}"


def lateness(one: OrderState) -> str:
    """Return by how much a robot was late at an order's goal, "" if it was not."""
    if one.arrived_ms is None or one.planned_arrival_ms is None:
        return ""
    late_ms = one.arrived_ms - one.planned_arrival_ms
    return f", {late_ms / 1000.0:.1f} s late" if late_ms > LATE_MS else ""
