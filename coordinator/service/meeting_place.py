"""Where a coordinator meets its robots: it listens itself, or all are clients of a router.

Decides: which link is opened, and how it is described.  Must not know: which messages it carries.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from coordinator.security.link_admission import Gate
from coordinator.service.key_option import where_to_listen
from protocol.endpoint import endpoint_of
from protocol.zenoh_transport import ZenohTransport

SOMEWHERE: Final = "--connect ..."
"""The option of commands in texts that do not know where a fleet is reached."""


@dataclass(frozen=True)
class MeetingPlace:
    """An endpoint; `routed` is true if a router listens there, not the coordinator itself."""

    endpoint: str
    routed: bool = False

    def open(self, gate: Gate | None = None) -> ZenohTransport:
        """Open the link, with the keys of a gate if there is one.

        At a router, the router's configuration decides who may do what.  Raises TransportError, or
        NoAnswerError if no router answers within 5 s.
        """
        if self.routed:
            keys = None if gate is None else gate.files
            return ZenohTransport.connect(self.endpoint, whom="router", keys=keys)
        return ZenohTransport.listen(self.endpoint) if gate is None else gate.listen(self.endpoint)

    def options(self, keys: Path | None) -> str:
        """Return the options by which other programs connect, in words; "..." for what varies."""
        host = endpoint_of(self.endpoint, locked=keys is not None).host
        if host in ("0.0.0.0", "::"):  # Others connect to an address of this machine.
            return SOMEWHERE
        return f"--connect {self.endpoint}" + ("" if keys is None else f" --keys {keys}")

    def __str__(self) -> str:
        """Return how the coordinator is reached, in words."""
        return f"{'at the router' if self.routed else 'listening on'} {self.endpoint}"


def meeting_place(
    listen: str | None, connect: str | None, keys: Path | None = None, insecure: bool = False
) -> MeetingPlace:
    """Return the place that --listen or --connect names; by default listen on this machine.

    The commands take one of the two.  Raises TransportError if an endpoint is malformed or is open
    to strangers.
    """
    if connect is not None:
        endpoint_of(connect, locked=keys is not None)
        return MeetingPlace(connect, routed=True)
    return MeetingPlace(where_to_listen(listen, keys, insecure))
