"""Which version wrote a log, and whether its messages can be read.

Logs, plans and black boxes of each released version can be read by all later ones; there is a run
of each in tests/golden/runs.  Decides: which logs are refused, and how versions are told.  Must not
know: what messages mean.
"""

from __future__ import annotations

import platform
from collections.abc import Mapping
from importlib.metadata import version
from typing import Final

from protocol.messages import PROTOCOL_VERSION

WRITTEN_BY: Final = "splinefleet"
"""The metadata key for the version that wrote the log; also the name of the package."""

_PROTOCOL: Final = "protocol"
"""The metadata key for the version of the protocol."""

_LIBRARIES: Final = ("eclipse-zenoh", "mcap", "msgspec", "numpy", "scipy", "shapely")


def ours() -> dict[str, str]:
    """Return the versions of this program, its protocol and its libraries, as a log states them."""
    return {
        _PROTOCOL: str(PROTOCOL_VERSION),
        "python": platform.python_version(),
        **{name: version(name) for name in (WRITTEN_BY, *_LIBRARIES)},
    }


def protocol_of(metadata: Mapping[str, str]) -> int | None:
    """Return the protocol of a log's messages; None if its metadata do not state it."""
    stated = metadata.get(_PROTOCOL, "")
    return int(stated) if stated.isascii() and stated.isdecimal() and len(stated) < 4 else None


def objection(metadata: Mapping[str, str]) -> str:
    """Return why a log with these metadata cannot be read; empty if it can."""
    protocol = protocol_of(metadata)
    if protocol is None or protocol <= PROTOCOL_VERSION:
        return ""
    return (
        f"holds messages of protocol {protocol}, written by splinefleet "
        f"{metadata.get(WRITTEN_BY, '(unknown)')}; this is splinefleet {version(WRITTEN_BY)}, "
        f"which reads protocols up to {PROTOCOL_VERSION}: install a later version"
    )
