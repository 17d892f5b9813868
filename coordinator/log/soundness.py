"""Check an MCAP file, which may be cut short or damaged, for its intact records and first damage.

Decides: which bytes can be trusted.  Must not know: what a log of a fleet contains (log_file.py).
"""

from __future__ import annotations

import zlib
from typing import Final

from mcap import records as mcap_records
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from coordinator.log.mcap_frames import FOOTER_CHECKED, MOST_RATIO, PARSERS, Frame, frames

_MOST_IN_ALL: Final = 64 * 2**20
"""How many bytes a file may unpack to in addition to MOST_RATIO times its length."""

Sound = tuple[int, mcap_records.McapRecord]
"""An intact record, and the byte at which it or the chunk around it begins."""


def is_closed(data: bytes) -> bool:
    """Return whether the file ends as a closed file does."""
    return len(data) > len(MCAP0_MAGIC) and data.endswith(MCAP0_MAGIC)


def scan(data: bytes) -> tuple[list[Sound], str]:
    """Return the intact records, and a text that says where the first damage is, if any.

    Each chunk is followed by the records in it.  Raises nothing, whatever the bytes are.
    """
    sound: list[Sound] = []
    damages: list[str] = []
    if not data.startswith(MCAP0_MAGIC):
        damages.append("damaged at byte 0: the file does not begin as an MCAP file does")
    end, opcode, data_end, summary = len(MCAP0_MAGIC), 0, 0, 0
    room = _MOST_IN_ALL + MOST_RATIO * len(data)
    for frame in frames(data):
        end, opcode, fault = frame.end, frame.opcode, ""
        first = frame.records[0] if frame.records else None
        if isinstance(first, mcap_records.Chunk):
            room -= first.uncompressed_size
            fault = "" if room >= 0 else "the file would unpack to more than a log holds"
        elif isinstance(first, mcap_records.DataEnd):
            data_end, summary = end, len(sound)
            fault = _data_fault(data, frame, first)
        elif isinstance(first, mcap_records.Footer):
            fault = _summary_fault(data, frame, first, data_end)
            summary = summary if fault else 0
        if frame.fault or fault:
            told = frame.fault or fault
            damages.append(f"damaged at byte {frame.offset} ({_name(opcode)}): {told}")
        if not fault:
            sound.extend((frame.offset, record) for record in frame.records)
    if opcode == Opcode.FOOTER:
        if not MCAP0_MAGIC.startswith(data[end:]):
            damages.append(f"damaged at byte {end}: the file does not end as an MCAP file does")
    elif is_closed(data):
        damages.append(f"damaged at byte {end}: no complete record follows, but the file is closed")
    if summary:
        del sound[summary:]  # no valid footer confirms the summary
    return sound, damages[0] if damages else ""


def _data_fault(data: bytes, frame: Frame, record: mcap_records.DataEnd) -> str:
    """Return what is wrong with the checksum over all bytes before this record, if anything."""
    if record.data_section_crc == 0:
        return "the checksum over all bytes before it is missing"
    if zlib.crc32(data[: frame.offset]) != record.data_section_crc:
        return (
            "the checksum over all bytes before it is wrong, though chunks and attachments are "
            "intact: header, metadata or a message index was changed, or the checksum itself"
        )
    return ""


def _summary_fault(data: bytes, frame: Frame, record: mcap_records.Footer, data_end: int) -> str:
    if not data_end:
        return "no data end record comes before it"
    if record.summary_start != data_end:
        return "the summary does not begin where the footer says"
    checked = data[record.summary_start : frame.offset + FOOTER_CHECKED]
    if zlib.crc32(checked) != record.summary_crc:
        return f"the checksum over the summary from byte {data_end} is wrong"
    return ""


def _name(opcode: int) -> str:
    return Opcode(opcode).name.lower().replace("_", " ") if opcode in PARSERS else "unknown"
