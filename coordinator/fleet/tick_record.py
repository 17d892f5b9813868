"""What a log says when the fleet core looked at the time and had nothing to say.

The log shows every other look by its Command.  One that is not shown could not be run again: the
core remembers when it last looked.

Decides: the record's key and bytes.  It is never sent.
"""

from __future__ import annotations

from typing import Final

QUIET: Final = b"null"


def quiet_key(fleet: str) -> str:
    """Return the log's key for these records; no message travels on it."""
    return f"coordinator/{fleet}/quiet"


def is_quiet_key(key: str) -> bool:
    """Tell whether a fleet's quiet ticks are told on this key."""
    first, _, rest = key.partition("/")
    return first == "coordinator" and rest.endswith("/quiet")
