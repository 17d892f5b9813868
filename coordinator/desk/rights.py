"""Who may look at a fleet and who may command it, over HTTP.

Decides: which requests are answered.  Must not know: how requests travel (web.py).

On this machine, without TLS, everybody who can open a connection may command: the link between
programs of one machine is as open.  Elsewhere there is TLS alone, and both sides show a certificate
of the fleet's authority: an observer may look, an operator may command.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import NamedTuple

from protocol.badge import badge_of
from protocol.endpoint import Endpoint


class Right(IntEnum):
    """What a party may do."""

    NOTHING = 0
    LOOK = 1
    COMMAND = 2


class Party(NamedTuple):
    """Who sends a request, "" if that is not known, and what it may do."""

    name: str
    right: Right


def party_of(common_name: str | None, *, may_command: bool) -> Party:
    """Return who has a certificate with this common name; None: there is no TLS."""
    if common_name is None:
        return Party("", Right.COMMAND if may_command else Right.LOOK)
    badge = badge_of(common_name)
    right = {"operator": Right.COMMAND, "observer": Right.LOOK}.get(badge.role if badge else "")
    if badge is None or right is None:
        return Party("", Right.NOTHING)
    return Party(badge.name, right if may_command else Right.LOOK)


def is_foreign(headers: Mapping[str, str], *, is_local: bool) -> bool:
    """Return whether a page of somebody else made a browser send this request.

    A browser names the page's origin in what it sends to another one.  A name of somebody else's
    that resolves to this machine shows in the Host.
    """
    host = headers.get("host", "")
    has_port = ":" in host and not host.endswith("]")  # Port 80 is left out.
    name = host.rpartition(":")[0] if has_port else host
    if is_local and not Endpoint("tcp", name.strip("[]"), 0).is_loopback:
        return True
    origin = headers.get("origin")
    return origin is not None and origin.partition("//")[2] != host
