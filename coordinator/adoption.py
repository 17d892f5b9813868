"""What a log says when a fleet begins a new epoch, or gets new times: what was asked for.

Decides: the records' keys and bytes.  They are never sent; replay plans from them again.
"""

from __future__ import annotations

import msgspec

from coordinator.lateness import Lateness
from coordinator.mission import Request


def adoption_key(fleet: str) -> str:
    """Return the log's key for these records; no message travels on it."""
    return f"coordinator/{fleet}/epoch"


def retiming_key(fleet: str) -> str:
    """Return the log's key for requests of new times; no message travels on it."""
    return f"coordinator/{fleet}/late"


def record_of(request: Request | Lateness) -> bytes:
    """Return a request as JSON."""
    return msgspec.json.encode(request)


def lateness_of(payload: bytes) -> Lateness | None:
    """Read a request of new times; None when these bytes are none."""
    try:
        return msgspec.json.decode(payload, type=Lateness)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None


def request_of(payload: bytes) -> Request | None:
    """Read a request; None when these bytes are none."""
    try:
        return msgspec.json.decode(payload, type=Request)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None
