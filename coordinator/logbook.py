"""A log read back: whole, cut short by a kill, or damaged.

Decides: what of an MCAP file can still be used, and whether it is as it was written.  Must not
know: what the messages mean.

Two questions are kept apart.  A file that ends early is incomplete, and every record before its
end counts.  A file whose bytes contradict its own checksums or structure is damaged, and the
sentence that says so names the byte.  `recorder.py` writes every checksum of the format, so
that in a closed log no byte can change unseen.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final, NamedTuple

import msgspec
from mcap import records as mcap_records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.stream_reader import breakup_chunk
from mcap.writer import MCAP0_MAGIC
from zstandard import ZstdError

from coordinator.errors import InputError
from coordinator.file_kinds import kind_of, wrong_kind
from coordinator.recorder import METADATA_NAME, WALL_OFFSET

_PREFIX: Final = struct.Struct("<BQ")
_FOOTER_CHECKED: Final = struct.calcsize("<BQQQ")
"""So many bytes of the footer record are under the summary's checksum."""

_UNREADABLE: Final = (McapError, ValueError, OverflowError, MemoryError, struct.error, ZstdError)

_PARSERS: Final[dict[int, Callable[[ReadDataStream], mcap_records.McapRecord]]] = {
    Opcode.HEADER: mcap_records.Header.read,
    Opcode.FOOTER: mcap_records.Footer.read,
    Opcode.SCHEMA: mcap_records.Schema.read,
    Opcode.CHANNEL: mcap_records.Channel.read,
    Opcode.CHUNK: mcap_records.Chunk.read,
    Opcode.MESSAGE_INDEX: mcap_records.MessageIndex.read,
    Opcode.CHUNK_INDEX: mcap_records.ChunkIndex.read,
    Opcode.ATTACHMENT: mcap_records.Attachment.read,
    Opcode.ATTACHMENT_INDEX: mcap_records.AttachmentIndex.read,
    Opcode.STATISTICS: mcap_records.Statistics.read,
    Opcode.METADATA: mcap_records.Metadata.read,
    Opcode.METADATA_INDEX: mcap_records.MetadataIndex.read,
    Opcode.SUMMARY_OFFSET: mcap_records.SummaryOffset.read,
    Opcode.DATA_END: mcap_records.DataEnd.read,
}


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


class _Frame(NamedTuple):
    offset: int
    opcode: int
    content: bytes

    @property
    def end(self) -> int:
        return self.offset + _PREFIX.size + len(self.content)


_Sound = tuple[int, mcap_records.McapRecord]
"""A sound record and the place in the file of the record or of the chunk around it."""


class _DamageError(Exception):
    """The file is not as it was written; the text says where."""


def read_log(path: Path) -> Log:
    """Read every message that is whole, from a closed, unfinished or damaged log.

    Raises InputError when there is no such file, or it is no MCAP file, or no log of a fleet.
    """
    data = _load(path)
    if not data.startswith(MCAP0_MAGIC):
        raise _no_log(path, data)
    sound, damage = _scan(data)
    metadata: dict[str, str] = {}
    attachments: dict[str, bytes] = {}
    for _, record in sound:
        if isinstance(record, mcap_records.Metadata) and record.name == METADATA_NAME:
            metadata = record.metadata
        elif isinstance(record, mcap_records.Attachment):
            attachments[record.name] = record.data
    try:
        wall_offset_ns = int(metadata[WALL_OFFSET])
    except (KeyError, ValueError):
        reason = f": {damage}" if damage else ""
        raise InputError([f"{path}: is not the log of a fleet{reason}"]) from None
    return Log(
        metadata=metadata,
        attachments=attachments,
        records=list(_messages(sound, wall_offset_ns)),
        complete=_is_closed(data),
        damage=damage,
    )


def check_bytes(path: Path) -> str | None:
    """Say in one sentence where the file is damaged; None when it is sound.

    Any changed byte of a closed log is found.  An unfinished log is sound as far as it goes.
    Raises InputError when there is no such file or it never was an MCAP file.
    """
    return _scan(_load(path))[1] or None


def _load(path: Path) -> bytes:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError([f"{path}: {error.strerror}"]) from None
    if not data.startswith(MCAP0_MAGIC) and not _is_closed(data):
        raise _no_log(path, data)
    return data


def _no_log(path: Path, data: bytes) -> InputError:
    """Return the error for a file that never was a log."""
    found = kind_of(data)
    if found is None or found == "log":
        return InputError([f"{path}: is not an MCAP file"])
    return InputError([wrong_kind(str(path), found, "log")])


