"""Write messages into an MCAP file, as their raw bytes.

Layout: the metadata record "splinefleet", attachments, then chunks (zstd, with CRCs).  Each key has
a channel, and a plain second one for payloads that are not valid messages for the key
(channels.py).  log_time is the coordinator's clock plus `wall_offset_ns`; publish_time is the
sender's time stamp if there is one, else log_time.  The order of the records is the order of the
calls.

Decides: how a log is laid out.  Must not know: threads, clocks, what the messages mean.
"""

from __future__ import annotations

import os
import stat
import struct
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Final, NamedTuple

from mcap.exceptions import McapError
from mcap.writer import CompressionType, Writer
from zstandard import ZstdError

from coordinator.base.errors import InputError
from coordinator.base.own_file import open_own
from coordinator.log.channels import PLAIN, Description, describe

METADATA_NAME: Final = "splinefleet"
WALL_OFFSET: Final = "wall_offset_ns"
"""The metadata entry to subtract from log times to get the coordinator's clock."""

VIRTUAL: Final = "virtual"
"""The metadata entry of a log whose times are of no day: its fleet drove in virtual time."""

MOST_CHANNELS: Final = 60_000
"""How many channels a log may have: enough for the keys of the largest fleet.

The format allows 65,535.  Messages on further keys, which someone must have invented, are dropped
and counted."""

CHUNK_BYTES: Final = 128 * 1024
"""The size of a chunk; compressing a larger one would block the interpreter for too long."""

WRITE_ERRORS: Final = (OSError, ValueError, struct.error, McapError, ZstdError)
"""What the methods of a LogWriter raise when the log cannot be written."""

_LAST_STAMP: Final = 2**64 - 1
_SYNC: Final = getattr(os, "fdatasync", os.fsync)


class Attachment(NamedTuple):
    """A file inside the log, such as scenario.json."""

    name: str
    media_type: str
    data: bytes


class LogWriter:
    """An open log.

    `metadata` is written unchanged, with an entry added for `wall_offset_ns`: wall clock minus
    coordinator's clock [ns].  Metadata and attachments are in the file when the constructor
    returns, messages at the latest after `flush`.  Raises InputError if the file cannot be created
    or written, if another program is writing it, or if `replace` is false and the file exists.
    """

    def __init__(
        self,
        path: Path,
        *,
        metadata: Mapping[str, str],
        wall_offset_ns: int,
        attachments: Iterable[Attachment] = (),
        replace: bool = True,
    ) -> None:
        self.dropped = 0
        """How many messages were not written because there were too many keys."""
        self._wall_offset_ns = wall_offset_ns
        self._schemas: dict[str, int] = {"": 0}
        self._descriptions: dict[str, Description] = {}
        self._channels: dict[tuple[str, bool], int] = {}
        self._sequences: dict[str, int] = {}
        try:
            self._stream = open_own(path, replace=replace)
            self._begin({**metadata, WALL_OFFSET: str(wall_offset_ns)}, attachments)
        except OSError as error:
            raise InputError([write_problem(path, error)]) from None

    @property
    def size(self) -> int:
        """How many bytes have been written to the file."""
        return self._stream.tell()

    def record(self, key: str, payload: bytes, now_ns: int, sent_ns: int | None = None) -> None:
        """Write a message that passed at `now_ns` on the coordinator's clock.

        `sent_ns` is the sender's time stamp [ns since 1970].
        """
        described = self._descriptions.get(key) or describe(key)
        if len(self._descriptions) < MOST_CHANNELS:
            self._descriptions[key] = described
        place = (key, described.fits(payload))
        channel = self._channels.get(place)
        if channel is None and len(self._channels) >= MOST_CHANNELS:
            self.dropped += 1
            return
        if channel is None:
            channel = self._register(key, described if place[1] else PLAIN)
            self._channels[place] = channel
        sequence = self._sequences.get(key, 0)
        self._sequences[key] = (sequence + 1) % 2**32
        log_time = _stamp(now_ns + self._wall_offset_ns)
        publish_time = log_time if sent_ns is None else _stamp(sent_ns)
        self._writer.add_message(channel, log_time, payload, publish_time, sequence)

    def attach(self, attachment: Attachment) -> None:
        """Write a file."""
        name, media_type, data = attachment
        self._writer.add_attachment(0, 0, name, media_type, data)

    def flush(self) -> None:
        """Write everything so far to the file; this ends a chunk."""
        self._writer.flush()  # type: ignore[no-untyped-call]

    def sync(self) -> None:
        """Flush, and wait until the disk has it, if this is a file on a disk."""
        self.flush()
        if stat.S_ISREG(os.fstat(self._stream.fileno()).st_mode):
            _SYNC(self._stream.fileno())

    def finish(self) -> None:
        """Write the end of the log and close the file."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._stream.close()

    def abandon(self) -> None:
        """Close the file without the end of the log, as a killed program does."""
        with suppress(OSError):
            self._stream.close()

    def _begin(self, metadata: dict[str, str], attachments: Iterable[Attachment]) -> None:
        try:
            self._writer = begin_file(self._stream)
            self._writer.add_metadata(METADATA_NAME, metadata)
            for attachment in attachments:
                self.attach(attachment)
            self.sync()
        except BaseException:
            self.abandon()
            raise

    def _register(self, key: str, described: Description) -> int:
        """Register a channel, with the schema of its payloads if there is one."""
        if described.name not in self._schemas:
            self._schemas[described.name] = self._writer.register_schema(
                described.name, "jsonschema", described.schema
            )
        schema = self._schemas[described.name]
        return self._writer.register_channel(key, described.encoding, schema)


def begin_file(stream: IO[bytes]) -> Writer:
    """Return the writer of an MCAP file with every checksum of the format, its header written."""
    writer = Writer(
        stream,
        chunk_size=CHUNK_BYTES,
        compression=CompressionType.ZSTD,
        enable_crcs=True,
        enable_data_crcs=True,
    )
    writer.start(profile="", library="splinefleet")
    return writer


def _stamp(time_ns: int) -> int:
    """Return a time clipped to the range of the format: a sender's clock may show anything."""
    return min(max(time_ns, 0), _LAST_STAMP)


def write_problem(path: Path, error: BaseException) -> str:
    """Return a sentence that says why a log cannot be written."""
    reason = error.strerror if isinstance(error, OSError) else str(error)
    return f"{path}: the log cannot be written: {reason or repr(error)}"
