"""How much of a Plan message a path and the speeds on it may take.

Decides: from when on they have to be told with fewer numbers.  Must not know: how.
"""

from __future__ import annotations

from typing import Final

from protocol.messages import MAX_MESSAGE_BYTES

_ELSE: Final = 400
"""Bytes that are left for everything else: names, numbers, checksum, and about ten waits."""

ROOM: Final = MAX_MESSAGE_BYTES - _ELSE
"""Bytes for path and speeds."""

_PER_POINT: Final = 12
"""Bytes of a control point, x and y, and of a knot."""

_PER_KNOT: Final = 5
_PER_SPEED: Final = 4
"""Bytes of a speed knot, and of each different speed."""


def path_bytes(points: int) -> int:
    """Return the bytes that a cubic path of so many control points takes."""
    return _PER_POINT * points


def speed_bytes(knots: int, speeds: int) -> int:
    """Return the bytes that so many speed knots of so many different speeds take."""
    return _PER_KNOT * knots + _PER_SPEED * speeds
