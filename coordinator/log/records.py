"""The contents of a log, as data.

Decides: the fields.  Must not know: the file format.
"""

from __future__ import annotations

import msgspec


class Record(msgspec.Struct, frozen=True):
    """A recorded message.

    `log_ns` is the time of the record on the coordinator's clock, `publish_ns` the sender's time
    stamp [ns since 1970], `offset` the byte in the file at which the message's chunk begins.
    """

    key: str
    payload: bytes
    log_ns: int
    publish_ns: int
    offset: int


class Log(msgspec.Struct, frozen=True):
    """The contents of a log; the records are in the order in which they were recorded.

    `complete` is whether the file was closed.  `damage` says where the file's bytes differ from
    what was written; it is empty if the file is intact.  `before` has the logs that it resumes, the
    oldest first, if they are in the same folder.
    """

    metadata: dict[str, str]
    attachments: dict[str, bytes]
    records: list[Record]
    complete: bool
    damage: str
    before: tuple[Log, ...] = ()
