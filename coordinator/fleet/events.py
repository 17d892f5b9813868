"""What goes in and out of the fleet core: messages to send, incidents, robots' parts.

Decides: their fields.
"""

from __future__ import annotations

from dataclasses import dataclass

from protocol.messages import OrderState


@dataclass(frozen=True)
class Outgoing:
    """A message to put on a key."""

    key: str
    payload: bytes


@dataclass(frozen=True)
class Incident:
    """Something worth telling people: when, of what kind, about which robot, in words.

    `phase`: the phase that the fleet has turned to, for incidents of the kind "phase".  `order`:
    what has become of an order, for those of the kind "order state".
    """

    now_ns: int
    kind: str
    robot: str
    text: str
    phase: int | None = None
    order: OrderState | None = None


@dataclass(frozen=True)
class Part:
    """A robot's part in an epoch: its Plan message and the speed that this needs [m/s]."""

    plan: bytes
    speed: float
