"""How the keys of a log are described: the encoding and JSON Schema of the payloads on each key.

A payload that is not a valid message for its key is put on a second, plain channel with the same
key, so that a reader that decodes a log by its schemas never gets an invalid payload.

Decides: the channel of each payload.  Must not know: how a log is written.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final, NamedTuple

import msgspec

from coordinator.fleet.log_records import (
    LINK_GONE,
    LINK_UP,
    TOLD_TO_GO_ON,
    TOLD_TO_STOP,
    Request,
    Search,
    drops_of,
    is_adoption_key,
    is_ahead_key,
    is_checkpoint_key,
    is_course_key,
    is_drops_key,
    is_router_key,
    is_told_key,
    request_of,
    search_of,
)
from coordinator.security.denials import Denial, denial_of, is_denial_key
from protocol import keys
from protocol.codec import KINDS, decode
from protocol.schema import json_schema, schema_name


class Description(NamedTuple):
    """The payloads on a key; `fits` returns whether a payload is valid.

    If `name` is empty, there is no schema.
    """

    encoding: str
    fits: Callable[[bytes], bool]
    name: str = ""
    schema: bytes = b""


def _anything(_payload: bytes) -> bool:
    return True


PLAIN: Final = Description("application/octet-stream", _anything)
"""Payloads of unknown content."""

_LINK: Final = Description(
    "msgpack",
    (LINK_UP, LINK_GONE).__contains__,
    "splinefleet.Link",
    msgspec.json.encode({"title": "link", "description": "up or gone", "type": "boolean"}),
)
_AHEAD: Final = Description(
    "msgpack", _anything, "splinefleet.Ahead", msgspec.json.encode({"type": "integer"})
)
_CHECKPOINT: Final = Description(
    "msgpack", _anything, "splinefleet.Checkpoint", msgspec.json.encode({"type": "object"})
)
_TOLD: Final = Description(
    "json",
    (TOLD_TO_STOP, TOLD_TO_GO_ON).__contains__,
    "splinefleet.Told",
    msgspec.json.encode({"type": "string"}),
)


def describe(key: str) -> Description:
    """Return the description of a key's payloads; PLAIN if the key is not one of splinefleet's."""
    if is_adoption_key(key):
        schema = msgspec.json.encode(msgspec.json.schema(Request))
        return Description("json", _is_request, "splinefleet.Epoch", schema)
    if is_course_key(key):
        schema = msgspec.json.encode(msgspec.json.schema(Search))
        return Description("json", _is_search, "splinefleet.Course", schema)
    if is_denial_key(key):
        schema = msgspec.json.encode(msgspec.json.schema(Denial))
        return Description("json", _is_denial, "splinefleet.Denial", schema)
    if is_checkpoint_key(key):
        return _CHECKPOINT
    if is_ahead_key(key):
        return _AHEAD
    if is_told_key(key):
        return _TOLD
    if is_router_key(key):
        return _LINK
    if is_drops_key(key):
        schema = msgspec.json.encode(msgspec.json.schema(dict[str, int]))
        return Description("json", _is_drops, "splinefleet.Dropped", schema)
    ours = keys.split(key)
    kind = "" if ours is None else ours[1]
    if kind == "alive":
        return _LINK
    if kind not in KINDS:
        return PLAIN
    return Description("msgpack", partial(_is_message, kind), schema_name(kind), json_schema(kind))


def _is_message(kind: str, payload: bytes) -> bool:
    return decode(kind, payload) is not None


def _is_denial(payload: bytes) -> bool:
    return denial_of(payload) is not None


def _is_request(payload: bytes) -> bool:
    return request_of(payload) is not None


def _is_search(payload: bytes) -> bool:
    return search_of(payload) is not None


def _is_drops(payload: bytes) -> bool:
    return drops_of(payload) is not None
