"""What a log says when a fleet begins a new epoch: for which one, and where its robots stood.

Decides: the record's key and bytes.  It is never sent; replay plans from it again.
"""

from __future__ import annotations

import msgspec

from coordinator.mission import Request


def adoption_key(fleet: str) -> str:
    """Return the log's key for these records; no message travels on it."""
    return f"coordinator/{fleet}/epoch"


def record_of(request: Request) -> bytes:
    """Return a request as JSON."""
    return msgspec.json.encode(request)


def request_of(payload: bytes) -> Request | None:
    """Read a request; None when these bytes are none."""
    try:
        return msgspec.json.decode(payload, type=Request)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None
