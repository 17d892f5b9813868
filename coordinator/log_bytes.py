"""An MCAP file's records, whole or not: which are sound, and where the first damage is.

Decides: which bytes are to be believed.  Must not know: what a log of a fleet holds (logbook.py).
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

from lz4.frame import get_frame_info
from mcap import records as mcap_records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.stream_reader import breakup_chunk
from mcap.writer import MCAP0_MAGIC
from zstandard import ZstdError, frame_content_size

_PREFIX: Final = struct.Struct("<BQ")
_FOOTER_CHECKED: Final = struct.calcsize("<BQQQ")
"""So many bytes of the footer record are under the summary's checksum."""

_CHUNK_SIGN: Final = b"\x04\x00\x00\x00zstd"
"""How a chunk says how it is compressed."""

_BEFORE_SIGN: Final = _PREFIX.size + struct.calcsize("<QQQI")
"""So many bytes of a chunk's record come before that."""

_UNREADABLE: Final = (
    McapError, ValueError, OverflowError, MemoryError, RuntimeError, struct.error, ZstdError,
)  # fmt: skip

_MOST_UNPACKED: Final = 2 * 2**20
_MOST_IN_ALL: Final = 64 * 2**20
_MOST_RATIO: Final = 200
"""A chunk, and a file, may unpack to so many bytes, and to so many times its length beyond; what
fleets say shrinks to a tenth."""

_UNSTATED: Final = -1
"""What zstd says of a frame whose size is not known: it is unpacked as far as its chunk says."""

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
    """A record as it stands in the file; `records` are it and, of a chunk, those inside it.

    `fault` says why it is not sound, and is empty when it is.
    """

    offset: int
    opcode: int
    content: bytes
    records: list[mcap_records.McapRecord]
    fault: str

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
    """Yield the records that are whole, sound or not, up to the footer.

    One that cannot be where it says it ends stands for all bytes up to the next sound chunk.
    """
    offset, last = len(MCAP0_MAGIC), False
    while not last:
        frame = _frame_at(data, offset)
        last = frame is not None and frame.opcode == Opcode.FOOTER
        if frame is None or (frame.fault and not _goes_on(data, frame.end)):
            skipped = _up_to_next_chunk(data, offset)
            last = last and skipped is None
            frame = skipped or frame
        if frame is None:
            return
        yield frame
        offset = frame.end


def _frame_at(data: bytes, offset: int) -> _Frame | None:
    """Return the record at a place; None when the file ends before it does."""
    begin = offset + _PREFIX.size
    if begin > len(data):
        return None
    opcode, length = _PREFIX.unpack_from(data, offset)
    content = data[begin : begin + length]
    if len(content) < length:
        return None
    try:
        return _Frame(offset, opcode, content, _parse(opcode, content), "")
    except _DamageError as error:
        return _Frame(offset, opcode, content, [], str(error))
    except _UNREADABLE:
        return _Frame(offset, opcode, content, [], "it cannot be read")


def _goes_on(data: bytes, offset: int) -> bool:
    """Tell whether a record may end here: a sound one follows, or nothing."""
    following = _frame_at(data, offset)
    return offset == len(data) or (following is not None and not following.fault)


