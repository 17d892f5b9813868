"""Reading logs back: cut short anywhere, changed anywhere."""

import random
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from coordinator.base.errors import InputError
from coordinator.log import log_writer
from coordinator.log.log_file import read_log
from coordinator.log.log_writer import Attachment
from coordinator.log.recorder import Recorder
from coordinator.log.soundness import scan
from protocol import keys

WALL = 1_700_000_000_000_000_000
ATTACHMENTS = [
    Attachment("scenario.json", "application/json", b'{"name": "x"}'),
    Attachment("plan-1.json", "application/json", b'{"format": "y"}'),
]


def write_log(path: Path, messages: int = 12) -> None:
    with Recorder(
        path, metadata={"fleet": "f"}, wall_offset_ns=WALL, attachments=ATTACHMENTS
    ) as log:
        for i in range(messages):
            key = keys.command("f") if i % 3 else "somebody/else"
            log.record(key, bytes([i]) * 20, 1_000 - i, sent_ns=WALL + i)


@pytest.fixture
def small_chunks(monkeypatch):
    monkeypatch.setattr(log_writer, "CHUNK_BYTES", 150)


def test_what_was_recorded_is_read_back_in_order_on_the_coordinators_clock(tmp_path):
    path = tmp_path / "run.mcap"
    write_log(path)
    log = read_log(path)
    assert log.complete
    assert log.damage == ""
    assert log.metadata == {"fleet": "f", "wall_offset_ns": str(WALL)}
    assert log.attachments == {each.name: each.data for each in ATTACHMENTS}
    assert [(r.payload[0], r.log_ns, r.publish_ns) for r in log.records] == [
        (i, 1_000 - i, WALL + i) for i in range(12)
    ]
    assert {r.key for r in log.records} == {"splinefleet/f/command", "somebody/else"}


def test_a_log_without_messages_is_a_log(tmp_path):
    path = tmp_path / "run.mcap"
    write_log(path, messages=0)
    log = read_log(path)
    assert (log.records, log.complete, log.damage) == ([], True, "")


@pytest.mark.usefixtures("small_chunks")
def test_a_log_cut_anywhere_keeps_every_complete_chunk(tmp_path):
    path, cut = tmp_path / "run.mcap", tmp_path / "cut.mcap"
    write_log(path)
    data = path.read_bytes()
    whole = read_log(path)
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    chunks = [
        (index.chunk_start_offset, index.chunk_start_offset + index.chunk_length)
        for index in summary.chunk_indexes
    ]
    assert len(chunks) >= 4
    metadata_end = summary.metadata_indexes[0].offset + summary.metadata_indexes[0].length
    for size in range(len(data)):
        cut.write_bytes(data[:size])
        if size < metadata_end:
            with pytest.raises(InputError):
                read_log(cut)
            continue
        log = read_log(cut)
        kept = {start for start, end in chunks if end <= size}
        assert log.records == [r for r in whole.records if r.offset in kept], size
        assert not log.complete
        assert log.damage == "", size
        ends = [index.offset + index.length for index in summary.attachment_indexes]
        assert len(log.attachments) == sum(end <= size for end in ends)


@pytest.mark.usefixtures("small_chunks")
def test_no_byte_of_a_closed_log_changes_unseen(tmp_path):
    path = tmp_path / "run.mcap"
    write_log(path, messages=6)
    data = path.read_bytes()
    chance = random.Random(1)
    for position in range(len(data)):
        spoilt = bytearray(data)
        spoilt[position] ^= chance.randrange(1, 256)
        damage = scan(bytes(spoilt))[1]
        assert damage.startswith("damaged at byte "), position


@pytest.mark.usefixtures("small_chunks")
def test_no_single_changed_byte_makes_the_reader_fall_or_invent_messages(tmp_path):
    path, changed = tmp_path / "run.mcap", tmp_path / "changed.mcap"
    write_log(path)
    data = path.read_bytes()
    true = [(r.payload, r.log_ns) for r in read_log(path).records]
    chance = random.Random(2)
    for _ in range(500):
        spoilt = bytearray(data)
        position = chance.randrange(len(data))
        spoilt[position] ^= chance.randrange(1, 256)
        changed.write_bytes(spoilt)
        try:
            log = read_log(changed)
        except InputError:
            continue
        assert log.damage, position
        payloads = [payload for payload, _ in true]
        assert all(record.payload in payloads for record in log.records), position


@pytest.mark.usefixtures("small_chunks")
def test_damage_is_told_where_it_is_and_costs_only_its_chunk(tmp_path):
    path = tmp_path / "run.mcap"
    write_log(path)
    whole = read_log(path)
    offsets = sorted({record.offset for record in whole.records})
    victim = offsets[0]
    data = bytearray(path.read_bytes())
    data[victim + 60] ^= 0xFF
    path.write_bytes(data)
    log = read_log(path)
    assert log.damage.startswith(f"damaged at byte {victim} (chunk)")
    assert log.complete
    assert log.records == [r for r in whole.records if r.offset != victim]


def test_bytes_after_the_end_are_damage(tmp_path):
    path = tmp_path / "run.mcap"
    write_log(path)
    size = path.stat().st_size
    path.write_bytes(path.read_bytes() + b"more")
    assert read_log(path).damage == (
        f"damaged at byte {size - 8}: the file does not end as an MCAP file does"
    )


def test_a_tail_of_zeros_after_a_power_cut_is_damage_behind_the_last_message(tmp_path):
    path = tmp_path / "run.mcap"
    write_log(path)
    with path.open("rb") as stream:
        index = make_reader(stream).get_summary().chunk_indexes[-1]
    end = index.chunk_start_offset + index.chunk_length + index.message_index_length
    path.write_bytes(path.read_bytes()[:end] + bytes(4096))
    log = read_log(path)
    assert len(log.records) == 12
    assert log.damage == f"damaged at byte {end} (unknown): no record has the number 0"


def test_what_is_no_log_of_a_fleet_is_refused_in_one_line(tmp_path):
    foreign = tmp_path / "foreign.mcap"
    with foreign.open("wb") as stream:
        writer = Writer(stream, enable_data_crcs=True)
        writer.start()
        writer.finish()
    text = tmp_path / "text.mcap"
    text.write_text("robot,t,x,y\n")
    empty = tmp_path / "empty.mcap"
    empty.write_bytes(b"")
    (tmp_path / "nothing").mkdir()
    for path, reason in (
        (tmp_path / "none.mcap", "No such file or directory"),
        (tmp_path / "nothing", "holds no log"),
        (text, "is not an MCAP file"),
        (empty, "is not an MCAP file"),
        (foreign, "is not the log of a fleet"),
    ):
        with pytest.raises(InputError) as caught:
            read_log(path)
        assert caught.value.problems == (f"{path}: {reason}",)
