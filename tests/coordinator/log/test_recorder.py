"""The recorder, judged by the stock mcap reader."""

import json
import os
import random
import resource
import threading
import time
from pathlib import Path

import msgspec
import pytest
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import Writer

from coordinator.base.errors import InputError, LogError
from coordinator.fleet.log_records import (
    TOLD_TO_GO_ON,
    TOLD_TO_STOP,
    ahead_key,
    ahead_record,
    told_key,
)
from coordinator.log import log_writer
from coordinator.log import recorder as recorder_module
from coordinator.log.log_writer import Attachment
from coordinator.log.recorder import Recorder
from protocol import codec, keys, schema
from protocol.messages import Command, Report
from tests.json_schema import problems

WALL = 1_700_000_000_000_000_000
SCENARIO = Attachment("scenario.json", "application/json", b'{"name": "x"}')


def open_log(path: Path, **changes) -> Recorder:
    arguments = {"metadata": {"fleet": "f"}, "wall_offset_ns": WALL, "attachments": [SCENARIO]}
    return Recorder(path, **(arguments | changes))


def test_the_stock_reader_finds_every_message_with_both_stamps_and_its_schema(tmp_path):
    path = tmp_path / "run.mcap"
    report = codec.encode(Report(1, 7, 1, 2))
    with open_log(path) as log:
        log.record(keys.report("f", "R1"), report, 5_000, sent_ns=WALL + 4_000)
        log.record(keys.command("f"), codec.encode(Command(1, 1, 1, 1, 0, 0, 0)), 6_000)
        log.record(keys.report("f", "R1"), report, 7_000)
    with path.open("rb") as stream:
        found = list(make_reader(stream, validate_crcs=True).iter_messages())
    assert [
        (c.topic, m.log_time - WALL, m.publish_time - WALL, m.sequence) for _, c, m in found
    ] == [
        ("splinefleet/f/report/R1", 5_000, 4_000, 0),
        ("splinefleet/f/command", 6_000, 6_000, 0),
        ("splinefleet/f/report/R1", 7_000, 7_000, 1),
    ]
    assert found[0][2].data == report
    assert {c.message_encoding for _, c, _ in found} == {"msgpack"}
    assert [(s.name, s.encoding) for s, _, _ in found[:2]] == [
        ("splinefleet.Report", "jsonschema"),
        ("splinefleet.Command", "jsonschema"),
    ]


@pytest.mark.parametrize(
    ("key", "payloads", "encoding", "name"),
    [
        (ahead_key("f"), [ahead_record(9_800), ahead_record(-1)], "msgpack", "splinefleet.Ahead"),
        (told_key("f"), [TOLD_TO_STOP, TOLD_TO_GO_ON], "json", "splinefleet.Told"),
    ],
    ids=["ahead", "told"],
)
def test_what_a_fleet_may_be_told_and_what_it_was_told_have_schemas(
    tmp_path, key, payloads, encoding, name
):
    path = tmp_path / "run.mcap"
    with open_log(path) as log:
        for payload in payloads:
            log.record(key, payload, 1)
    with path.open("rb") as stream:
        found = list(make_reader(stream).iter_messages())
    assert [message.data for _, _, message in found] == payloads
    for described, channel, message in found:
        assert (channel.message_encoding, described.name) == (encoding, name)
        value = getattr(msgspec, encoding).decode(message.data)
        assert list(problems(json.loads(described.data), value)) == []
        assert list(problems(json.loads(described.data), None))


def test_what_nobody_tells_a_fleet_is_on_a_channel_without_a_schema(tmp_path):
    path = tmp_path / "run.mcap"
    with open_log(path) as log:
        log.record(told_key("f"), b'"dance"', 1)
    with path.open("rb") as stream:
        ((described, channel, _),) = make_reader(stream).iter_messages()
    assert described is None
    assert channel.message_encoding == "application/octet-stream"


def test_metadata_and_attachments_are_in_the_file_before_the_first_message(tmp_path):
    path = tmp_path / "run.mcap"
    log = open_log(path)
    try:
        with path.open("rb") as stream:
            reader = NonSeekingReader(stream, record_size_limit=None)
            records = reader._stream_reader.records
            next(records)
            metadata, attachment = next(records), next(records)
    finally:
        log.close()
    assert metadata.name == "splinefleet"
    assert metadata.metadata == {"fleet": "f", "wall_offset_ns": str(WALL)}
    assert (attachment.name, attachment.media_type, attachment.data) == SCENARIO


