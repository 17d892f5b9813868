"""What a coordinator writes into its log besides messages: the records' keys and bytes.

None of it is ever sent.  `replay --check` runs the fleet again from these records:

- `epoch`: a new epoch that was adopted, and where its robots stood when it was asked for;
- `late`: for which late robot new times were looked for;
- `quiet`: the fleet core looked at the time and had nothing to say (every other look shows by its
  Command);
- `router`: the coordinator's own link to a router came up or is gone.  A robot's link is told on
  its `alive` key with the same bytes;
- `dropped`: how many messages were dropped so far, by cause.

Decides: keys and bytes.  Must not know: when something is worth a record (mission_driver.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import msgspec

from coordinator.fleet.rest_places import Standing
from coordinator.schedule.lateness import Lateness

QUIET: Final = b"null"
LINK_UP: Final = msgspec.msgpack.encode(True)
LINK_GONE: Final = msgspec.msgpack.encode(False)
NOT_RECORDED: Final = "not recorded"
"""The cause under which messages are counted that the log had no room for."""

_UNREADABLE: Final = (msgspec.MsgspecError, UnicodeDecodeError, RecursionError)
_counts: Final = msgspec.json.Decoder(dict[str, int])


@dataclass(frozen=True)
class Request:
    """A plan that is wanted: for which epoch, and where the robots stand."""

    epoch: int
    told: tuple[Standing, ...]


def adoption_key(fleet: str) -> str:
    """Return the key of new epochs."""
    return f"coordinator/{fleet}/epoch"


def is_adoption_key(key: str) -> bool:
    """Tell whether a fleet's new epochs stand on this key."""
    return _is_record(key, "epoch")


def adoption_record(request: Request) -> bytes:
    """Return a request as JSON."""
    return msgspec.json.encode(request)


def request_of(payload: bytes) -> Request | None:
    """Read a request back; None when these bytes are none."""
    try:
        return msgspec.json.decode(payload, type=Request)
    except _UNREADABLE:
        return None


def lateness_key(fleet: str) -> str:
    """Return the key of late robots."""
    return f"coordinator/{fleet}/late"


def is_lateness_key(key: str) -> bool:
    """Tell whether a fleet's late robots stand on this key."""
    return _is_record(key, "late")


def lateness_record(late: Lateness) -> bytes:
    """Return a lateness as JSON."""
    return msgspec.json.encode(late)


def lateness_of(payload: bytes) -> Lateness | None:
    """Read a lateness back; None when these bytes are none."""
    try:
        return msgspec.json.decode(payload, type=Lateness)
    except _UNREADABLE:
        return None


def quiet_key(fleet: str) -> str:
    """Return the key of looks without a word; its payload is QUIET."""
    return f"coordinator/{fleet}/quiet"


def is_quiet_key(key: str) -> bool:
    """Tell whether a fleet's quiet looks stand on this key."""
    return _is_record(key, "quiet")


def router_key(fleet: str) -> str:
    """Return the key of the coordinator's own link."""
    return f"coordinator/{fleet}/router"


def is_router_key(key: str) -> bool:
    """Tell whether a coordinator's own link stands on this key."""
    return _is_record(key, "router")


def link_record(alive: bool) -> bytes:
    """Return the record of a link that is up or gone."""
    return LINK_UP if alive else LINK_GONE


def drops_key(fleet: str) -> str:
    """Return the key of dropped messages."""
    return f"coordinator/{fleet}/dropped"


def is_drops_key(key: str) -> bool:
    """Tell whether dropped messages stand on this key."""
    return _is_record(key, "dropped")


def drops_record(dropped: Mapping[str, int]) -> bytes:
    """Return how many messages were dropped so far, by cause, as JSON."""
    return msgspec.json.encode(dict(sorted(dropped.items())))


def drops_of(payload: bytes) -> dict[str, int] | None:
    """Read such counts back; None when these bytes are none."""
    try:
        return _counts.decode(payload)
    except _UNREADABLE:
        return None


def _is_record(key: str, kind: str) -> bool:
    first, _, rest = key.partition("/")
    return first == "coordinator" and rest.endswith(f"/{kind}")
