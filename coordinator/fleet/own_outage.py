"""What a coordinator may rely on after it was away: hung, stopped, or without a processor.

What robots said meanwhile has waited for an unknown time.  So it is stale, no robot is called
silent at once, and no lease is renewed before each moving robot has been heard again.

Decides: which messages are stale, and which robots must be heard first.  Must not know: messages,
phases.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from protocol.timing import COMMAND_PERIOD, MILLISECOND

AWAY: Final = 2 * COMMAND_PERIOD
"""A coordinator that has not looked at the time for longer than this was away."""

DRAIN: Final = 50 * MILLISECOND
"""How long a coordinator that is back still hears messages that were sent while it was away."""


class Absence:
    """When the coordinator last looked at the time, and which robots it has yet to hear again."""

    def __init__(self) -> None:
        self.doubted: set[str] = set()
        self._looked_ns = self._stale_until_ns = 0

    def look(self, now_ns: int, moving: Iterable[str]) -> bool:
        """Look at the time; return whether the coordinator was away while these robots moved.

        Robots that do not move need not be heard again: the fleet does not wait for robots that are
        not under way.
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
        """Return whether a message that is heard now may have waited."""
        return now_ns - self._looked_ns > AWAY or now_ns < self._stale_until_ns

    def is_recent(self, timeout_ns: int, now_ns: int) -> bool:
        """Return whether the coordinator was away too recently to call a robot silent."""
        return now_ns < self._stale_until_ns + timeout_ns

    def spares(self, robot: str, timeout_ns: int, now_ns: int) -> bool:
        """Return whether a robot has yet to be heard again and still has time for it."""
        return robot in self.doubted and self.is_recent(timeout_ns, now_ns)
