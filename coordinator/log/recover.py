"""Rewrite a log: repair one that is cut short or damaged, or add attachments to an intact one.

Decides: which records the new log has, and that a repaired log says that it is repaired.  Must not
know: files, what the messages mean.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from mcap import records as mcap_records
from mcap.writer import Writer

from coordinator.log.log_file import RECOVERED, scan_log
from coordinator.log.log_writer import METADATA_NAME, Attachment, begin_file
from coordinator.log.soundness import Sound


class Whole(NamedTuple):
    """The bytes of a repaired log, the numbers of its contents, and its state before the repair.

    `lost` counts intact messages that were left out because their channel was in a damaged chunk.
    `complete` and `damage` describe the log before the repair.
    """

    data: bytes
    messages: int
    chunks: int
    attachments: int
    lost: int
    complete: bool
    damage: str


def make_whole(data: bytes, path: str) -> Whole:
    """Return a closed log with all intact chunks, attachments and metadata of `data`, in order.

    Messages keep their bytes, both time stamps and their sequence numbers.  Raises InputError if
    the data is not a fleet's log; `path` names it in error messages.
    """
    log = scan_log(data, path)
    stream = io.BytesIO()
    copy = _Copy(begin_file(stream), log.sound)
    for _, record in log.sound:
        copy.add(record)
    if log.damage or not log.complete:
        copy.add_metadata(log.metadata)
        before = {"closed": "yes" if log.complete else "no", "damage": log.damage}
        copy.writer.flush()  # type: ignore[no-untyped-call]
        copy.writer.add_metadata(RECOVERED, before)
    copy.writer.finish()  # type: ignore[no-untyped-call]
    return Whole(
        data=stream.getvalue(),
        messages=copy.messages,
        chunks=copy.chunks,
        attachments=copy.attachments,
        lost=copy.lost,
        complete=log.complete,
        damage=log.damage,
    )


def with_files(data: bytes, path: str, files: Iterable[Attachment]) -> bytes | None:
    """Return a log with further attachments at its end and otherwise unchanged.

    Return None if the log was not closed or is damaged.  Raises InputError if the data is not a
    fleet's log.
    """
    log = scan_log(data, path)
    if log.damage or not log.complete:
        return None
    stream = io.BytesIO()
    copy = _Copy(begin_file(stream), log.sound)
    for _, record in log.sound:
        copy.add(record)
    copy.writer.flush()  # type: ignore[no-untyped-call]
    for file in files:
        copy.writer.add_attachment(0, 0, file.name, file.media_type, file.data)
    copy.writer.finish()  # type: ignore[no-untyped-call]
    return stream.getvalue()


class _Copy:
    """A copy of intact records; a channel or schema is written when a message first needs it."""

    def __init__(self, writer: Writer, sound: list[Sound]) -> None:
        self.writer = writer
        self.messages = self.chunks = self.attachments = self.lost = 0
        self._schemas: Mapping[int, mcap_records.Schema] = {
            record.id: record for _, record in sound if isinstance(record, mcap_records.Schema)
        }
        self._channels: Mapping[int, mcap_records.Channel] = {
            record.id: record for _, record in sound if isinstance(record, mcap_records.Channel)
        }
        self._metadata: dict[str, str] = {}
        self._new_schemas: dict[int, int] = {0: 0}
        self._new_channels: dict[int, int] = {}

    def add(self, record: mcap_records.McapRecord) -> None:
        """Write a record, unless the writer generates it from the others."""
        if isinstance(record, mcap_records.Message):
            self._add_message(record)
        elif isinstance(record, mcap_records.Chunk):
            self.writer.flush()  # type: ignore[no-untyped-call]
            self.chunks += 1
        elif isinstance(record, mcap_records.Metadata):
            self.writer.flush()  # type: ignore[no-untyped-call]
            self.writer.add_metadata(record.name, record.metadata)
            if record.name == METADATA_NAME:
                self._metadata = record.metadata
        elif isinstance(record, mcap_records.Attachment):
            self.writer.flush()  # type: ignore[no-untyped-call]
            self.writer.add_attachment(
                record.create_time, record.log_time, record.name, record.media_type, record.data
            )
            self.attachments += 1

    def add_metadata(self, metadata: dict[str, str]) -> None:
        """Write the log's metadata, unless the same metadata were written already."""
        if metadata != self._metadata:
            self.writer.flush()  # type: ignore[no-untyped-call]
            self.writer.add_metadata(METADATA_NAME, metadata)

    def _add_message(self, message: mcap_records.Message) -> None:
        channel = self._channels.get(message.channel_id)
        if channel is None:
            self.lost += 1
            return
        if channel.id not in self._new_channels:
            self._new_channels[channel.id] = self.writer.register_channel(
                channel.topic, channel.message_encoding, self._schema(channel), channel.metadata
            )
        self.writer.add_message(
            self._new_channels[channel.id],
            message.log_time,
            message.data,
            message.publish_time,
            message.sequence,
        )
        self.messages += 1

    def _schema(self, channel: mcap_records.Channel) -> int:
        """Return the id of a channel's schema in the new file; 0, no schema, if it is lost."""
        schema = self._schemas.get(channel.schema_id)
        if schema is None:
            return 0
        if schema.id not in self._new_schemas:
            self._new_schemas[schema.id] = self.writer.register_schema(
                schema.name, schema.encoding, schema.data
            )
        return self._new_schemas[schema.id]