@pytest.mark.parametrize("hurried", [False, True])
def test_a_message_reaches_the_file_without_a_close(tmp_path, monkeypatch, hurried):
    monkeypatch.setattr(recorder_module, "FLUSH_PERIOD_S", 600.0 if hurried else 0.08)
    path = tmp_path / "run.mcap"
    log = open_log(path)
    try:
        before = path.stat().st_size
        log.record(keys.command("f"), b"x", 1)
        if hurried:
            log.hurry()
        deadline = time.monotonic() + 5.0
        while path.stat().st_size == before and time.monotonic() < deadline:
            threading.Event().wait(0.01)
        assert path.stat().st_size > before
    finally:
        log.close()


def test_what_somebody_waited_for_is_brought_to_the_disk_at_once(tmp_path, monkeypatch):
    path, on_disk = tmp_path / "run.mcap", threading.Event()
    log = open_log(path)
    try:
        wanted = path.stat().st_size
        monkeypatch.setattr(
            log_writer, "_SYNC", lambda file: os.fstat(file).st_size > wanted and on_disk.set()
        )
        log.record(keys.command("f"), b"x", 1)
        assert log.sync()
        assert on_disk.wait(5.0)
    finally:
        log.close()


def test_a_key_that_is_not_ours_is_recorded_as_plain_bytes(tmp_path):
    path = tmp_path / "run.mcap"
    with open_log(path) as log:
        log.record("somebody/else", b"\x00\xff", 1)
        log.record("splinefleet/f/ödd key", b"", 2)
    with path.open("rb") as stream:
        found = list(make_reader(stream).iter_messages())
    assert [(s, c.message_encoding, m.data) for s, c, m in found] == [
        (None, "application/octet-stream", b"\x00\xff"),
        (None, "application/octet-stream", b""),
    ]


