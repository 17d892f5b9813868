"""Bounded queues of incoming messages: one lane for each sender and kind, served round-robin.

All messages of this protocol state the present situation, not what has changed, so the newest
message is worth most.  A lane that is full drops its oldest message.  Messages of a lane that
exceeds its rate wait in it.  So a sender that floods the coordinator takes space and time from no
other sender.

Decides: which message is heard next, and which is dropped.  Must not know: what a message means,
threads (the caller holds a lock), clocks (`now_ns` is an argument).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Hashable
from typing import Final, Generic, NamedTuple, TypeVar

from protocol.timing import SECOND

Item = TypeVar("Item")

DEPTH: Final = 256
"""How many messages may wait in a lane.

A robot notices within a second that its link is gone; in that second it sends less than a tenth of
this on one key."""


class Rate(NamedTuple):
    """Messages per second, and how many may pass at once after a silence.

    After `at_once` messages in a row, that many may pass again `at_once` / `per_second` seconds
    later.
    """

    per_second: int
    at_once: int = DEPTH


class Bucket:
    """A token bucket: `take` returns whether a message may pass at a time [ns]."""

    def __init__(self, rate: Rate) -> None:
        self._period_ns = SECOND // rate.per_second
        self._ahead_ns = self._period_ns * (rate.at_once - 1)
        self._full_ns: int | None = None

    def take(self, now_ns: int) -> bool:
        """Take a token; return False if there is none."""
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
    """All lanes by name; a lane is created for its first item."""

    def __init__(self) -> None:
        self._lanes: dict[Hashable, _Lane[Item]] = {}
        self._turns: deque[_Lane[Item]] = deque()

    def put(self, name: Hashable, rate: Rate, item: Item) -> bool:
        """Append an item to a lane; return False if the lane was full and dropped its oldest."""
        lane = self._lanes.get(name)
        if lane is None:
            lane = self._lanes[name] = _Lane(rate)
        if not lane.items:
            self._turns.append(lane)
        has_room = len(lane.items) < DEPTH
        lane.items.append(item)
        return has_room

    def is_empty(self) -> bool:
        """Return whether all lanes are empty."""
        return not self._turns

    def take(self, now_ns: int) -> Item | None:
        """Return the next item from the lanes in turn; None if no lane may pass one now."""
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
