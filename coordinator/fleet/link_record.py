"""What a log says when a link comes up or is gone.

A robot's is told on its key that is alive, the coordinator's own to a router on a key of its own.

Decides: the records' bytes, the key of the latter.  Nothing of it ever travels: the transport
tells, the fleet core hears.
"""

from __future__ import annotations

from typing import Final

import msgspec

LINK_UP: Final = msgspec.msgpack.encode(True)
LINK_GONE: Final = msgspec.msgpack.encode(False)


def link_news(alive: bool) -> bytes:
    """Return the record of a link that is up or gone."""
    return LINK_UP if alive else LINK_GONE


def router_key(fleet: str) -> str:
    """Return the log's key for news of the coordinator's own link; no message travels on it."""
    return f"coordinator/{fleet}/router"


def is_router_key(key: str) -> bool:
    """Tell whether news of a coordinator's own link is told on this key."""
    first, _, rest = key.partition("/")
    return first == "coordinator" and rest.endswith("/router")
