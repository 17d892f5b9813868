"""State messages of VDA 5050 (2.1), made from what a fleet's robots report.

Decides: how a report and an order become a state.  A place is stated only of a robot that rests at
its goal: nobody knows those of others.  Must not know: links, HTTP, clocks (the time is an
argument).

Source: https://github.com/VDA5050/VDA5050, json_schemas/state.schema
"""

from __future__ import annotations

from typing import Final, Literal, NamedTuple

import msgspec

from coordinator.exchange.vda5050_orders import MANUFACTURER
from protocol.phases import BRAKING, DONE, MOVING, NO_FAULT, fault_name

VERSION: Final = "2.1.0"
_UNKNOWN: Final = "battery not known"


class NodeState(msgspec.Struct, frozen=True, rename="camel"):
    """A node that is still to be passed."""

    node_id: str
    sequence_id: int
    released: bool = True


class EdgeState(msgspec.Struct, frozen=True, rename="camel"):
    """An edge that is still to be driven."""

    edge_id: str
    sequence_id: int
    released: bool = True


class AgvPosition(msgspec.Struct, frozen=True, rename="camel"):
    """Where a robot rests: x, y [m], theta [rad] on a map."""

    x: float
    y: float
    theta: float
    map_id: str
    position_initialized: bool = True


class BatteryState(msgspec.Struct, frozen=True, rename="camel"):
    """The standard asks for it; robots here do not state it."""

    battery_charge: float = 0.0
    charging: bool = False


class Error(msgspec.Struct, frozen=True, rename="camel"):
    """What keeps a robot from its order."""

    error_type: str
    error_description: str
    error_level: Literal["WARNING", "FATAL"] = "FATAL"


class Information(msgspec.Struct, frozen=True, rename="camel"):
    """Something for people to read."""

    info_type: str
    info_description: str
    info_level: Literal["INFO", "DEBUG"] = "INFO"


class SafetyState(msgspec.Struct, frozen=True, rename="camel"):
    """Emergency stops are the robots' own affair; none is reported."""

    e_stop: Literal["NONE"] = "NONE"
    field_violation: bool = False


class State(msgspec.Struct, frozen=True, rename="camel", kw_only=True, omit_defaults=True):
    """One robot's state."""

    header_id: int
    timestamp: str
    version: str
    manufacturer: str
    serial_number: str
    order_id: str
    order_update_id: int
    last_node_id: str
    last_node_sequence_id: int
    driving: bool
    paused: bool
    operating_mode: str
    node_states: list[NodeState]
    edge_states: list[EdgeState]
    action_states: list[str]
    battery_state: BatteryState
    errors: list[Error]
    information: list[Information]
    safety_state: SafetyState
    agv_position: AgvPosition | None = None


class Seen(NamedTuple):
    """What is known of a robot: its report's phase and fault, whether it is heard, and its order.

    `order`: the one under way, or the last one that it did, which `is_over` then.  `goal`: the end
    of its course, x, y [m] and heading [rad].
    """

    robot: str
    phase: int
    fault: int
    is_heard: bool
    order: str
    is_over: bool
    goal: tuple[float, float, float] | None


def state_of(seen: Seen, fleet: str, header: int, timestamp: str, *, paused: bool) -> State:
    """Return a robot's state; `paused`: the fleet was told to stop."""
    goal, way = f"{seen.order}-goal", f"{seen.order}-way"
    drives = bool(seen.order) and not seen.is_over
    rests = seen.phase == DONE and seen.is_heard and seen.goal is not None
    errors = []
    if not seen.is_heard:
        errors.append(Error("notHeard", f"{seen.robot} is not heard"))
    if seen.fault != NO_FAULT:
        errors.append(Error("fault", fault_name(seen.fault)))
    return State(
        header_id=header,
        timestamp=timestamp,
        version=VERSION,
        manufacturer=MANUFACTURER,
        serial_number=seen.robot,
        order_id=seen.order,
        order_update_id=0,
        last_node_id=goal if seen.order and seen.is_over else "",
        last_node_sequence_id=2 if seen.order and seen.is_over else 0,
        driving=seen.is_heard and seen.phase in (MOVING, BRAKING),
        paused=paused,
        operating_mode="AUTOMATIC",
        node_states=[NodeState(goal, 2)] if drives else [],
        edge_states=[EdgeState(way, 1)] if drives else [],
        action_states=[],
        battery_state=BatteryState(),
        errors=errors,
        information=[Information("battery", _UNKNOWN)],
        safety_state=SafetyState(),
        agv_position=AgvPosition(*seen.goal, fleet) if rests and seen.goal else None,
    )
