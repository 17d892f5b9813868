"""How many bytes of a Plan message a path and its speeds may take.

Decides: when a path or its speeds need fewer knots to fit.  Must not know: how knots are removed.
"""

from __future__ import annotations

from typing import Final

from protocol.messages import MAX_MESSAGE_BYTES

_ELSE: Final = 400
"""Bytes reserved for the other fields: names, numbers, checksum, and about ten waits."""

ROOM: Final = MAX_MESSAGE_BYTES - _ELSE
"""Bytes available for the path and its speeds."""

MOST_SPEEDS: Final = 200
"""How many of the 256 distinct speeds of a message a path may take; rests take some, too."""

_PER_POINT: Final = 12
"""Bytes of one control point (x and y) together with one knot."""

_PER_KNOT: Final = 5
_PER_SPEED: Final = 4
"""Bytes of one speed knot, and of each distinct speed."""


_SPEEDS_PER_PATH: Final = 0.5
"""Expected bytes of speed knots for each byte of a path on which the robot must slow in bends."""


def expected_bytes(points: int, slows: bool) -> float:
    """Return how many bytes a path and its speeds may take; `slows`: whether it does in bends."""
    return path_bytes(points) * (1.0 + _SPEEDS_PER_PATH * slows)


def path_bytes(points: int) -> int:
    """Return how many bytes a cubic path with this many control points takes."""
    return _PER_POINT * points


def speed_bytes(knots: int, speeds: int) -> int:
    """Return how many bytes `knots` speed knots with `speeds` distinct speeds take."""
    return _PER_KNOT * knots + _PER_SPEED * speeds
