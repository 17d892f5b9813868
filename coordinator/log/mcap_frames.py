"""Split an MCAP file into its records, intact or not, and find the next record after a damage.

A record begins with its length, and the contents of most records determine their length, too.  If
the stated length is wrong, the record is read by its contents.  If that fails, the index of a
closed file says where the next record begins.  If there is no index, the next chunk whose checksum
is right is searched.

Decides: where records begin and end.  Must not know: what a log of a fleet contains, or which
damage is reported (soundness.py).
"""

from __future__ import annotations

import io
import struct
import zlib
from bisect import bisect_right
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
_FOOTER: Final = struct.Struct("<BQQQI")
_DATA_END_BYTES: Final = _PREFIX.size + struct.calcsize("<I")

FOOTER_CHECKED: Final = struct.calcsize("<BQQQ")
"""How many bytes of the footer record the summary's checksum covers."""

_CHUNK_SIGN: Final = b"\x04\x00\x00\x00zstd"
"""The field of a chunk's record that names its compression; chunks are searched by it."""

_BEFORE_SIGN: Final = _PREFIX.size + struct.calcsize("<QQQI")
"""The offset of that field from the beginning of the chunk's record."""

_UNREADABLE: Final = (
    McapError, ValueError, OverflowError, MemoryError, RuntimeError, struct.error, ZstdError,
)  # fmt: skip

_MOST_UNPACKED: Final = 2 * 2**20
MOST_RATIO: Final = 200
"""A chunk may unpack to _MOST_UNPACKED bytes plus MOST_RATIO times its compressed length.

Fleets' messages compress to about a tenth.  soundness.py uses the ratio for whole files."""

_UNSTATED: Final = -1
"""zstd's value for an unknown frame size; then the chunk's stated size limits the unpacking."""

_MOST_READ_AGAIN: Final = 16
"""The most bytes read to find records after damages, as a multiple of the file's length."""

