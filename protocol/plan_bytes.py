"""Numbers packed into the fields of a Plan, little-endian, and unpacked again.

Decides: how control points, speed knots and stops are laid out in bytes.  Must not know: messages.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

Pair = tuple[float, float]


class OversizeError(ValueError):
    """Raised for a message that is too long for a robot, or for its own format."""


def pack_floats(values: Sequence[float]) -> bytes:
    """Pack numbers as float32; raises OverflowError for a number out of its range."""
    return struct.pack(f"<{len(values)}f", *values)


def unpack_floats(packed: bytes) -> list[float]:
    """Unpack float32; ValueError when the length does not fit."""
    _check(packed, 4, "float32")
    return list(struct.unpack(f"<{len(packed) // 4}f", packed))


def pack_points(points: Sequence[Pair]) -> bytes:
    """Pack points (x, y) [m] as float32."""
    return pack_floats([value for point in points for value in point])


def unpack_points(packed: bytes) -> list[Pair]:
    """Unpack points (x, y) [m]; ValueError when the length does not fit."""
    _check(packed, 8, "points")
    return list(struct.iter_unpack("<ff", packed))


def pack_profile(knots: Sequence[Pair]) -> tuple[bytes, bytes]:
    """Pack speed knots (s [m], v [m/s]) as the distinct speeds, and each s with its speed's index.

    Raises OversizeError beyond 256 distinct speeds.
    """
    speeds = sorted({v for _, v in knots})
    if len(speeds) > 256:
        raise OversizeError(f"{len(speeds)} different speeds, a plan can have at most 256")
    index = {v: i for i, v in enumerate(speeds)}
    return pack_floats(speeds), b"".join(struct.pack("<fB", s, index[v]) for s, v in knots)


def unpack_profile(packed_speeds: bytes, packed: bytes) -> list[Pair]:
    """Unpack speed knots (s [m], v [m/s]); ValueError when the fields do not fit together."""
    speeds = unpack_floats(packed_speeds)
    _check(packed, 5, "speed knots")
    knots = list(struct.iter_unpack("<fB", packed))
    if any(index >= len(speeds) for _, index in knots):
        raise ValueError(f"a speed knot has an index beyond the {len(speeds)} speeds")
    return [(s, speeds[index]) for s, index in knots]


def pack_stops(stops: Sequence[tuple[float, int]]) -> bytes:
    """Pack stops (s [m], departure [ns])."""
    return b"".join(struct.pack("<fq", s, depart_ns) for s, depart_ns in stops)


def unpack_stops(packed: bytes) -> list[tuple[float, int]]:
    """Unpack stops (s [m], departure [ns]); ValueError when the length does not fit."""
    _check(packed, 12, "stops")
    return list(struct.iter_unpack("<fq", packed))


def _check(packed: bytes, size: int, what: str) -> None:
    if len(packed) % size:
        raise ValueError(f"{len(packed)} bytes are not a whole number of {what}")
