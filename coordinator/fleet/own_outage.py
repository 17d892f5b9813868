"""What a coordinator may believe that was away: hung, stopped, or starved of its processor.

What robots said meanwhile has waited, nobody knows since when.  So it is stale, nobody is called
silent at once, and no lease is renewed before each robot that moves has been heard anew.

Decides: what is stale, and whom to hear first.  Must not know: messages, phases.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from protocol.timing import COMMAND_PERIOD, MILLISECOND

AWAY: Final = 2 * COMMAND_PERIOD
"""A coordinator that has not looked at the time for so long was away."""

DRAIN: Final = 50 * MILLISECOND
"""So long after it is back it hears what was said meanwhile."""


class Absence:
    """When the coordinator looked at the time, and whom it has yet to hear since it was away."""

    def __init__(self) -> None:
        self.doubted: set[str] = set()
        self._looked_ns = self._stale_until_ns = 0

    def look(self, now_ns: int, moving: Iterable[str]) -> bool:
        """Look at the time; tell whether the coordinator was away while these robots moved.

        Whoever does not move is not doubted: nobody waits for a robot that the epoch goes without.
        """
        was_away = now_ns - self._looked_ns > AWAY
        self._looked_ns = now_ns
        if was_away:
            self._stale_until_ns = now_ns + DRAIN
            self.doubted = set(moving)
        else:
            self.doubted.intersection_update(moving)
        return was_away

    def is_stale(self, now_ns: int) -> bool:
        """Tell whether what is heard now may have waited."""
        return now_ns - self._looked_ns > AWAY or now_ns < self._stale_until_ns

    def is_recent(self, timeout_ns: int, now_ns: int) -> bool:
        """Tell whether the coordinator is back for less than the time of a silence."""
        return now_ns < self._stale_until_ns + timeout_ns

    def spares(self, robot: str, timeout_ns: int, now_ns: int) -> bool:
        """Tell whether a robot has yet to be heard anew and still has time for it."""
        return robot in self.doubted and self.is_recent(timeout_ns, now_ns)
