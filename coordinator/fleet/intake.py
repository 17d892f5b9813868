"""The door of a coordinator: which of the messages that arrive the fleet core hears, and when.

A message that is too long, on no key of this fleet's or not for a coordinator is dropped before
anybody looks into it.  What is left waits in lanes: for each robot of the fleet and kind of key
one for its process that has been accepted and one for any other that speaks in its name; one for
what a robot's keys hold that cannot be read; and one a kind for all strangers.

Decides: what is dropped, and counts it by cause.  Must not know: threads, links, clocks, what a
message means.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

from coordinator.fleet.lanes import Lanes, Rate
from protocol import keys
from protocol.codec import decode
from protocol.messages import MAX_MESSAGE_BYTES

TOO_LONG: Final = "too long"
NOT_OURS: Final = "not for a coordinator"
UNREADABLE: Final = "unreadable, too many"
TOO_MANY: Final = "too many"

RATES: Final = {
    "hello": Rate(20),
    "report": Rate(200),
    "clock": Rate(100),
    "admit": Rate(20),
    "command": Rate(50),
}
"""Several times what the protocol asks for; link news go with a robot's reports, in their order."""

UNREADABLE_RATE: Final = Rate(50, 64)
"""So much of what cannot be read is heard, which means counted and kept in the log."""

MOST_STRANGERS: Final = 1_000
"""So many names that are not in the fleet are answered and kept in the log, and no more."""


class Arrival(NamedTuple):
    """What arrived, and the sender's stamp; on a key that is alive the news of its link."""

    key: str
    payload: bytes
    sent_ns: int | None


class Intake:
    """What waits for the fleet core of one fleet.

    `boot_of` gives the boot id of a robot's accepted process, None when none was; KeyError for a
    stranger.  `dropped`: how many messages were, by cause.
    """

    def __init__(self, fleet: str, boot_of: Callable[[str], int | None]) -> None:
        self.dropped: dict[str, int] = {}
        self._fleet = fleet
        self._boot_of = boot_of
        self._strangers: set[str] = set()
        self._lanes: Lanes[Arrival] = Lanes()

    def put(self, arrival: Arrival) -> bool:
        """Let a message wait, or drop it; tell whether there is more to hear than before."""
        key, payload, _ = arrival
        if len(payload) > MAX_MESSAGE_BYTES:
            return self._drop(TOO_LONG)
        place = keys.split(key)
        if place is None or place[0] != self._fleet or place[1] == "plan":
            return self._drop(NOT_OURS)
        _, kind, robot = place
        try:
            boot = self._boot_of(robot)
        except KeyError:
            if robot not in self._strangers and len(self._strangers) >= MOST_STRANGERS:
                return self._drop(TOO_MANY)
            self._strangers.add(robot)
            robot, boot = "", None
        if kind == "alive":
            kind, accepted = "report", True
        else:
            message = decode(kind, payload)
            if message is None:
                room = self._lanes.put((robot,), UNREADABLE_RATE, arrival)
                return room or self._drop(UNREADABLE)
            accepted = message.boot == boot
        room = self._lanes.put((robot, kind, accepted), RATES[kind], arrival)
        return room or self._drop(TOO_MANY)

    def take(self, now_ns: int) -> Arrival | None:
        """Return the next message to hear; None when there is none for now."""
        return self._lanes.take(now_ns)

    def _drop(self, cause: str) -> bool:
        self.dropped[cause] = self.dropped.get(cause, 0) + 1
        return False
