"""The address of a link: tcp/HOST:PORT, or tls/HOST:PORT with keys.

Decides: what an endpoint looks like, and whether only this machine can reach it.  Zenoh reports a
malformed endpoint late: a client retries it until its time-out.
"""

from __future__ import annotations

import ipaddress
import re
from typing import Final, NamedTuple

from protocol.transport import TransportError

_ENDPOINT: Final = re.compile(r"(tcp|tls)/(\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9_.-]+):(\d{1,5})")


class Endpoint(NamedTuple):
    """A protocol, a host (an IPv6 address without brackets) and a port."""

    protocol: str
    host: str
    port: int

    @property
    def is_loopback(self) -> bool:
        """Return whether only this machine can reach it."""
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False


def endpoint_of(text: str, locked: bool = False) -> Endpoint:
    """Parse an endpoint; `locked`: whether the link uses keys.

    Raises TransportError with one sentence for the user.
    """
    parts = _ENDPOINT.fullmatch(text)
    wanted = "tls" if locked else "tcp"
    if parts is None or not 0 < int(parts[3]) < 65_536:
        raise TransportError(
            f"{text!r} is not an endpoint; it must be {wanted}/HOST:PORT, "
            f"as in {wanted}/127.0.0.1:7447"
        )
    if parts[1] != wanted:
        why = "with --keys it is tls/HOST:PORT" if locked else "tls needs --keys DIR"
        raise TransportError(f"{text}: {why}")
    return Endpoint(parts[1], parts[2].strip("[]"), int(parts[3]))


def usual_endpoint(locked: bool) -> str:
    """Return the endpoint on which a coordinator listens by default."""
    return f"{'tls' if locked else 'tcp'}/127.0.0.1:7447"


def check_reach(endpoint: Endpoint, locked: bool, insecure: bool) -> None:
    """Raise TransportError if other machines could connect without keys.

    `insecure`: the user has allowed it.
    """
    if not (locked or insecure or endpoint.is_loopback):
        raise TransportError(
            f"{endpoint.host}: without keys only programs on this machine may connect; "
            "give --keys DIR, or --insecure on a network that you trust"
        )
