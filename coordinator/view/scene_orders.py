"""Collects what a coordinator said of its fleet's orders, for the page.

Decides: which of it changes the page, and when it counts from.  Must not know: files, how orders
are done.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from coordinator.view.scene import Order, Step
from protocol.messages import (
    CANCELLED,
    ORDER_DONE,
    REFUSED,
    UNDER_WAY,
    WAITING,
    OrderState,
)
from protocol.timing import MILLISECOND, SECOND

_NEVER: Final = 2**62

_OVER = (ORDER_DONE, CANCELLED, REFUSED)


class SaidOrders:
    """What was said of each order, with the times [ns] at which it was heard."""

    def __init__(self) -> None:
        self._said: dict[str, list[tuple[int, OrderState]]] = {}
        self.went_ns = _NEVER
        """The first GO was no later than this [ns], by what was said of orders."""

    def take(self, state: OrderState, now_ns: int) -> bool:
        """Add what a coordinator says of an order; return whether it is news."""
        said = self._said.setdefault(state.id, [])
        if said and said[-1][1] == state:
            return False
        said.append((now_ns, state))
        passed_ms = max(state.accepted_ms or 0, state.arrived_ms or 0)
        if passed_ms:
            self.went_ns = min(self.went_ns, now_ns - passed_ms * MILLISECOND)
        return True

    def forget(self, before_ns: int) -> None:
        """Forget the orders that were over at a time."""
        for name in [
            name
            for name, said in self._said.items()
            if said[-1][0] < before_ns and said[-1][1].state in _OVER
        ]:
            del self._said[name]

    def drawn(self, index: Mapping[str, int], zero_ns: int) -> list[Order]:
        """Return the orders, with times since the first GO at `zero_ns`."""
        found = []
        for name, said in self._said.items():
            steps: list[Step] = []
            for at_ns, state in said:
                t = (at_ns - zero_ns) / SECOND
                t = max(t, steps[-1][0]) if steps else max(min(_known_at(state, t), t), 0.0)
                step = _step(state, t, index)
                if not steps or step[1:] != steps[-1][1:]:
                    steps.append(step)
            found.append(Order(id=name, steps=steps, arrived=_seconds(said[-1][1].arrived_ms)))
        return found


def _step(state: OrderState, t: float, index: Mapping[str, int]) -> Step:
    planned = _seconds(state.planned_arrival_ms)
    return round(t, 3), state.state, index.get(state.robot, -1), planned, state.reason


def _known_at(state: OrderState, heard: float) -> float:
    """Return since when [s] an order was as it is said to be, as far as that is said."""
    at_ms = {
        WAITING: state.released_ms,
        UNDER_WAY: state.accepted_ms,
        ORDER_DONE: state.arrived_ms,
    }.get(state.state)
    return heard if at_ms is None else at_ms / 1000.0


def _seconds(ms: int | None) -> float | None:
    return None if ms is None else ms / 1000.0