def test_nothing_is_lost_when_many_threads_record_at_once(tmp_path):
    path = tmp_path / "run.mcap"
    log = open_log(path)

    def work(number: int) -> None:
        for i in range(500):
            log.record(keys.report("f", f"R{number}"), i.to_bytes(2, "little"), i)

    threads = [threading.Thread(target=work, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    log.close()
    with path.open("rb") as stream:
        found = list(NonSeekingReader(stream).iter_messages(log_time_order=False))
    for number in range(4):
        mine = [m for _, c, m in found if c.topic.endswith(f"R{number}")]
        assert [int.from_bytes(m.data, "little") for m in mine] == list(range(500))
        assert [m.sequence for m in mine] == list(range(500))


def test_a_closed_log_is_closed_only_once_and_takes_nothing_more(tmp_path):
    path = tmp_path / "run.mcap"
    log = open_log(path)
    log.attach("plan-1.json", "application/json", b"{}")
    log.close()
    size = path.stat().st_size
    log.close()
    log.record(keys.command("f"), b"late", 1)
    log.attach("late", "text/plain", b"late")
    log.close()
    assert path.stat().st_size == size
    with path.open("rb") as stream:
        names = [attachment.name for attachment in make_reader(stream).iter_attachments()]
    assert names == ["scenario.json", "plan-1.json"]


@pytest.mark.parametrize("sent_ns", [-1, 2**64, 2**70])
def test_a_senders_clock_may_say_anything(tmp_path, sent_ns):
    path = tmp_path / "run.mcap"
    with open_log(path) as log:
        log.record(keys.command("f"), b"x", 1, sent_ns=sent_ns)
    with path.open("rb") as stream:
        assert len(list(make_reader(stream).iter_messages())) == 1


def test_a_missing_directory_and_a_full_disk_are_one_sentence_at_the_opening(tmp_path):
    for path, reason in (
        (tmp_path / "no" / "run.mcap", "No such file or directory"),
        (Path("/dev/full"), "No space left on device"),
    ):
        with pytest.raises(InputError) as caught:
            open_log(path)
        assert caught.value.problems == (f"{path}: the log cannot be written: {reason}",)


def test_a_disk_that_fills_up_is_told_once_at_the_close_and_never_to_the_recording(tmp_path):
    path = tmp_path / "run.mcap"
    log = open_log(path)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (8_192, limits[1]))
    try:
        log.record(keys.command("f"), random.Random(1).randbytes(200_000), 1)
        with pytest.raises(LogError, match=r"run\.mcap: the log cannot be written: File too large"):
            log.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert log.error is not None
    log.record(keys.command("f"), b"x", 2)
    log.close()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_whatever_ends_the_writing_is_told_and_nobody_waits_for_it(tmp_path, monkeypatch):
    log = open_log(tmp_path / "run.mcap")

    def fail(*_):
        raise RuntimeError

    monkeypatch.setattr(Writer, "add_message", fail)
    log.record(keys.command("f"), b"x", 1)
    assert not log.sync()
    with pytest.raises(LogError, match=r"the log cannot be written: RuntimeError\(\)"):
        log.close()


def test_a_long_burst_is_cut_into_chunks(tmp_path, monkeypatch):
    monkeypatch.setattr(log_writer, "CHUNK_BYTES", 1_000)
    path = tmp_path / "run.mcap"
    with open_log(path) as log:
        for i in range(100):
            log.record(keys.command("f"), bytes(100), i)
    with path.open("rb") as stream:
        assert make_reader(stream).get_summary().statistics.chunk_count >= 10


def test_a_schema_names_every_field_of_its_message():
    described = json.loads(schema.json_schema("report"))
    items = described["$defs"]["Report"]["prefixItems"]
    fields = [field.name for field in msgspec.structs.fields(Report)]
    assert [item["title"] for item in items] == ["tag", *fields]
    assert {kind: schema.schema_name(kind) for kind in codec.KINDS} == {
        "hello": "splinefleet.Hello",
        "plan": "splinefleet.Plan",
        "command": "splinefleet.Command",
        "report": "splinefleet.Report",
        "clock": "splinefleet.Clock",
        "admit": "splinefleet.Admit",
        "order": "splinefleet.Order",
        "orders": "splinefleet.OrderState",
        "tell": "splinefleet.Tell",
        "roster": "splinefleet.Join",
        "block": "splinefleet.Block",
        "blocks": "splinefleet.Block",
    }
    assert set(json.loads(schema.json_schema("plan"))["$defs"]) == {"Plan", "Refusal"}


def test_what_waits_for_a_disk_that_hangs_is_bounded_and_what_is_missing_is_told(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(recorder_module, "MOST_WAITING", 20_000)
    goes_on = threading.Event()
    write = Recorder._write_waiting

    def hang(self):
        goes_on.wait(20.0)
        write(self)

    monkeypatch.setattr(Recorder, "_write_waiting", hang)
    path = tmp_path / "run.mcap"
    log = open_log(path)
    for number in range(1_000):
        log.record(keys.report("f", "R1"), bytes(100), number)
    assert log.dropped == 950
    goes_on.set()
    with pytest.raises(LogError, match="950 messages are not in it"):
        log.close()
    with path.open("rb") as stream:
        assert make_reader(stream).get_summary().statistics.message_count == 50


def test_keys_that_somebody_invents_do_not_end_the_log(tmp_path, monkeypatch):
    monkeypatch.setattr(log_writer, "MOST_CHANNELS", 100)
    path = tmp_path / "run.mcap"
    log = open_log(path)
    for number in range(1_000):
        log.record(f"splinefleet/f/invented/{number}", b"", number)
        log.record(keys.command("f") if number == 0 else "splinefleet/f/invented/1", b"", number)
    with pytest.raises(LogError, match="messages are not in it: too many"):
        log.close()
    with path.open("rb") as stream:
        assert make_reader(stream).get_summary().statistics.channel_count == 100


def test_a_log_that_is_being_written_is_never_emptied_by_another_recorder(tmp_path):
    path = tmp_path / "run.mcap"
    with open_log(path) as log:
        log.record(keys.command("f"), b"x", 1)
        log.sync()
        before = path.read_bytes()
        with pytest.raises(InputError, match="cannot be written: another program is writing it"):
            open_log(path)
        assert path.read_bytes() == before
    with path.open("rb") as stream:
        assert len(list(make_reader(stream, validate_crcs=True).iter_messages())) == 1
    open_log(path).close()
    with path.open("rb") as stream:
        assert list(make_reader(stream, validate_crcs=True).iter_messages()) == []


def test_a_log_that_is_there_stays_unless_it_may_be_replaced(tmp_path):
    path = tmp_path / "run.mcap"
    path.write_bytes(b"dear")
    with pytest.raises(InputError, match="cannot be written: File exists"):
        open_log(path, replace=False)
    assert path.read_bytes() == b"dear"


def test_many_recorders_may_write_to_nowhere():
    with open_log(Path("/dev/null")), open_log(Path("/dev/null")):
        pass
