"""The messages as JSON Schemas, for programs that read the bytes without this code.

Decides: how a message is described.  Must not know: where the description is stored.
"""

from __future__ import annotations

from functools import cache, reduce
from operator import or_
from typing import Any

import msgspec

from protocol.codec import KINDS
from protocol.messages import Plan


def schema_name(kind: str) -> str:
    """Return the schema's name for a kind of key, "splinefleet.Report" for "report"."""
    return f"splinefleet.{KINDS[kind][0].__name__}"


@cache
def json_schema(kind: str) -> bytes:
    """Return the JSON Schema (2020-12) of the messages on a kind of key, as JSON.

    A message is an array: the tag, then the fields in order, each titled with its name, and for a
    Plan its seal (codec.py).  The binary fields, described as base64 in JSON, are plain msgpack
    `bin`.
    """
    types = KINDS[kind]
    schema: dict[str, Any] = msgspec.json.schema(reduce(or_, types))
    for message in types:
        names = ["tag", *(field.name for field in msgspec.structs.fields(message))]
        items = schema["$defs"][message.__name__]["prefixItems"]
        for name, item in zip(names, items, strict=True):
            item["title"] = name
        if message is Plan:
            items.append({"title": "seal", "type": "integer", "minimum": 0, "maximum": 2**32 - 1})
    return msgspec.json.encode(schema)
