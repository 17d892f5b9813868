"""Logs that somebody has changed or shortened, every checksum of the file being right."""

import random

import pytest
from msgspec.structs import replace

from coordinator.base.errors import InputError
from coordinator.log.log_file import log_from_bytes
from coordinator.log.log_writer import Attachment
from coordinator.log.recover import make_whole, with_files
from coordinator.service.replay import check_log, go_on
from coordinator.view.scene_reader import read_scene
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import Command

pytestmark = pytest.mark.usefixtures("planned_once")


@pytest.fixture
def log(recorded):
    return log_from_bytes(recorded, "run.mcap")


def with_records(log, records):
    return replace(log, records=list(records))


def numbers_of(log, key):
    return [number for number, record in enumerate(log.records) if record.key == key]


def test_a_changed_command_is_told_itself_and_not_a_later_message(log):
    chance = random.Random(5)
    for number in numbers_of(log, keys.command("one")):
        record = log.records[number]
        for place in range(len(record.payload)):
            payload = bytearray(record.payload)
            payload[place] ^= 1 << chance.randrange(8)
            changed = list(log.records)
            changed[number] = replace(record, payload=bytes(payload))
            difference = check_log(with_records(log, changed)).difference
            assert difference.startswith(f"message {number} on {record.key}"), (place, difference)


def test_a_command_of_another_coordinator_is_heard_and_not_told(log):
    number = numbers_of(log, keys.command("one"))[2]
    record = log.records[number]
    command = decode("command", record.payload)
    other = Command(0x01020304, 0, command.sequence + 1, command.epoch, command.phase, 0, 0)
    heard = replace(record, payload=encode(other), log_ns=record.log_ns + 1)
    records = [*log.records[: number + 1], heard, *log.records[number + 1 :]]
    assert check_log(with_records(log, records)).difference == ""


def test_a_closed_log_does_not_end_before_what_is_due(log):
    kinds = {"plan", "clock"}
    ends = [
        number
        for number, record in enumerate(log.records)
        if (place := keys.split(record.key)) is not None and place[1] in kinds
    ]
    found = [check_log(with_records(log, log.records[:number])).difference for number in ends]
    assert any("the log ends before what the core sends on" in text for text in found)
    cut = replace(log, records=log.records[: ends[0]], complete=False)
    assert "the log ends before" not in check_log(cut).difference


def test_a_log_without_its_last_messages_is_noted(log):
    assert check_log(log).note == ""
    for missing in (1, 2, 3, 10, 50):
        check = check_log(with_records(log, log.records[:-missing]))
        assert check.difference or "before the fleet had ended" in check.note, missing
    assert "ends at OVER, before" in check_log(with_records(log, log.records[:-1])).note


def test_a_log_that_goes_on_from_one_that_is_over_differs_and_names_no_option(log, recorded):
    inside = {**log.attachments, "resumed.mcap": recorded}
    again = replace(log, attachments=inside, metadata={**log.metadata, "began_ns": "5"})
    difference = check_log(again).difference
    assert difference.startswith("resumed.mcap, which it resumes: the fleet in this log")
    assert "--resume" not in difference


def damaged(recorded):
    """The log with a changed byte in a chunk that has a Command, and where that chunk is."""
    log = log_from_bytes(recorded, "run.mcap")
    commands = numbers_of(log, keys.command("one"))
    chunk = log.records[commands[len(commands) // 3]].offset
    data = bytearray(recorded)
    data[chunk + 60] ^= 0xFF
    return bytes(data), chunk


def test_a_difference_in_a_damaged_log_begins_with_the_damage(recorded):
    data, chunk = damaged(recorded)
    with pytest.raises(InputError) as caught:
        go_on(log_from_bytes(data, "run.mcap"), 10, 10**12)
    (problem,) = caught.value.problems
    assert problem.startswith(f"the log cannot be resumed: damaged at byte {chunk} (chunk): ")
    assert "; message " in problem


def test_a_difference_in_a_recovered_log_begins_with_what_it_was_before(recorded):
    data, chunk = damaged(recorded)
    whole = log_from_bytes(make_whole(data, "run.mcap").data, "whole.mcap")
    said = f"recovered (before: damaged at byte {chunk} (chunk)"
    assert check_log(whole).difference.startswith(said)
    cut = log_from_bytes(make_whole(recorded[: len(recorded) // 2], "cut.mcap").data, "whole.mcap")
    assert cut.remarks == ["recovered (before: not closed)"]


def test_a_broken_black_box_is_left_out_of_the_picture_with_a_note(tmp_path, recorded):
    path = tmp_path / "run.mcap"
    broken = Attachment("blackbox/R1.csv.gz", "application/gzip", b"no gzip")
    path.write_bytes(with_files(recorded, "run.mcap", [broken]))
    scene = read_scene(path)
    assert scene.robots
    assert any("without black boxes: attachment blackbox/R1" in note for note in scene.notes)
