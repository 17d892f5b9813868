"""Messages to bytes and back; the only place that knows msgpack.

Decides: what bytes are acceptable.  `decode` never raises on bytes from the wire: it returns
None for anything that is too long, malformed, of the wrong kind for its key or out of bounds.
"""

from __future__ import annotations

import math
import zlib
from functools import reduce
from operator import or_
from typing import Final, TypeVar

import msgspec

from protocol.messages import (
    MAX_MESSAGE_BYTES,
    Admit,
    Clock,
    Command,
    Hello,
    Message,
    NewTimes,
    Pace,
    Plan,
    Refusal,
    Report,
)
from protocol.plan_bytes import (
    OversizeError,
    unpack_floats,
    unpack_points,
    unpack_profile,
    unpack_stops,
)

KINDS: Final[dict[str, tuple[type[Message], ...]]] = {
    "hello": (Hello,),
    "plan": (Plan, Refusal, NewTimes),
    "command": (Command,),
    "report": (Report, Pace),
    "clock": (Clock,),
    "admit": (Admit,),
}
"""Which messages may be sent on which kind of key."""

_encoder: Final = msgspec.msgpack.Encoder()
_decoders: Final = {
    kind: msgspec.msgpack.Decoder(reduce(or_, types)) for kind, types in KINDS.items()
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
            f"a robot receives at most {MAX_MESSAGE_BYTES}"
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


Sealed = TypeVar("Sealed", Plan, NewTimes)


def seal(plan: Sealed) -> Sealed:
    """Return the plan with its checksum filled in."""
    return msgspec.structs.replace(plan, checksum=checksum(plan))


def checksum(plan: Plan | NewTimes) -> int:
    """Return the CRC-32 over the plan's encoding with the checksum field at 0."""
    return zlib.crc32(_encoder.encode(msgspec.structs.replace(plan, checksum=0)))


def _is_sane(message: Message) -> bool:
    """Check what msgspec cannot check: finite numbers, packed lengths, the checksum."""
    if isinstance(message, Hello):
        limits = (message.radius_m, message.max_speed_mps, message.max_accel_mps2)
        return all(0.0 <= limit < math.inf for limit in limits)
    if isinstance(message, Report):
        return message.rest is None or math.isfinite(message.rest.s_m)
    if isinstance(message, Plan):
        return _is_path_whole(message) and _is_whole(message)
    return not isinstance(message, NewTimes) or _is_whole(message)


def _is_whole(plan: Plan | NewTimes) -> bool:
    """Return whether the checksum fits and speeds, profile and stops unpack to finite numbers."""
    try:
        numbers = unpack_floats(plan.speeds)
        numbers += [s for s, _ in unpack_profile(plan.speeds, plan.profile)]
        numbers += [s for s, _ in unpack_stops(plan.stops)]
    except ValueError:
        return False
    return all(map(math.isfinite, numbers)) and checksum(plan) == plan.checksum


def _is_path_whole(plan: Plan) -> bool:
    """Return whether a path's packed fields can be unpacked and its numbers are finite."""
    try:
        numbers = unpack_floats(plan.knots) + unpack_floats(plan.weights)
        numbers += [value for place in unpack_points(plan.points) for value in place]
    except ValueError:
        return False
    return all(map(math.isfinite, numbers))
