"""The messages that have arrived for a robot and wait for its next tick.

Decides: which messages are kept: those of the right kind for their key and for this robot, except
Commands that are older than one that came before.  Each type of message has a queue of its own, so
that only newer Commands displace Commands.  Must not know: links, clocks, what a message makes the
robot do.
"""

from __future__ import annotations

from collections import deque
from typing import Final, NamedTuple

from protocol import keys
from protocol.codec import decode
from protocol.messages import Clock, Command, Message, Plan, Refusal

_DEPTHS: Final[dict[type[Message], int]] = {
    Command: 32, Clock: 32, Plan: 4, Refusal: 4,
}  # fmt: skip
"""How many messages of a type may wait, and be processed in one tick.  The newest of a type
supersedes the others, and there is room for several times what a coordinator sends in a second."""


class Heard(NamedTuple):
    """A message, the fleet on whose key it arrived, and its arrival time [ns], if known."""

    fleet: str
    message: Message
    heard_ns: int | None


class Inbox:
    """The queues of messages for one robot.

    `bad`: how many messages were invalid or for other robots; `dropped`: how many were displaced by
    newer ones.  `waits`: whether a message may wait.
    """

    def __init__(self, robot: str) -> None:
        self.bad = self.dropped = 0
        self.waits = False
        self._robot = robot
        self._lanes: dict[type[Message], deque[tuple[int, Heard]]] = {
            kind: deque(maxlen=depth) for kind, depth in _DEPTHS.items()
        }
        self._queues = tuple(self._lanes.values())
        self._count = 0
        self._newest = (-1, -1, -1)

    def put(self, key: str, payload: bytes, heard_ns: int | None) -> None:
        """Add a message to the queue of its type."""
        place = keys.split(key)
        message = decode(place[1], payload) if place is not None else None
        if place is None or message is None or not self._is_mine(place[2], message):
            self.bad += 1
            return
        if isinstance(message, Command):
            term, boot, sequence = self._newest
            if (term, boot) == (message.term, message.boot) and message.sequence <= sequence:
                return
            self._newest = message.term, message.boot, message.sequence
        lane = self._lanes[type(message)]
        self.dropped += len(lane) == lane.maxlen
        self._count += 1
        lane.append((self._count, Heard(place[0], message, heard_ns)))
        self.waits = True

    def take(self) -> Heard | None:
        """Remove and return the waiting message that arrived first; None when none waits.

        Another thread may `put` meanwhile.
        """
        self.waits = False  # Before looking, so that what is put meanwhile is not overlooked.
        waiting = [lane for lane in self._queues if lane]
        if not waiting:
            return None
        self.waits = True
        return min(waiting, key=lambda lane: lane[0][0]).popleft()[1]

    def _is_mine(self, robot: str, message: Message) -> bool:
        """Return whether a message is for this robot or for all; `robot`: the name in its key."""
        if type(message) not in _DEPTHS or (isinstance(message, Plan) and message.robot != robot):
            return False
        return robot == self._robot or isinstance(message, Command)
