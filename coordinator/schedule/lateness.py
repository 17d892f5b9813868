"""What new times are wanted for, a robot that stands because it is late, and how a log says so.

Decides: the facts that new times start from; the record's key and bytes.  It is never sent; replay
looks for the new times again.  Must not know: paths, plans.
"""

from __future__ import annotations

import msgspec


class Lateness(msgspec.Struct, frozen=True):
    """Who stands late, which plan time [s] has it there, and from when on times may change [s]."""

    robot: str
    stood: float
    switch: float


def lateness_key(fleet: str) -> str:
    """Return the log's key for these records; no message travels on it."""
    return f"coordinator/{fleet}/late"


def is_lateness_key(key: str) -> bool:
    """Tell whether a fleet's late robots are told on this key."""
    first, _, rest = key.partition("/")
    return first == "coordinator" and rest.endswith("/late")


def lateness_record(late: Lateness) -> bytes:
    """Return what a log says, as JSON."""
    return msgspec.json.encode(late)


def lateness_of(payload: bytes) -> Lateness | None:
    """Read a record; None when these bytes are none."""
    try:
        return msgspec.json.decode(payload, type=Lateness)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None
