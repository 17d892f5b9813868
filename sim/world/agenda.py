"""The queue of events in virtual time.

Decides: the order of events, which is by time, and for equal times by when they were scheduled.
Must not know: what the events do.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable

Action = Callable[[], int]
"""Performs an event and returns when it is due again [ns], or 0 for never."""


class Agenda:
    """Virtual time [ns] and the events to come."""

    def __init__(self, now_ns: int) -> None:
        self.now_ns = now_ns
        self._events: list[tuple[int, int, Action]] = []
        self._order = 0

    def at(self, due_ns: int, action: Action) -> None:
        """Schedule an action."""
        self._order += 1
        heapq.heappush(self._events, (due_ns, self._order, action))

    def once(self, due_ns: int, action: Callable[[], None]) -> None:
        """Schedule an action that happens once."""

        def act() -> int:
            action()
            return 0

        self.at(due_ns, act)

    def next_ns(self) -> int:
        """Return when the next event is due; IndexError when there is none."""
        return self._events[0][0]

    def happen(self) -> None:
        """Perform all actions that are due by now."""
        events, now_ns = self._events, self.now_ns
        while events and events[0][0] <= now_ns:
            _, order, action = heapq.heappop(events)
            again_ns = action()
            if again_ns:
                heapq.heappush(events, (again_ns, order, action))