def _is_closed(data: bytes) -> bool:
    return len(data) > len(MCAP0_MAGIC) and data.endswith(MCAP0_MAGIC)


def _frames(data: bytes) -> Iterator[_Frame]:
    """Yield the records that are whole, up to the footer."""
    offset = len(MCAP0_MAGIC)
    while offset + _PREFIX.size <= len(data):
        opcode, length = _PREFIX.unpack_from(data, offset)
        begin = offset + _PREFIX.size
        if begin + length > len(data):
            return
        yield _Frame(offset, opcode, data[begin : begin + length])
        if opcode == Opcode.FOOTER:
            return
        offset = begin + length


def _scan(data: bytes) -> tuple[list[_Sound], str]:
    """Return the sound records and where the first damage is, empty when there is none."""
    sound: list[_Sound] = []
    damages: list[str] = []
    if not data.startswith(MCAP0_MAGIC):
        damages.append("damaged at byte 0: the file does not begin as an MCAP file does")
    end, opcode, data_end = len(MCAP0_MAGIC), 0, 0
    for frame in _frames(data):
        end, opcode = frame.end, frame.opcode
        try:
            records = _parse(frame)
            if isinstance(records[0], mcap_records.DataEnd):
                data_end = end
                _check_data_section(data, frame, records[0])
            elif isinstance(records[0], mcap_records.Footer):
                _check_summary(data, frame, records[0], data_end)
            sound.extend((frame.offset, record) for record in records)
        except (_DamageError, *_UNREADABLE) as error:
            reason = error if isinstance(error, _DamageError) else "it cannot be read"
            damages.append(f"damaged at byte {frame.offset} ({_name(opcode)}): {reason}")
    if opcode == Opcode.FOOTER:
        if not MCAP0_MAGIC.startswith(data[end:]):
            damages.append(f"damaged at byte {end}: the file does not end as an MCAP file does")
    elif _is_closed(data):
        damages.append(f"damaged at byte {end}: no whole record follows, yet the file was closed")
    return sound, damages[0] if damages else ""


def _parse(frame: _Frame) -> list[mcap_records.McapRecord]:
    """Return the record and, for a chunk, those inside it.

    Raises _DamageError or one of _UNREADABLE when it is not sound.
    """
    parser = _PARSERS.get(frame.opcode)
    if parser is None:
        raise _DamageError(f"no record has the number {frame.opcode}")
    stream = ReadDataStream(io.BytesIO(frame.content))
    record = parser(stream)
    if stream.count != len(frame.content):
        raise _DamageError("its length is wrong")
    if isinstance(record, mcap_records.Attachment):
        (checksum,) = struct.unpack("<I", frame.content[-4:])
        if zlib.crc32(frame.content[:-4]) != checksum:
            raise _DamageError("its checksum is wrong")
    if isinstance(record, mcap_records.Chunk):
        return [record, *breakup_chunk(record, validate_crc=True)]
    return [record]


def _messages(sound: list[_Sound], wall_offset_ns: int) -> Iterator[Record]:
    """Yield the messages; a channel lost with a damaged chunk is found again in the summary."""
    channels = (record for _, record in sound if isinstance(record, mcap_records.Channel))
    topics = {channel.id: channel.topic for channel in channels}
    for offset, record in sound:
        if isinstance(record, mcap_records.Message) and record.channel_id in topics:
            yield Record(
                key=topics[record.channel_id],
                payload=record.data,
                log_ns=record.log_time - wall_offset_ns,
                publish_ns=record.publish_time,
                offset=offset,
            )


def _check_data_section(data: bytes, frame: _Frame, record: mcap_records.DataEnd) -> None:
    """Compare the checksum over everything before; chunks and attachments have their own."""
    if record.data_section_crc == 0:
        raise _DamageError("the checksum over all bytes before it is missing")
    if zlib.crc32(data[: frame.offset]) != record.data_section_crc:
        raise _DamageError(
            "the checksum over all bytes before it is wrong, though chunks and attachments are "
            "sound: header, metadata or a message index was changed, or the checksum itself"
        )


def _check_summary(data: bytes, frame: _Frame, record: mcap_records.Footer, data_end: int) -> None:
    if not data_end:
        raise _DamageError("no end of the data came before it")
    if record.summary_start != data_end:
        raise _DamageError("the summary is not where it says")
    checked = data[record.summary_start : frame.offset + _FOOTER_CHECKED]
    if zlib.crc32(checked) != record.summary_crc:
        raise _DamageError(f"the checksum over the summary from byte {data_end} is wrong")


def _name(opcode: int) -> str:
    return Opcode(opcode).name.lower().replace("_", " ") if opcode in _PARSERS else "unknown"
