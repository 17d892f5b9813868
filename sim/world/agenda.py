"""What happens when in virtual time.

Decides: the order of events: by time, at the same time by when they were put down.  Must not know:
what they are.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable

Action = Callable[[], int]
"""Happens, and returns when it happens again [ns], or 0."""


class Agenda:
    """Virtual time [ns] and the events to come."""

    def __init__(self, now_ns: int) -> None:
        self.now_ns = now_ns
        self._events: list[tuple[int, int, Action]] = []
        self._order = 0

    def at(self, due_ns: int, action: Action) -> None:
        """Put down an action."""
        self._order += 1
        heapq.heappush(self._events, (due_ns, self._order, action))

    def once(self, due_ns: int, action: Callable[[], None]) -> None:
        """Put down something that happens once."""

        def act() -> int:
            action()
            return 0

        self.at(due_ns, act)

    def next_ns(self) -> int:
        """Return when the next event is due; IndexError when there is none."""
        return self._events[0][0]

    def happen(self) -> None:
        """Let all happen that is due by now."""
        while self._events and self._events[0][0] <= self.now_ns:
            _, order, action = heapq.heappop(self._events)
            again_ns = action()
            if again_ns:
                heapq.heappush(self._events, (again_ns, order, action))
