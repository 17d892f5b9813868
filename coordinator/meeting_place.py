"""Where a coordinator meets its robots: it routes for them itself, or is a client as they are.

Decides: which link is opened, and what people are told of it.  Must not know: what is said there.
"""

from __future__ import annotations

from dataclasses import dataclass

from coordinator.errors import InputError
from protocol.zenoh_transport import ZenohTransport

DEFAULT = "tcp/127.0.0.1:7447"


@dataclass(frozen=True)
class MeetingPlace:
    """An endpoint; `routed` when a router listens there, and not the coordinator itself."""

    endpoint: str
    routed: bool = False

    def open(self) -> ZenohTransport:
        """Open the link; raises TransportError, NoAnswerError where no router answers in 5 s."""
        if self.routed:
            return ZenohTransport.connect(self.endpoint, whom="router")
        return ZenohTransport.listen(self.endpoint)

    def __str__(self) -> str:
        """Say how the coordinator is reached."""
        return f"{'at the router' if self.routed else 'listening on'} {self.endpoint}"


def meeting_place(listen: str | None, connect: str | None) -> MeetingPlace:
    """Return the place that two options name; without either the coordinator listens here."""
    if listen is not None and connect is not None:
        raise InputError(["--connect: a coordinator listens itself or is a router's client"])
    if connect is not None:
        return MeetingPlace(connect, routed=True)
    return MeetingPlace(DEFAULT if listen is None else listen)