def _up_to_next_chunk(data: bytes, offset: int) -> _Frame | None:
    """Return the bytes up to the next sound chunk as a record that is not sound.

    None when no chunk follows, or an attachment is at the place: it may be a log itself, and its
    chunks are not this log's.
    """
    begin = place = offset + _PREFIX.size
    if begin > len(data) or data[offset] == Opcode.ATTACHMENT:
        return None
    while (place := data.find(_CHUNK_SIGN, place)) >= 0:
        start, place = place - _BEFORE_SIGN, place + 1
        found = _frame_at(data, start) if start >= begin else None
        if found is not None and found.opcode == Opcode.CHUNK and not found.fault:
            return _Frame(offset, data[offset], data[begin:start], [], "its length is wrong")
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
    room = _MOST_IN_ALL + _MOST_RATIO * len(data)
    for frame in _frames(data):
        end, opcode, fault = frame.end, frame.opcode, frame.fault
        first = frame.records[0] if frame.records else None
        if isinstance(first, mcap_records.Chunk):
            room -= first.uncompressed_size
            fault = fault if room >= 0 else "the file would unpack to more than a log holds"
        elif isinstance(first, mcap_records.DataEnd):
            data_end, summary = end, len(sound)
            fault = _data_fault(data, frame, first)
        elif isinstance(first, mcap_records.Footer):
            fault = _summary_fault(data, frame, first, data_end)
            summary = summary if fault else 0
        if fault:
            damages.append(f"damaged at byte {frame.offset} ({_name(opcode)}): {fault}")
        else:
            sound.extend((frame.offset, record) for record in frame.records)
    if opcode == Opcode.FOOTER:
        if not MCAP0_MAGIC.startswith(data[end:]):
            damages.append(f"damaged at byte {end}: the file does not end as an MCAP file does")
    elif is_closed(data):
        damages.append(f"damaged at byte {end}: no whole record follows, yet the file was closed")
    if summary:
        del sound[summary:]  # nothing vouches for it
    return sound, damages[0] if damages else ""


def _parse(opcode: int, content: bytes) -> list[mcap_records.McapRecord]:
    """Return the record and, for a chunk, those inside it.

    Raises _DamageError or one of _UNREADABLE when it is not sound.
    """
    parser = _PARSERS.get(opcode)
    if parser is None:
        raise _DamageError(f"no record has the number {opcode}")
    stream = ReadDataStream(io.BytesIO(content))
    record = parser(stream)
    if stream.count != len(content):
        raise _DamageError("its length is wrong")
    if isinstance(record, mcap_records.Attachment):
        (checksum,) = struct.unpack("<I", content[-4:])
        if zlib.crc32(content[:-4]) != checksum:
            raise _DamageError("its checksum is wrong")
    if isinstance(record, mcap_records.Chunk):
        _check_size(record)
        return [record, *breakup_chunk(record, validate_crc=True)]
    return [record]


def _check_size(chunk: mcap_records.Chunk) -> None:
    """Raise _DamageError for a chunk that would take too much memory, before it is unpacked."""
    size, data = chunk.uncompressed_size, chunk.data
    stated = size
    if chunk.compression == "zstd":
        stated = frame_content_size(data)
    elif chunk.compression == "lz4":
        stated = get_frame_info(data)["content_size"]
    if size > _MOST_UNPACKED + _MOST_RATIO * len(data) or stated not in (size, _UNSTATED):
        raise _DamageError("it would unpack to more than a chunk holds")


def _data_fault(data: bytes, frame: _Frame, record: mcap_records.DataEnd) -> str:
    """Compare the checksum over everything before; chunks and attachments have their own."""
    if record.data_section_crc == 0:
        return "the checksum over all bytes before it is missing"
    if zlib.crc32(data[: frame.offset]) != record.data_section_crc:
        return (
            "the checksum over all bytes before it is wrong, though chunks and attachments are "
            "sound: header, metadata or a message index was changed, or the checksum itself"
        )
    return ""


def _summary_fault(data: bytes, frame: _Frame, record: mcap_records.Footer, data_end: int) -> str:
    if not data_end:
        return "no end of the data came before it"
    if record.summary_start != data_end:
        return "the summary is not where it says"
    checked = data[record.summary_start : frame.offset + _FOOTER_CHECKED]
    if zlib.crc32(checked) != record.summary_crc:
        return f"the checksum over the summary from byte {data_end} is wrong"
    return ""


def _name(opcode: int) -> str:
    return Opcode(opcode).name.lower().replace("_", " ") if opcode in _PARSERS else "unknown"
