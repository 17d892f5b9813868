"""What a coordinator knows of the router between it and its robots; one that listens has none.

A router that dies takes everybody's link at once, and one that hangs keeps what was said: then
nobody has failed but the router.  The robots stop by their leases; what is held back is stale.

Decides: whether robots that fell silent together are to be waited for, and what is stale.  Must not
know: messages, phases, how the link is looked at.
"""

from __future__ import annotations

from typing import Final

from coordinator.fleet.own_outage import DRAIN
from protocol.timing import REPORT_PERIOD, SECOND

_GAP: Final = 3 * REPORT_PERIOD // 2
"""When nobody was heard for so long, the router may have held back what comes next."""

_SILENCE: Final = 15 * SECOND
"""How long robots are waited for that fell silent together: a hung router's link, zenohd's own
lease being 10 s, is known to be gone by then."""


class RouterLink:
    """The link as it was told of; without any word of it there is no router."""

    def __init__(self) -> None:
        self._up: bool | None = None
        self._heard_ns = self._stale_until_ns = 0

    @property
    def is_down(self) -> bool:
        """Tell whether there is a router, which cannot be reached."""
        return self._up is False

    def take(self, up: bool) -> bool:
        """Take note of the link; tell whether it was lost, or has come back."""
        before, self._up = self._up, up
        return up != (before is not False)

    def note(self, now_ns: int) -> None:
        """Take note that somebody is heard."""
        if now_ns - self._heard_ns > _GAP:
            self._stale_until_ns = now_ns + DRAIN
        self._heard_ns = now_ns

    def is_stale(self, now_ns: int) -> bool:
        """Tell whether what is heard now may have waited in the router."""
        return self._up is not None and now_ns < self._stale_until_ns

    def may_be_silent(self, since_ns: int, now_ns: int) -> bool:
        """Tell whether it may be the router that has been silent since then, not the robots."""
        return self._up is not None and now_ns - since_ns < _SILENCE
