"""Messages to bytes and back; the only place that knows msgpack.

Decides: what bytes are acceptable.  `decode` never raises on bytes from the wire: it returns
None for anything that is too long, malformed, of the wrong kind for its key or out of bounds.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Sequence
from typing import Final

import msgspec

from protocol.messages import (
    MAX_MESSAGE_BYTES,
    Clock,
    Command,
    Hello,
    Message,
    Plan,
    Refusal,
    Report,
)

KINDS: Final[dict[str, tuple[type[Message], ...]]] = {
    "hello": (Hello,),
    "plan": (Plan, Refusal),
    "command": (Command,),
    "report": (Report,),
    "clock": (Clock,),
}
"""Which messages may stand on which kind of key."""

_encoder: Final = msgspec.msgpack.Encoder()
_decoders: Final = {
    kind: msgspec.msgpack.Decoder(Plan | Refusal if kind == "plan" else types[0])
    for kind, types in KINDS.items()
}


class OversizeError(ValueError):
    """A message is longer than a robot can receive."""


def encode(message: Message) -> bytes:
    """Encode a message.

    Raises OversizeError above MAX_MESSAGE_BYTES, with both numbers.
    """
    payload = _encoder.encode(message)
    if len(payload) > MAX_MESSAGE_BYTES:
        whose = f" for {message.robot}" if isinstance(message, Plan) else ""
        raise OversizeError(
            f"{type(message).__name__}{whose} is {len(payload)} bytes long, "
            f"at most {MAX_MESSAGE_BYTES} reach a robot"
        )
    return payload


def decode(kind: str, payload: bytes) -> Message | None:
    """Decode what arrived on a key of this kind; None when it is not an acceptable message."""
    decoder = _decoders.get(kind)
    if decoder is None or len(payload) > MAX_MESSAGE_BYTES:
        return None
    try:
        message: Message = decoder.decode(payload)
    except (msgspec.MsgspecError, ValueError, RecursionError):
        return None
    return message if _is_sane(message) else None


def seal(plan: Plan) -> Plan:
    """Return the plan with its checksum filled in."""
    return msgspec.structs.replace(plan, checksum=checksum(plan))


def checksum(plan: Plan) -> int:
    """Return the CRC-32 over the plan's encoding with the checksum field at 0."""
    return zlib.crc32(_encoder.encode(msgspec.structs.replace(plan, checksum=0)))


def pack_floats(values: Sequence[float]) -> bytes:
    """Pack numbers as little-endian float32; OverflowError beyond its range."""
    return struct.pack(f"<{len(values)}f", *values)


def unpack_floats(packed: bytes) -> list[float]:
    """Unpack little-endian float32; ValueError when the length does not fit."""
    if len(packed) % 4:
        raise ValueError(f"{len(packed)} bytes are no whole number of float32")
    return list(struct.unpack(f"<{len(packed) // 4}f", packed))


def pack_stops(stops: Sequence[tuple[float, int]]) -> bytes:
    """Pack (arc length [m], departure [ns]) pairs."""
    return b"".join(struct.pack("<fq", s, depart_ns) for s, depart_ns in stops)


def unpack_stops(packed: bytes) -> list[tuple[float, int]]:
    """Unpack (arc length [m], departure [ns]) pairs; ValueError when the length does not fit."""
    if len(packed) % 12:
        raise ValueError(f"{len(packed)} bytes are no whole number of stops")
    return [(s, depart_ns) for s, depart_ns in struct.iter_unpack("<fq", packed)]


def _is_sane(message: Message) -> bool:
    """Check what msgspec cannot: finite numbers, packed lengths, the checksum."""
    if isinstance(message, Hello):
        limits = (message.radius_m, message.max_speed_mps, message.max_accel_mps2)
        return all(0.0 <= limit < math.inf for limit in limits)
    if isinstance(message, Report):
        return message.s_m is None or math.isfinite(message.s_m)
    if isinstance(message, Plan):
        packed = (message.knots, message.weights)
        return (
            len(message.points) % 8 == 0
            and len(message.profile) % 8 == 0
            and len(message.stops) % 12 == 0
            and all(len(field) % 4 == 0 for field in packed)
            and _is_finite(message)
            and checksum(message) == message.checksum
        )
    return True


def _is_finite(plan: Plan) -> bool:
    """Tell whether all packed numbers are finite; the packed lengths have been checked."""
    numbers = unpack_floats(plan.points + plan.knots + plan.weights + plan.profile)
    numbers += [s for s, _ in unpack_stops(plan.stops)]
    return all(map(math.isfinite, numbers))