PARSERS: Final[dict[int, Callable[[ReadDataStream], mcap_records.McapRecord]]] = {
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
_WRONG_LENGTH: Final = "its length is wrong"


class Frame(NamedTuple):
    """A record at its place in the file, from byte `offset` to byte `end`.

    `records` has the record itself and, for a chunk, the records inside it.  `fault` says what is
    wrong with the record, and is empty if it is intact.  A frame with a fault has records only if
    their contents are intact.
    """

    offset: int
    end: int
    opcode: int
    records: list[mcap_records.McapRecord]
    fault: str


class _Exact(io.BytesIO):
    """A stream that raises an error if it is read beyond its end."""

    def read(self, size: int | None = -1) -> bytes:
        """Return `size` bytes; raise ValueError if there are fewer."""
        found = super().read(size)
        if size is not None and len(found) < size:
            raise ValueError("the record ends early")
        return found


class _DamageError(Exception):
    """A record is damaged; the text says how."""


def frames(data: bytes) -> Iterator[Frame]:
    """Yield the complete records, intact or not, up to the footer.

    If a record's stated end cannot be right, its frame extends to the next record that can be read.
    """
    behind = _Behind(data)
    offset = len(MCAP0_MAGIC)
    while True:
        frame = _frame_at(data, offset)
        if frame is None or frame.fault:
            goes_on = frame is not None and _goes_on(data, frame.end)
            found = behind.read_by_content(offset) or (None if goes_on else behind.skip(offset))
            frame, is_last = found or frame, not found and not goes_on
        else:
            is_last = True
        if frame is None:
            return
        yield frame
        if is_last and frame.opcode == Opcode.FOOTER:
            return
        offset = frame.end


def _frame_at(data: bytes, offset: int) -> Frame | None:
    """Return the record that begins at a byte; None if the file ends before the record does."""
    begin = offset + _PREFIX.size
    if begin > len(data):
        return None
    opcode, length = _PREFIX.unpack_from(data, offset)
    if length > len(data) - begin:
        return None
    return _read(opcode, data[begin : begin + length], offset)


def _read(opcode: int, content: bytes, offset: int) -> Frame:
    end = offset + _PREFIX.size + len(content)
    try:
        return Frame(offset, end, opcode, _parse(opcode, content), "")
    except _DamageError as error:
        return Frame(offset, end, opcode, [], str(error))
    except _UNREADABLE:
        return Frame(offset, end, opcode, [], "it cannot be read")


def _goes_on(data: bytes, offset: int) -> bool:
    """Return whether a record may end here: an intact record follows, or the file ends."""
    following = _frame_at(data, offset)
    return offset == len(data) or (following is not None and not following.fault)


class _Behind:
    """A search for the records after damages, in time linear in the file's length."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._stream = _Exact(data)
        self._places = _indexed(data)
        self._chunk = 0
        self._left = _MOST_READ_AGAIN * len(data)

    def read_by_content(self, offset: int) -> Frame | None:
        """Return the record here if only its stated length is wrong; else None."""
        data, begin = self._data, offset + _PREFIX.size
        if begin > len(data) or data[offset] not in PARSERS or self._left <= 0:
            return None
        opcode = data[offset]
        self._stream.seek(begin)
        stream = ReadDataStream(self._stream)
        try:
            PARSERS[opcode](stream)
        except _UNREADABLE:
            return None
        finally:
            self._left -= stream.count
        frame = _read(opcode, data[begin : begin + stream.count], offset)
        checked = opcode in (Opcode.CHUNK, Opcode.ATTACHMENT)
        if frame.fault or not (checked or (frame.end < len(data) and _goes_on(data, frame.end))):
            return None
        return frame._replace(fault=_WRONG_LENGTH)

    def skip(self, offset: int) -> Frame | None:
        """Return a frame that ends where the next record begins; None if no record is found."""
        begin = offset + _PREFIX.size
        following = bisect_right(self._places, offset)
        if following < len(self._places):
            end = self._places[following]
        elif begin > len(self._data) or (end := self._next_chunk(begin)) == len(self._data):
            return None
        return Frame(offset, end, self._data[offset], [], _WRONG_LENGTH)

    def _next_chunk(self, begin: int) -> int:
        """Return where the next intact chunk begins, or the file's length if there is none.

        An attachment may itself be a log, whose chunks do not belong to this log.  So the search
        ends where another MCAP file begins.
        """
        data, place = self._data, begin
        if self._chunk >= begin:
            return self._chunk
        self._chunk = len(data)
        other = data.find(MCAP0_MAGIC, begin)
        while (place := data.find(_CHUNK_SIGN, place, other)) >= 0 and self._left > 0:
            start, place = place - _BEFORE_SIGN, place + 1
            found = _frame_at(data, start) if start >= begin else None
            self._left -= 0 if found is None else found.end - start
            if found is not None and found.opcode == Opcode.CHUNK and not found.fault:
                self._chunk = start
                break
        return self._chunk


def _indexed(data: bytes) -> list[int]:
    """Return where records begin according to a closed file's summary; empty if it is damaged."""
    footer = len(data) - len(MCAP0_MAGIC) - _FOOTER.size
    if footer < 0 or not data.endswith(MCAP0_MAGIC):
        return []
    opcode, _, begin, _, checksum = _FOOTER.unpack_from(data, footer)
    if opcode != Opcode.FOOTER or not _DATA_END_BYTES < begin < footer:
        return []
    if zlib.crc32(data[begin : footer + FOOTER_CHECKED]) != checksum:
        return []
    places, offset = [begin - _DATA_END_BYTES], begin
    while offset < footer and (frame := _frame_at(data, offset)) is not None:
        for record in frame.records:
            if isinstance(record, mcap_records.ChunkIndex):
                places.append(record.chunk_start_offset)
            elif isinstance(record, mcap_records.AttachmentIndex | mcap_records.MetadataIndex):
                places.append(record.offset)
        offset = frame.end
    return sorted(place for place in places if place < begin)


def _parse(opcode: int, content: bytes) -> list[mcap_records.McapRecord]:
    """Return the record and, for a chunk, the records inside it.

    Raises _DamageError or one of _UNREADABLE if the record is damaged.
    """
    parser = PARSERS.get(opcode)
    if parser is None:
        raise _DamageError(f"no record has the number {opcode}")
    stream = ReadDataStream(_Exact(content))
    record = parser(stream)
    if stream.count != len(content):
        raise _DamageError(_WRONG_LENGTH)
    if isinstance(record, mcap_records.Attachment):
        (checksum,) = struct.unpack("<I", content[-4:])
        if zlib.crc32(content[:-4]) != checksum:
            raise _DamageError("its checksum is wrong")
    if isinstance(record, mcap_records.Chunk):
        _check_size(record)
        return [record, *breakup_chunk(record, validate_crc=True)]
    return [record]


def _check_size(chunk: mcap_records.Chunk) -> None:
    """Raise _DamageError if unpacking a chunk would take too much memory."""
    size, data = chunk.uncompressed_size, chunk.data
    stated = size
    if chunk.compression == "zstd":
        stated = frame_content_size(data)
    elif chunk.compression == "lz4":
        stated = get_frame_info(data)["content_size"]
    if size > _MOST_UNPACKED + MOST_RATIO * len(data) or stated not in (size, _UNSTATED):
        raise _DamageError("it would unpack to more than a chunk holds")
