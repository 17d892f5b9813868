"""Which of the messages that arrive at a coordinator the fleet core hears, and when.

A message is dropped before it is decoded if it is too long, is not on a key of this fleet, or is
not for a coordinator.  The other messages wait in lanes.  Each robot of the fleet has two lanes for
each kind of key, one for its accepted process and one for all other processes under its name, and
one lane for messages that cannot be decoded.  All strangers together have one lane for each kind.

Decides: which messages are dropped, counted by cause.  Must not know: threads, links, clocks, what
a message means.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

from coordinator.mission.lanes import Lanes, Rate
from protocol import keys
from protocol.codec import decode
from protocol.messages import MAX_MESSAGE_BYTES, Clock, Command, Message

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
    "order": Rate(500),
    "tell": Rate(20),
    "block": Rate(20),
    "roster": Rate(20),
}
"""The allowed rate of messages of each kind, several times what the protocol needs.

News of a robot's link share the lane of its reports, so that their order is kept."""

_SENT: Final = ("plan", "orders", "blocks")
"""On these kinds of keys only coordinators send."""

UNREADABLE_RATE: Final = Rate(50, 64)
"""How many messages that cannot be decoded reach the core, which counts them, and the log."""

MOST_STRANGERS: Final = 1_000
"""How many strangers are answered and recorded in the log; messages of further strangers are
dropped."""


class Arrival(NamedTuple):
    """A message and its sender's time stamp, or news of a robot's link on its `alive` key."""

    key: str
    payload: bytes
    sent_ns: int | None


class Intake:
    """The messages that wait for the fleet core of one fleet; `boot` is the coordinator's boot id.

    `boot_of` returns the boot id of a robot's accepted process, or None if no process was accepted;
    it raises KeyError for a stranger.  `dropped` counts the dropped messages by cause.
    """

    def __init__(self, fleet: str, boot: int, boot_of: Callable[[str], int | None]) -> None:
        self.dropped: dict[str, int] = {}
        self._fleet, self._boot = fleet, boot
        self._boot_of = boot_of
        self._strangers: set[str] = set()
        self._lanes: Lanes[Arrival] = Lanes()

    def put(self, arrival: Arrival) -> bool:
        """Queue a message or drop it; return whether more messages wait than before."""
        key, payload, _ = arrival
        if len(payload) > MAX_MESSAGE_BYTES:
            return self._drop(TOO_LONG)
        place = keys.split(key)
        if place is None or place[0] != self._fleet or place[1] in _SENT:
            return self._drop(NOT_OURS)
        _, kind, robot = place
        try:
            boot = self._boot_of(robot) if robot else None
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
            if self._is_ours(message):
                return self._drop(NOT_OURS)
            accepted = getattr(message, "boot", None) == boot
        room = self._lanes.put((robot, kind, accepted), RATES[kind], arrival)
        return room or self._drop(TOO_MANY)

    def _is_ours(self, message: Message) -> bool:
        """Return whether only this coordinator can have said a message; here it is an echo.

        In the log it would look like one that the coordinator sent.
        """
        if isinstance(message, Clock):
            return message.received_ns is not None
        return isinstance(message, Command) and message.boot == self._boot

    def is_empty(self) -> bool:
        """Return whether no message waits."""
        return self._lanes.is_empty()

    def take(self, now_ns: int) -> Arrival | None:
        """Return the next message to hear; None if no message may pass now."""
        return self._lanes.take(now_ns)

    def _drop(self, cause: str) -> bool:
        self.dropped[cause] = self.dropped.get(cause, 0) + 1
        return False
