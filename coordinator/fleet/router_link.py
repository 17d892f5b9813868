"""What a coordinator knows of the router between it and its robots.

A coordinator that listens for its robots itself has no router.  A router that dies cuts all links
at once, and a router that hangs holds messages back: then the router has failed, not the robots.
The robots stop when their leases run out; messages that were held back are stale.

Decides: whether to wait for robots that fell silent together, and which messages are stale.  Must
not know: messages, phases, how the link is watched.
"""

from __future__ import annotations

from typing import Final

from coordinator.fleet.own_outage import DRAIN
from protocol.timing import REPORT_PERIOD, SECOND

_GAP: Final = 3 * REPORT_PERIOD // 2
"""After a silence of all robots this long, the router may have held back the next messages."""

_SILENCE: Final = 15 * SECOND
"""How long to wait for robots that fell silent together.

By then the link to a hung router is known to be gone, because zenohd's own lease is 10 s."""


class RouterLink:
    """The last reported state of the link to the router; without a report there is no router."""

    def __init__(self) -> None:
        self._up: bool | None = None
        self._heard_ns = self._stale_until_ns = 0

    @property
    def is_down(self) -> bool:
        """Whether there is a router and it cannot be reached."""
        return self._up is False

    def take(self, up: bool) -> bool:
        """Record the state of the link; return whether the link was lost or has come back."""
        before, self._up = self._up, up
        return up != (before is not False)

    def note(self, now_ns: int) -> None:
        """Record that a message was heard."""
        if now_ns - self._heard_ns > _GAP:
            self._stale_until_ns = now_ns + DRAIN
        self._heard_ns = now_ns

    def is_stale(self, now_ns: int) -> bool:
        """Return whether a message that is heard now may have waited in the router."""
        return self._up is not None and now_ns < self._stale_until_ns

    def may_be_silent(self, since_ns: int, now_ns: int) -> bool:
        """Return whether the router, not the robots, may have been silent since `since_ns`."""
        return self._up is not None and now_ns - since_ns < _SILENCE
