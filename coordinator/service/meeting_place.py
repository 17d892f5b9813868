"""Where a coordinator meets its robots: it routes for them itself, or is a client as they are.

Decides: which link is opened, and what people are told of it.  Must not know: what is said there.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from coordinator.base.errors import InputError
from coordinator.security.link_admission import Gate
from coordinator.service.key_option import where_to_listen
from protocol.endpoint import endpoint_of
from protocol.zenoh_transport import ZenohTransport


@dataclass(frozen=True)
class MeetingPlace:
    """An endpoint; `routed` when a router listens there, and not the coordinator itself."""

    endpoint: str
    routed: bool = False

    def open(self, gate: Gate | None = None) -> ZenohTransport:
        """Open the link, locked by a gate's keys; at a router, who may do what is the router's.

        Raises TransportError, NoAnswerError where no router answers in 5 s.
        """
        if self.routed:
            keys = None if gate is None else gate.files
            return ZenohTransport.connect(self.endpoint, whom="router", keys=keys)
        return ZenohTransport.listen(self.endpoint) if gate is None else gate.listen(self.endpoint)

    def __str__(self) -> str:
        """Say how the coordinator is reached."""
        return f"{'at the router' if self.routed else 'listening on'} {self.endpoint}"


def meeting_place(
    listen: str | None, connect: str | None, keys: Path | None = None, insecure: bool = False
) -> MeetingPlace:
    """Return the place that two options name; without either the coordinator listens here.

    Raises InputError, and TransportError for an endpoint that is malformed or open to strangers.
    """
    if listen is not None and connect is not None:
        raise InputError(["--connect: a coordinator listens itself or is a router's client"])
    if connect is not None:
        endpoint_of(connect, locked=keys is not None)
        return MeetingPlace(connect, routed=True)
    return MeetingPlace(where_to_listen(listen, keys, insecure))
