"""What a log holds, as data.

Decides: the fields.  Must not know: the file format.
"""

from __future__ import annotations

import msgspec


class Record(msgspec.Struct, frozen=True):
    """A message as it went by.

    `log_ns` is on the coordinator's clock, `publish_ns` is the sender's stamp [ns since 1970],
    `offset` is the place in the file of the chunk that holds the message.
    """

    key: str
    payload: bytes
    log_ns: int
    publish_ns: int
    offset: int


class Log(msgspec.Struct, frozen=True):
    """What a log holds, the records in the order in which they were recorded.

    `complete` tells whether the file was closed; `damage` says where its bytes are not as they
    were written, and is empty when they are.
    """

    metadata: dict[str, str]
    attachments: dict[str, bytes]
    records: list[Record]
    complete: bool
    damage: str
