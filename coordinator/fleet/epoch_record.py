"""A new epoch as it is asked for and as a log says it: which one, and where its robots stood.

Decides: the record's key and bytes.  It is never sent; replay plans from it again.
"""

from __future__ import annotations

from dataclasses import dataclass

import msgspec

from coordinator.fleet.rest_places import Standing


@dataclass(frozen=True)
class Request:
    """A plan that is wanted: for which epoch, and where the robots stand."""

    epoch: int
    told: tuple[Standing, ...]


def adoption_key(fleet: str) -> str:
    """Return the log's key for these records; no message travels on it."""
    return f"coordinator/{fleet}/epoch"


def is_adoption_key(key: str) -> bool:
    """Tell whether a fleet's new epochs are told on this key."""
    first, _, rest = key.partition("/")
    return first == "coordinator" and rest.endswith("/epoch")


def record_of(request: Request) -> bytes:
    """Return a request as JSON."""
    return msgspec.json.encode(request)


def request_of(payload: bytes) -> Request | None:
    """Read a request; None when these bytes are none."""
    try:
        return msgspec.json.decode(payload, type=Request)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None
