"""Messages to bytes and back; the only place that knows msgpack.

Decides: what bytes are acceptable.  `decode` never raises on bytes from the wire: it returns
None for anything that is too long, malformed, of the wrong kind for its key or out of bounds.
"""

from __future__ import annotations

import math
import struct
import zlib
from functools import lru_cache, reduce
from operator import or_
from typing import Final

import msgspec

from protocol.messages import (
    LEAST_ACCEL,
    MAX_MESSAGE_BYTES,
    Admit,
    Block,
    Cancel,
    Clock,
    Command,
    Hello,
    Join,
    Leave,
    Message,
    Order,
    OrderState,
    Plan,
    Refusal,
    Report,
    Tell,
    Unblock,
)
from protocol.plan_bytes import (
    OversizeError,
    unpack_floats,
    unpack_points,
    unpack_profile,
    unpack_stops,
)

SEAL_BYTES: Final = 5
"""Length of the seal, the last element of an encoded Plan: a CRC-32 of all bytes before it.

It is a msgpack uint32 in its long form.  It is computed over the bytes as they are sent: a robot
checks it before it parses anything, and a Plan with more fields than the robot knows passes."""

KINDS: Final[dict[str, tuple[type[Message], ...]]] = {
    "hello": (Hello,),
    "plan": (Plan, Refusal),
    "command": (Command,),
    "report": (Report,),
    "clock": (Clock,),
    "admit": (Admit,),
    "order": (Order, Cancel),
    "orders": (OrderState, Order),
    "tell": (Tell,),
    "roster": (Join, Leave),
    "block": (Block, Unblock),
    "blocks": (Block, Unblock),
}
"""Which messages may be sent on which kind of key."""

_UINT32: Final = 0xCE

_KEPT: Final = 64
"""How many messages are kept as decoded: a coordinator's intake and its core decode each message,
and in a simulation every robot decodes the same Commands."""

_encoder: Final = msgspec.msgpack.Encoder()
_plan_decoder: Final = msgspec.msgpack.Decoder(Plan)
_decoders: Final = {
    kind: msgspec.msgpack.Decoder(reduce(or_, [one for one in types if one is not Plan]))
    for kind, types in KINDS.items()
}


def encode(message: Message) -> bytes:
    """Encode a message.

    Raises OversizeError above MAX_MESSAGE_BYTES, with both numbers.
    """
    payload = _encoder.encode(message)
    if isinstance(message, Plan):
        payload = _sealed(payload)
    if len(payload) > MAX_MESSAGE_BYTES:
        whose = f" for {message.robot}" if isinstance(message, Plan) else ""
        raise OversizeError(
            f"{type(message).__name__}{whose} is {len(payload)} bytes long, "
            f"a robot receives at most {MAX_MESSAGE_BYTES}"
        )
    return payload


@lru_cache(maxsize=_KEPT)
def decode(kind: str, payload: bytes) -> Message | None:
    """Decode what arrived on a key of this kind; None when it is not an acceptable message.

    Who decodes the same bytes again may get the same message, which is frozen.
    """
    decoder = _decoders.get(kind)
    if decoder is None or len(payload) > MAX_MESSAGE_BYTES:
        return None
    try:
        message: Message
        if kind == "plan" and payload[-SEAL_BYTES:] == _seal(payload[:-SEAL_BYTES]):
            message = _plan_decoder.decode(payload)
        else:
            message = decoder.decode(payload)
    except (msgspec.MsgspecError, ValueError, RecursionError):
        return None
    return message if _is_sane(message) else None


def _sealed(encoded: bytes) -> bytes:
    """Return an encoded array of 16 elements or more with its seal as one more element."""
    mark, count = struct.unpack_from(">BH", encoded)
    body = struct.pack(">BH", mark, count + 1) + encoded[3:]
    return body + _seal(body)


def _seal(body: bytes) -> bytes:
    return struct.pack(">BI", _UINT32, zlib.crc32(body))


def _is_sane(message: Message) -> bool:
    """Check what msgspec cannot check: finite numbers and packed lengths."""
    if isinstance(message, Hello):
        limits = (message.radius_m, message.max_speed_mps, message.max_accel_mps2)
        return all(0.0 <= limit < math.inf for limit in limits)
    if isinstance(message, Order):
        numbers = [*message.goal, *(number for place in message.via for number in place)]
        return all(map(math.isfinite, numbers))
    if isinstance(message, Join):
        accel = message.max_accel_mps2
        return all(map(math.isfinite, message.place)) and (accel == 0.0 or accel >= LEAST_ACCEL)
    if isinstance(message, Block):
        return all(math.isfinite(number) for place in message.polygon for number in place)
    if isinstance(message, Report):
        return message.rest is None or math.isfinite(message.rest.s_m)
    return not isinstance(message, Plan) or _is_whole(message)


def _is_whole(plan: Plan) -> bool:
    """Return whether all packed fields unpack to finite numbers."""
    try:
        numbers = unpack_floats(plan.knots) + unpack_floats(plan.weights)
        numbers += [value for place in unpack_points(plan.points) for value in place]
        numbers += unpack_floats(plan.speeds)
        numbers += [s for s, _ in unpack_profile(plan.speeds, plan.profile)]
        numbers += [s for s, _ in unpack_stops(plan.stops)]
    except ValueError:
        return False
    return all(map(math.isfinite, numbers))
