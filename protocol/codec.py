"""Messages to bytes and back; the only place that knows msgpack.

Decides: what bytes are acceptable.  `decode` never raises on bytes from the wire: it returns
None for anything that is too long, malformed, of the wrong kind for its key or out of bounds.
"""

from __future__ import annotations

import math
import zlib
from typing import Final

import msgspec

from protocol.messages import (
    MAX_MESSAGE_BYTES,
    Admit,
    Clock,
    Command,
    Hello,
    Message,
    Plan,
    Refusal,
    Report,
)
from protocol.packing import (
    OversizeError,
    unpack_floats,
    unpack_points,
    unpack_profile,
    unpack_stops,
)

KINDS: Final[dict[str, tuple[type[Message], ...]]] = {
    "hello": (Hello,),
    "plan": (Plan, Refusal),
    "command": (Command,),
    "report": (Report,),
    "clock": (Clock,),
    "admit": (Admit,),
}
"""Which messages may stand on which kind of key."""

_encoder: Final = msgspec.msgpack.Encoder()
_decoders: Final = {
    kind: msgspec.msgpack.Decoder(Plan | Refusal if kind == "plan" else types[0])
    for kind, types in KINDS.items()
}


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


def _is_sane(message: Message) -> bool:
    """Check what msgspec cannot: finite numbers, packed lengths, the checksum."""
    if isinstance(message, Hello):
        limits = (message.radius_m, message.max_speed_mps, message.max_accel_mps2)
        return all(0.0 <= limit < math.inf for limit in limits)
    if isinstance(message, Report):
        return message.rest is None or math.isfinite(message.rest.s_m)
    if isinstance(message, Plan):
        return _is_finite(message) and checksum(message) == message.checksum
    return True


def _is_finite(plan: Plan) -> bool:
    """Tell whether all packed fields are whole and their numbers finite."""
    try:
        numbers = unpack_floats(plan.knots + plan.weights + plan.speeds)
        numbers += [value for place in unpack_points(plan.points) for value in place]
        numbers += [s for s, _ in unpack_profile(plan.speeds, plan.profile)]
        numbers += [s for s, _ in unpack_stops(plan.stops)]
    except ValueError:
        return False
    return len(plan.knots) % 4 == len(plan.weights) % 4 == 0 and all(map(math.isfinite, numbers))
