"""Messages that wait to be heard, a lane for each sender and kind: bounded, paced, in turn.

All messages of this protocol say what is, not what has changed, so the newest is worth most: a
lane that is full loses its oldest, and one that brings more than its rate waits, until later, with
its newest.  A sender's flood takes room and time from nobody but itself.

Decides: who is heard next, and what is dropped.  Must not know: what a message means, threads
(the user holds a lock), or any clock but the `now_ns` it is given.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Hashable
from typing import Final, Generic, NamedTuple, TypeVar

from protocol.timing import SECOND

Item = TypeVar("Item")

DEPTH: Final = 256
"""So many messages of a lane may wait: more than ten times what a robot says on one subject in the
second until it notices that its link is gone."""


class Rate(NamedTuple):
    """Messages a second, and how many at once after a silence; a second from none to that many."""

    per_second: int
    at_once: int = DEPTH


class Bucket:
    """A token bucket: `take` tells whether a message may pass at a time [ns]."""

    def __init__(self, rate: Rate) -> None:
        self._period_ns = SECOND // rate.per_second
        self._ahead_ns = self._period_ns * (rate.at_once - 1)
        self._full_ns: int | None = None

    def take(self, now_ns: int) -> bool:
        """Take a token if there is one."""
        full_ns = now_ns if self._full_ns is None else max(self._full_ns, now_ns)
        if full_ns - now_ns > self._ahead_ns:
            return False
        self._full_ns = full_ns + self._period_ns
        return True


class _Lane(Generic[Item]):
    def __init__(self, rate: Rate) -> None:
        self.items: deque[Item] = deque(maxlen=DEPTH)
        self.bucket = Bucket(rate)


class Lanes(Generic[Item]):
    """What waits, by lane; a lane is there from its first message on."""

    def __init__(self) -> None:
        self._lanes: dict[Hashable, _Lane[Item]] = {}
        self._turns: deque[_Lane[Item]] = deque()

    def put(self, name: Hashable, rate: Rate, item: Item) -> bool:
        """Let an item wait in a lane; False when the lane was full and has lost its oldest."""
        lane = self._lanes.get(name)
        if lane is None:
            lane = self._lanes[name] = _Lane(rate)
        if not lane.items:
            self._turns.append(lane)
        has_room = len(lane.items) < DEPTH
        lane.items.append(item)
        return has_room

    def take(self, now_ns: int) -> Item | None:
        """Return the next item, of each lane that may speak in turn; None when none may."""
        for _ in range(len(self._turns)):
            lane = self._turns.popleft()
            if not lane.bucket.take(now_ns):
                self._turns.append(lane)
                continue
            item = lane.items.popleft()
            if lane.items:
                self._turns.append(lane)
            return item
        return None
