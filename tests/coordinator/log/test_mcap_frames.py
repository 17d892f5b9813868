"""Damaged lengths and kinds of records, and what is behind them."""

import io
import struct
import time

import pytest
from mcap.opcode import Opcode
from mcap.records import Attachment as InnerFile
from mcap.records import Chunk

from coordinator.base.errors import InputError
from coordinator.log.log_file import log_from_bytes, scan_log
from coordinator.log.log_writer import Attachment, begin_file
from coordinator.log.recorder import Recorder
from coordinator.log.recover import make_whole


def records_of(data):
    """Yield opcode, beginning and end of every record by the lengths that stand before them."""
    offset = 8
    while offset < len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, offset)
        yield opcode, offset, offset + 9 + length
        offset += 9 + length


@pytest.mark.parametrize("ending", ["closed", "cut"])
def test_one_bit_of_any_length_or_kind_hides_nothing_of_a_log(recorded, ending):
    end = next(offset for kind, offset, _ in records_of(recorded) if kind == Opcode.DATA_END)
    log = recorded if ending == "closed" else recorded[:end]
    for kind, offset, _ in records_of(recorded[: end + 8]):
        for bit in range(8 if kind == Opcode.METADATA else 0, 72):
            data = bytearray(log)
            data[offset + bit // 8] ^= 1 << bit % 8
            sound = scan_log(bytes(data), "damaged").sound
            for opcode, found in ((Opcode.CHUNK, Chunk), (Opcode.ATTACHMENT, InnerFile)):
                count = sum(record[0] == opcode for record in records_of(recorded[: end + 8]))
                lost = bit < 8 and kind == opcode
                assert sum(isinstance(one, found) for _, one in sound) == count - lost, (
                    offset,
                    bit,
                )


@pytest.mark.parametrize("broken", ["nothing", "the index", "the length inside", "both"])
def test_an_attachment_whose_length_is_damaged_hides_no_message(tmp_path, recorded, broken):
    inner = Attachment("resumed.mcap", "application/octet-stream", recorded)
    path = tmp_path / "run.mcap"
    with Recorder(path, metadata={}, wall_offset_ns=0, attachments=[inner]) as recorder:
        recorder.record("splinefleet/one/command", b"mine", 5)
    data = bytearray(path.read_bytes())
    start = next(offset for kind, offset, _ in records_of(data) if kind == Opcode.ATTACHMENT)
    data[start + 2] ^= 0x10
    if broken in ("the index", "both"):
        data[-20] ^= 0x10
    if broken in ("the length inside", "both"):
        data[start + 9 + 16] ^= 0x10
    log = log_from_bytes(bytes(data), "damaged")
    is_read = broken in ("nothing", "the index")
    assert log.attachments == ({"resumed.mcap": recorded} if is_read else {})
    assert [r.payload for r in log.records] == ([] if broken == "both" else [b"mine"])
    assert log.damage.startswith(f"damaged at byte {start}")


@pytest.mark.parametrize("filler", [b"\0", b"\x04\0\0\0zstd", b"\x09" + 8 * b"\0"])
def test_a_tail_that_is_no_log_takes_time_that_grows_with_its_length(recorded, filler):
    tail = filler * (2**21 // len(filler))
    began = time.process_time()
    log = log_from_bytes(recorded[: 9 * len(recorded) // 10] + tail, "tail")
    assert time.process_time() - began < 20.0
    assert log.records


@pytest.mark.parametrize("ending", ["closed", "cut"])
def test_no_bit_of_header_or_metadata_makes_a_log_unusable(recorded, ending):
    whole = log_from_bytes(recorded, "run.mcap")
    first = next(begin for kind, begin, _ in records_of(recorded) if kind == Opcode.ATTACHMENT)
    log = recorded if ending == "closed" else recorded[: -len(recorded) // 10]
    messages = len(log_from_bytes(log, "run.mcap").records)
    for bit in range(8 * 8, 8 * first, 3):
        data = bytearray(log)
        data[bit // 8] ^= 1 << bit % 8
        found = log_from_bytes(bytes(data), "damaged")
        assert len(found.records) == messages, bit
        assert found.attachments == whole.attachments, bit
        if found.metadata["wall_offset_ns"] == "0":
            assert found.metadata["fleet"] in found.records[0].key
            assert (
                "its metadata are damaged: the fleet's name is taken from the keys" in found.damage
            )


@pytest.mark.parametrize("offset", [None, "x", str(10**30), str(-(10**30))])
def test_a_log_without_a_usable_clock_is_read_and_recovered_with_a_note(offset):
    stream = io.BytesIO()
    writer = begin_file(stream)
    if offset is not None:
        writer.add_metadata("splinefleet", {"wall_offset_ns": offset})
    schema = writer.register_schema("any", "jsonschema", b"{}")
    channel = writer.register_channel("splinefleet/one/command", "msgpack", schema)
    writer.add_message(channel, 17, b"x", 18)
    writer.finish()
    log = log_from_bytes(stream.getvalue(), "run.mcap")
    assert "its metadata are damaged" in log.damage
    assert (log.metadata["fleet"], log.records[0].log_ns) == ("one", 17)
    again = log_from_bytes(make_whole(stream.getvalue(), "run.mcap").data, "whole.mcap")
    assert (again.records[0].payload, again.damage) == (b"x", "")
    assert (again.metadata["fleet"], again.records[0].log_ns) == ("one", 17)


@pytest.mark.parametrize(
    "times", [(2**64 - 1,), (5, 10**18), (10**18, 5), (5, 32 * 86_400 * 10**9)]
)
def test_times_that_no_fleet_has_are_told_in_a_line(times):
    stream = io.BytesIO()
    writer = begin_file(stream)
    writer.add_metadata("splinefleet", {"wall_offset_ns": "0"})
    channel = writer.register_channel("splinefleet/one/command", "msgpack", 0)
    for time_ns in times:
        writer.add_message(channel, time_ns, b"x", 0)
    writer.finish()
    number = len(times) - 1
    with pytest.raises(InputError, match=f"message {number} on .*/command: its time is invalid"):
        log_from_bytes(stream.getvalue(), "run.mcap")
