"""What a coordinator knows of the router between it and its robots.

A coordinator that listens for its robots itself has no router.  A router that dies cuts all links
at once, and a router that hangs holds messages back: then the router has failed, not the robots.

Decides: whether to wait for robots that fell silent together.  Must not know: messages, phases, how
the link is watched.
"""

from __future__ import annotations

from typing import Final

from protocol.timing import SECOND

_SILENCE: Final = 15 * SECOND
"""How long to wait for robots that fell silent together.

By then the link to a hung router is known to be gone, because zenohd's own lease is 10 s."""


class RouterLink:
    """The last reported state of the link to the router; without a report there is no router."""

    def __init__(self) -> None:
        self._up: bool | None = None

    @property
    def is_down(self) -> bool:
        """Whether there is a router and it cannot be reached."""
        return self._up is False

    def plain(self) -> bool | None:
        """Return the state as plain data."""
        return self._up

    def take(self, up: bool) -> bool:
        """Record the state of the link; return whether the link was lost or has come back."""
        before, self._up = self._up, up
        return up != (before is not False)

    def may_be_silent(self, since_ns: int, now_ns: int) -> bool:
        """Return whether the router, not the robots, may have been silent since `since_ns`."""
        return self._up is not None and now_ns - since_ns < _SILENCE
