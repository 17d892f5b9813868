"""An MCAP file's records, whole or not: which are sound, and where the first damage is.

Decides: which bytes are to be believed.  Must not know: what a log of a fleet holds (logbook.py).
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

from mcap import records as mcap_records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.stream_reader import breakup_chunk
from mcap.writer import MCAP0_MAGIC
from zstandard import ZstdError

_PREFIX: Final = struct.Struct("<BQ")
_FOOTER_CHECKED: Final = struct.calcsize("<BQQQ")
"""So many bytes of the footer record are under the summary's checksum."""

_CHUNK_SIGN: Final = b"\x04\x00\x00\x00zstd"
"""How a chunk says how it is compressed."""

_BEFORE_SIGN: Final = _PREFIX.size + struct.calcsize("<QQQI")
"""So many bytes of a chunk's record come before that."""

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


class _Frame(NamedTuple):
    offset: int
    opcode: int
    content: bytes

    @property
    def end(self) -> int:
        return self.offset + _PREFIX.size + len(self.content)


Sound = tuple[int, mcap_records.McapRecord]
"""A sound record and the place in the file of the record or of the chunk around it."""


class _DamageError(Exception):
    """The file is not as it was written; the text says where."""


def is_closed(data: bytes) -> bool:
    """Tell whether the file ends as a closed one does."""
    return len(data) > len(MCAP0_MAGIC) and data.endswith(MCAP0_MAGIC)


def _frames(data: bytes) -> Iterator[_Frame]:
    """Yield the records that are whole, up to the footer.

    A record that cannot be where it says it ends stands for all bytes up to the next sound chunk.
    """
    offset = len(MCAP0_MAGIC)
    while offset + _PREFIX.size <= len(data):
        opcode, length = _PREFIX.unpack_from(data, offset)
        begin = offset + _PREFIX.size
        end = begin + length
        if end > len(data):
            # An attachment may be a log itself: its chunks are not this log's.
            found = None if opcode == Opcode.ATTACHMENT else _next_chunk(data, begin)
            if found is None:
                return
            end = found
        yield _Frame(offset, opcode, data[begin:end])
        if opcode == Opcode.FOOTER:
            return
        offset = end


def _next_chunk(data: bytes, begin: int) -> int | None:
    """Return where the first sound chunk from `begin` on is, None when there is none."""
    place = begin
    while (place := data.find(_CHUNK_SIGN, place)) >= 0:
        start, place = place - _BEFORE_SIGN, place + 1
        if start < begin:
            continue
        opcode, length = _PREFIX.unpack_from(data, start)
        end = start + _PREFIX.size + length
        if opcode == Opcode.CHUNK and end <= len(data):
            try:
                _parse(_Frame(start, opcode, data[start + _PREFIX.size : end]))
            except (_DamageError, *_UNREADABLE):
                continue
            return start
    return None


def scan(data: bytes) -> tuple[list[Sound], str]:
    """Return the sound records and where the first damage is, empty when there is none.

    A chunk is followed by the records in it.  Raises nothing, whatever the bytes are.
    """
    sound: list[Sound] = []
    damages: list[str] = []
    if not data.startswith(MCAP0_MAGIC):
        damages.append("damaged at byte 0: the file does not begin as an MCAP file does")
    end, opcode, data_end, summary = len(MCAP0_MAGIC), 0, 0, 0
    for frame in _frames(data):
        end, opcode = frame.end, frame.opcode
        try:
            records = _parse(frame)
            if isinstance(records[0], mcap_records.DataEnd):
                data_end, summary = end, len(sound)
                _check_data_section(data, frame, records[0])
            elif isinstance(records[0], mcap_records.Footer):
                _check_summary(data, frame, records[0], data_end)
                summary = 0
            sound.extend((frame.offset, record) for record in records)
        except (_DamageError, *_UNREADABLE) as error:
            reason = error if isinstance(error, _DamageError) else "it cannot be read"
            damages.append(f"damaged at byte {frame.offset} ({_name(opcode)}): {reason}")
    if opcode == Opcode.FOOTER:
        if not MCAP0_MAGIC.startswith(data[end:]):
            damages.append(f"damaged at byte {end}: the file does not end as an MCAP file does")
    elif is_closed(data):
        damages.append(f"damaged at byte {end}: no whole record follows, yet the file was closed")
    if summary:
        del sound[summary:]  # nothing vouches for it
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
