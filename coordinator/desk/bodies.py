"""What a person or program may send over HTTP, and the operator's messages made from it.

Decides: the fields of each body, and how all problems of one are told at once.  Must not know:
links, HTTP's status codes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, TypeVar

import msgspec

from coordinator.base.errors import InputError
from coordinator.scenario.checks import LEAST
from protocol.messages import (
    MOST_PRIORITY,
    MOST_VIAS,
    Block,
    Coordinate,
    Join,
    Order,
    RobotId,
    Spot,
)

Name = Annotated[str, msgspec.Meta(pattern=r"^(?!\.{1,2}$)[A-Za-z0-9_.-]{1,32}(?!\n)$")]
"""Names "." and ".." mean something else in the path of a URL."""

Anybody = Annotated[str, msgspec.Meta(pattern=r"^[A-Za-z0-9_.-]{0,32}(?!\n)$")]
Seconds = Annotated[float, msgspec.Meta(ge=0.0, le=86_400.0)]
Priority = Annotated[int, msgspec.Meta(ge=-MOST_PRIORITY, le=MOST_PRIORITY)]
Goal = Annotated[tuple[Coordinate, ...], msgspec.Meta(min_length=2, max_length=3)]
Length = Annotated[float, msgspec.Meta(ge=LEAST, le=100.0)]
Radius = Annotated[float, msgspec.Meta(ge=0.0, le=1000.0)]
Rate = Annotated[float, msgspec.Meta(ge=LEAST, le=1000.0)]


class OrderBody(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An order: the fields of `[[orders]]` in a scenario, and `now`.

    goal: x, y [m], and heading [rad] if it matters.  robot: "" leaves the choice to the
    coordinator.  via: places [m] to pass, in order.  dwell [s]: how long the robot stands at the
    goal.  release [s]: when it is looked at, since the first GO; after: or when the order with this
    id is over.  now: the robot leaves what it does for this order.  The same id again is the same
    order.
    """

    goal: Goal
    id: Name | None = None
    robot: Anybody = ""
    via: Annotated[tuple[Spot, ...], msgspec.Meta(max_length=MOST_VIAS)] = ()
    dwell: Seconds = 0.0
    priority: Priority = 0
    release: Seconds = 0.0
    after: Anybody = ""
    now: bool = False

    def message(self, boot: int, name: str, by: str) -> Order:
        """Return the order as an operator's message."""
        return Order(
            boot=boot,
            id=self.id or name,
            goal=self.goal,
            robot=self.robot,
            via=self.via,
            dwell_ms=round(1000.0 * self.dwell),
            priority=self.priority,
            now=self.now,
            release_ms=round(1000.0 * self.release),
            after=self.after,
            by=by,
        )


class BlockBody(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A place to close: the corners of a polygon [m].  The same id again is the same place."""

    polygon: Annotated[tuple[Spot, ...], msgspec.Meta(min_length=3, max_length=100)]
    id: Name | None = None

    def message(self, boot: int, name: str, by: str) -> Block:
        """Return it as an operator's message."""
        return Block(boot, self.id or name, self.polygon, by)


class JoinBody(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A robot that joins: where it stands (x, y [m], heading [rad]), and its limits.

    max_accel [m/s^2]: null for a robot that reaches its greatest speed within a second.
    """

    at: tuple[Coordinate, Coordinate, Coordinate]
    radius: Length = 0.2
    max_speed: Length = 0.5
    max_accel: Rate | None = None
    min_turn_radius: Radius = 0.0
    max_turn_rate: Rate = 2.0

    def message(self, boot: int, robot: str, by: str) -> Join:
        """Return it as an operator's message."""
        return Join(
            boot,
            robot,
            self.at,
            self.radius,
            self.max_speed,
            self.max_accel or 0.0,
            self.min_turn_radius,
            self.max_turn_rate,
            by,
        )


class NoBody(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Nothing, as {} or as no body at all."""


Body = TypeVar("Body", bound=msgspec.Struct)


def read_body(kind: type[Body], data: bytes) -> Body:
    """Read a body from JSON; raise InputError with all that is wrong, one line for each field."""
    try:
        value = msgspec.json.decode(data or b"{}")
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InputError([f"the body is not JSON: {error}"]) from None
    if not isinstance(value, dict):
        raise InputError(["the body is not a JSON object"])
    problems = _problems(kind, value)
    if problems:
        raise InputError(problems)
    return msgspec.convert(value, kind)


def read_name(text: str, what: str) -> str:
    """Return a name; raise InputError if it cannot be one."""
    try:
        return msgspec.convert(text, RobotId)
    except msgspec.ValidationError:
        raise InputError([f"{what}: 1 to 32 of A-Z a-z 0-9 _ . -"]) from None


def _problems(kind: type[msgspec.Struct], value: Mapping[str, Any]) -> list[str]:
    fields = {field.name: field for field in msgspec.structs.fields(kind)}
    problems = [
        f"{name[:40]}: is no field; known are {', '.join(fields)}"
        for name in value
        if name not in fields
    ]
    for name, field in fields.items():
        if name not in value:
            if field.required:
                problems.append(f"{name}: is missing")
            continue
        try:
            msgspec.convert(value[name], field.type)
        except msgspec.ValidationError as error:
            is_name = "regex" in str(error)
            what = "Expected 1 to 32 of A-Z a-z 0-9 _ . -" if is_name else str(error)
            problems.append(f"{name}: {what}")
    later = kind is OrderBody and (value.get("release") or value.get("after"))
    if later and value.get("now"):
        problems.append("now: is given as well as release or after")
    return problems
