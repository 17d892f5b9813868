"""What a log says about messages that are not in it: how many were dropped so far, and why.

Decides: the record's key and bytes.  It is never sent.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import msgspec

NOT_RECORDED: Final = "not recorded"
"""What was heard or sent but is not in the log, which had no room for it."""

_counts: Final = msgspec.json.Decoder(dict[str, int])


def drops_key(fleet: str) -> str:
    """Return the log's key for these records; no message travels on it."""
    return f"coordinator/{fleet}/dropped"


def is_drops_key(key: str) -> bool:
    """Tell whether dropped messages are told on this key."""
    first, _, rest = key.partition("/")
    return first == "coordinator" and rest.endswith("/dropped")


def drops_record(dropped: Mapping[str, int]) -> bytes:
    """Return the record of how many messages were dropped so far, by cause."""
    return msgspec.json.encode(dict(sorted(dropped.items())))


def drops_of(payload: bytes) -> dict[str, int] | None:
    """Read such a record back; None when it is none."""
    try:
        return _counts.decode(payload)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None
