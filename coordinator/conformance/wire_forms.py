"""The same message in other bytes: with a field more, in longer forms, and not acceptable at all.

Decides: these bytes.  Must not know: what a message says.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable

import msgspec

from protocol.codec import encode
from protocol.messages import MAX_MESSAGE_BYTES, Message, Plan

Form = Callable[[Message], bytes]


def plain(message: Message) -> bytes:
    """Return a message as this version writes it."""
    return encode(message)


def with_later_fields(message: Message) -> bytes:
    """Return a message with two fields that no version knows."""
    return _packed(message, [["later", 1.5], {"later": None}], msgspec.msgpack.encode, _short_head)


def in_long_forms(message: Message) -> bytes:
    """Return a message whose numbers, texts and heads take more bytes than they need."""
    return _packed(message, [], _long, _long_head)


def with_wrong_seal(plan: Plan) -> bytes:
    """Return a Plan whose seal is that of other bytes."""
    whole = encode(plan)
    return whole[:-1] + bytes([whole[-1] ^ 1])


def spoilt(message: Message) -> list[bytes]:
    """Return bytes that are nearly the message, and none of them acceptable."""
    whole = encode(message)
    fields = _fields(message)
    texts = [str(field) if i == len(fields) // 2 else field for i, field in enumerate(fields)]
    return [
        b"",
        b"\xc1",
        b"\xdd\xff\xff\xff\xff",
        b"\x91" * 3_000,
        whole[:-1],
        whole + b"\x00",
        msgspec.msgpack.encode(texts),
        msgspec.msgpack.encode([*fields, bytes(MAX_MESSAGE_BYTES)]),
        msgspec.msgpack.encode([99, *fields[1:]]),
    ]


def _fields(message: Message) -> list[object]:
    fields: list[object] = msgspec.msgpack.decode(msgspec.msgpack.encode(message))
    return fields


def _packed(
    message: Message,
    more: list[object],
    pack: Callable[[object], bytes],
    head: Callable[[int], bytes],
) -> bytes:
    fields = [*_fields(message), *more]
    is_plan = isinstance(message, Plan)
    whole = head(len(fields) + is_plan) + b"".join(map(pack, fields))
    return whole + struct.pack(">BI", 0xCE, zlib.crc32(whole)) if is_plan else whole


def _short_head(count: int) -> bytes:
    return bytes([0x90 + count]) if count < 16 else struct.pack(">BH", 0xDC, count)


def _long_head(count: int) -> bytes:
    return struct.pack(">BI", 0xDD, count)


def _long(value: object) -> bytes:
    if isinstance(value, int) and not isinstance(value, bool):
        return struct.pack(">Bq", 0xD3, value)
    if isinstance(value, str):
        return struct.pack(">BI", 0xDB, len(value.encode())) + value.encode()
    if isinstance(value, bytes):
        return struct.pack(">BI", 0xC6, len(value)) + value
    if isinstance(value, list):
        return _long_head(len(value)) + b"".join(map(_long, value))
    return msgspec.msgpack.encode(value)
