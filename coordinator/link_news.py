"""What a log says when a robot's link comes up or is gone, on the robot's key that is alive.

Decides: the record's bytes.  Nothing of it ever travels: the transport tells, the fleet core hears.
"""

from __future__ import annotations

from typing import Final

import msgspec

LINK_UP: Final = msgspec.msgpack.encode(True)
LINK_GONE: Final = msgspec.msgpack.encode(False)


def link_news(alive: bool) -> bytes:
    """Return the record of a link that is up or gone."""
    return LINK_UP if alive else LINK_GONE
