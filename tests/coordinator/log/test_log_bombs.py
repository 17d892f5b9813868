"""Small files that would unpack to more than a machine holds."""

import io
import struct

import lz4.frame
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.writer import Writer

from coordinator.base.errors import InputError
from coordinator.log.blackbox_attachments import packed, unpacked
from coordinator.log.log_file import MOST_RESUMED, RESUMED, log_from_bytes
from coordinator.log.log_writer import METADATA_NAME, WALL_OFFSET
from coordinator.log.recover import make_whole

MEGABYTE = 2**20
CHANNEL = struct.pack("<HHI1sII", 1, 0, 1, b"k", 0, 0)


def a_record(opcode, content):
    return struct.pack("<BQ", opcode, len(content)) + content


def a_chunk(size, data, compression=b"zstd"):
    head = struct.pack("<QQQI", 0, 0, size, 0) + struct.pack("<I", len(compression)) + compression
    return a_record(Opcode.CHUNK, head + struct.pack("<Q", len(data)) + data)


def zeros(size):
    """The bytes inside a chunk of one long message, as long as `size` says in all."""
    begin = a_record(Opcode.CHANNEL, CHANNEL)
    left = size - len(begin) - struct.calcsize("<BQHIQQ")
    return begin + a_record(Opcode.MESSAGE, struct.pack("<HIQQ", 1, 0, 0, 0) + bytes(left))


def a_log(*chunks):
    stream = io.BytesIO()
    writer = Writer(stream)
    writer.start(profile="", library="")
    writer.add_metadata(METADATA_NAME, {WALL_OFFSET: "0"})
    return stream.getvalue() + b"".join(chunks)


def test_a_chunk_as_long_as_any_recorder_makes_is_read():
    raw = zeros(MEGABYTE + 128 * 1024)
    log = log_from_bytes(a_log(a_chunk(len(raw), zstandard.compress(raw))), "run.mcap")
    assert (len(log.records), log.damage) == (1, "")


@pytest.mark.parametrize("stated", [64 * MEGABYTE, 1000], ids=["honest", "a lie"])
@pytest.mark.parametrize(
    ("compression", "pack"),
    [(b"zstd", zstandard.compress), (b"lz4", lz4.frame.compress)],
    ids=["zstd", "lz4"],
)
def test_a_chunk_that_unpacks_to_much_more_is_damage(compression, pack, stated):
    chunk = a_chunk(stated, pack(zeros(64 * MEGABYTE)), compression)
    log = log_from_bytes(a_log(chunk), "run.mcap")
    assert log.records == []
    assert "(chunk): it would unpack to more than a chunk holds" in log.damage


def test_a_chunk_that_does_not_state_its_size_is_unpacked_no_farther_than_it_may():
    pack = zstandard.ZstdCompressor(write_content_size=False).compress
    chunk = a_chunk(1000, pack(zeros(64 * MEGABYTE)))
    assert "cannot be read" in log_from_bytes(a_log(chunk), "run.mcap").damage


def test_many_chunks_of_which_each_is_small_enough_are_not_all_unpacked():
    raw = zeros(2 * MEGABYTE)
    data = a_log(*[a_chunk(len(raw), zstandard.compress(raw))] * 100)
    log = log_from_bytes(data, "run.mcap")
    assert 20 < len(log.records) < 50
    assert "the file would unpack to more than a log holds" in log.damage
    assert make_whole(data, "run.mcap").messages == len(log.records)


def test_a_chunk_that_is_no_lz4_is_damage():
    assert "cannot be read" in log_from_bytes(a_log(a_chunk(9, b"junk", b"lz4")), "x").damage


def inside(data):
    """A log that goes on from another."""
    stream = io.BytesIO()
    writer = Writer(stream, enable_data_crcs=True)
    writer.start(profile="", library="")
    writer.add_metadata(METADATA_NAME, {WALL_OFFSET: "0"})
    writer.add_attachment(0, 0, RESUMED, "application/octet-stream", data)
    writer.finish()
    return stream.getvalue()


def test_logs_one_in_the_other_are_read_as_often_as_a_coordinator_is_started_again():
    data = a_log()
    for _ in range(MOST_RESUMED):
        data = inside(data)
    assert log_from_bytes(data, "run.mcap").damage == ""
    with pytest.raises(InputError, match="resumes more than 100 logs"):
        log_from_bytes(inside(data), "run.mcap")


def test_a_black_box_that_unpacks_to_no_end_or_ends_early_is_told_in_a_line():
    text = b"t,x,y,heading,s,phase\n" * 1000
    name, _, data = packed("R1", text)
    assert unpacked({name: data}) == {"R1": text.decode()}
    with pytest.raises(InputError, match=r"R1.csv.gz: cannot be unpacked: it ends early"):
        unpacked({name: data[:-9]})
    with pytest.raises(InputError, match="it is longer than"):
        unpacked({name: packed("R1", bytes(64 * MEGABYTE)).data})
    with pytest.raises(InputError, match="cannot be unpacked"):
        unpacked({name: b"junk"})
