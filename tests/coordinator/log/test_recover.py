"""Logs made whole: cut anywhere, damaged anywhere; judged by the stock mcap reader."""

import io
import random

import msgspec
import pytest
from mcap.reader import NonSeekingReader, make_reader
from typer.testing import CliRunner

from coordinator.base.errors import InputError
from coordinator.cli.log_commands import commands
from coordinator.findings.info import summarise
from coordinator.log.log_file import log_from_bytes, read_log
from coordinator.log.log_writer import Attachment
from coordinator.log.recorder import Recorder
from coordinator.log.recover import RECOVERED, make_whole
from coordinator.service.replay import check_log
from tests.json_schema import problems

CUTS = 1_000


def read(data):
    """Return summary, messages and attachments as the stock reader finds them."""
    reader = make_reader(io.BytesIO(data), validate_crcs=True)
    messages = [
        (channel.topic, m.sequence, m.log_time, m.publish_time, m.data)
        for _, channel, m in NonSeekingReader(io.BytesIO(data)).iter_messages(log_time_order=False)
    ]
    attachments = {each.name: each.data for each in reader.iter_attachments()}
    return reader.get_summary(), messages, attachments


def chunks_of(data):
    """Return where each chunk begins and ends, and its messages, by the stock reader's index."""
    summary, messages, _ = read(data)
    found, first = [], 0
    for index in summary.chunk_indexes:
        count = sum(
            1
            for record in log_from_bytes(data, "log").records
            if record.offset == index.chunk_start_offset
        )
        end = index.chunk_start_offset + index.chunk_length
        found.append((index.chunk_start_offset, end, messages[first : first + count]))
        first += count
    assert first == len(messages)
    return found


def value_of(data):
    """Return what msgpack states."""
    return msgspec.to_builtins(msgspec.msgpack.decode(data))


@pytest.mark.usefixtures("planned_once")
def test_a_log_cut_at_a_thousand_places_never_fells_a_reader_and_keeps_every_whole_chunk(recorded):
    chunks = chunks_of(recorded)
    summary, _, attachments = read(recorded)
    assert len(chunks) >= 10
    metadata_end = summary.metadata_indexes[0].offset + summary.metadata_indexes[0].length
    ends = {index.name: index.offset + index.length for index in summary.attachment_indexes}
    chance = random.Random(6)
    for size in [chance.randrange(len(recorded)) for _ in range(CUTS)]:
        cut = recorded[:size]
        if size < metadata_end:
            with pytest.raises(InputError):
                make_whole(cut, "cut.mcap")
            continue
        expected = [m for _, end, messages in chunks if end <= size for m in messages]
        kept = {name: data for name, data in attachments.items() if ends[name] <= size}
        log = log_from_bytes(cut, "cut.mcap")
        assert summarise(log)["messages"] == len(expected)
        difference = check_log(log).difference
        assert ("attachment" in difference or "lacks what" in difference) == (len(kept) < 2) or (
            not expected and "the log holds" in difference
        ), (size, difference)
        whole = make_whole(cut, "cut.mcap")
        found_summary, found, found_attachments = read(whole.data)
        assert (found, found_attachments) == (expected, kept), size
        assert (whole.messages, whole.attachments) == (len(expected), len(kept))
        assert found_summary.statistics.message_count == len(expected)
        assert log_from_bytes(whole.data, "whole.mcap").complete


def test_what_is_whole_stays_as_it_is_and_does_not_say_that_it_was_made_so(recorded):
    whole = make_whole(recorded, "run.mcap")
    assert read(whole.data)[1:] == read(recorded)[1:]
    assert (whole.complete, whole.damage, whole.lost) == (True, "", 0)
    for data in (recorded, make_whole(recorded[:-100], "cut").data):
        names = [m.name for m in make_reader(io.BytesIO(data)).iter_metadata()]
        assert (RECOVERED in names) == (data is not recorded)


def test_a_log_made_whole_twice_is_the_same(recorded):
    once = make_whole(recorded[: len(recorded) // 2], "cut").data
    assert make_whole(once, "once").data == once


def test_a_damaged_chunk_costs_only_itself(recorded):
    chunks = chunks_of(recorded)
    for start, end, gone in chunks:
        data = bytearray(recorded)
        data[end - 10] ^= 0xFF
        whole = make_whole(bytes(data), "damaged")
        expected = [m for chunk in chunks if chunk[2] is not gone for m in chunk[2]]
        assert read(whole.data)[1] == expected
        assert whole.damage.startswith(f"damaged at byte {start} (chunk)")


@pytest.mark.parametrize("place", [1, 3, 7])
def test_a_record_whose_length_is_damaged_hides_nothing(recorded, place):
    chunks = chunks_of(recorded)
    for start, *_ in chunks[:-1]:
        data = bytearray(recorded)
        data[start + place] = 0xEE
        whole = make_whole(bytes(data), "damaged")
        assert read(whole.data)[1:] == read(recorded)[1:], start
        assert whole.damage.startswith(f"damaged at byte {start} (chunk)")


@pytest.mark.parametrize("place", [1, 3, 7])
def test_a_chunk_whose_length_and_contents_are_damaged_costs_only_itself(recorded, place):
    chunks = chunks_of(recorded)
    for start, end, gone in chunks[:-1]:
        data = bytearray(recorded)
        data[start + place] = 0xEE
        data[end - 10] ^= 0xFF
        whole = make_whole(bytes(data), "damaged")
        expected = [m for chunk in chunks if chunk[2] is not gone for m in chunk[2]]
        assert read(whole.data)[1] == expected, start
        assert whole.damage.startswith(f"damaged at byte {start} (chunk)")


def test_a_log_inside_a_cut_log_is_never_taken_for_its_own(tmp_path, recorded):
    path = tmp_path / "resumed.mcap"
    inner = Attachment("resumed.mcap", "application/octet-stream", recorded)
    Recorder(path, metadata={"fleet": "one"}, wall_offset_ns=0, attachments=[inner]).close()
    data = path.read_bytes()
    for size in range(200, len(data) - 1_000, 97):
        whole = make_whole(data[:size], "cut")
        assert (whole.messages, whole.attachments) == (0, 0), size


def test_damage_anywhere_never_fells_it_nor_makes_messages_up(recorded):
    true = set(read(recorded)[1])
    chance = random.Random(7)
    for _ in range(300):
        data = bytearray(recorded)
        for _ in range(chance.randrange(1, 4)):
            data[chance.randrange(len(data))] ^= chance.randrange(1, 256)
        try:
            whole = make_whole(bytes(data), "damaged")
        except InputError:
            continue
        assert set(read(whole.data)[1]) <= true


def test_the_schemas_in_a_log_describe_every_message_in_it(recorded):
    whole = make_whole(recorded[: 9 * len(recorded) // 10], "cut").data
    described = set()
    for schema, channel, message in make_reader(io.BytesIO(whole)).iter_messages():
        if channel.message_encoding == "msgpack":
            value = value_of(message.data)
            assert list(problems(msgspec.json.decode(schema.data), value)) == [], schema.name
            described.add(schema.name)
    assert described >= {"splinefleet.Hello", "splinefleet.Plan", "splinefleet.Command"}


def test_the_schemas_refuse_what_a_message_is_not(recorded):
    for schema, _, message in make_reader(io.BytesIO(recorded)).iter_messages():
        if schema is not None:
            value = value_of(message.data)
            described = msgspec.json.decode(schema.data)
            assert list(problems(described, "x"))
            if isinstance(value, list):
                assert list(problems(described, [99, *value[1:]]))
                assert list(problems(described, [value[0], "x", *value[2:]]))


def test_the_command_says_what_was_kept_and_leaves_the_log_alone(tmp_path, recorded):
    cut = tmp_path / "run.mcap"
    cut.write_bytes(recorded[:-500])
    result = CliRunner().invoke(commands, ["recover", str(cut)])
    assert result.exit_code == 0
    whole = read_log(tmp_path / "run-whole.mcap")
    assert f"{len(whole.records)} messages" in result.output.replace("\n", " ")
    assert cut.read_bytes() == recorded[:-500]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run-whole.mcap", "run.mcap"]
    answer = CliRunner().invoke(commands, ["recover", str(cut), "--force", "--json"]).stdout
    assert msgspec.json.decode(answer)["messages"] == len(whole.records)


def test_a_file_that_is_there_is_replaced_on_wish_only(tmp_path, recorded):
    log, other = tmp_path / "run.mcap", tmp_path / "other.mcap"
    log.write_bytes(recorded)
    other.write_bytes(b"dear")
    asked = ["recover", str(log), "-o", str(other)]
    with pytest.raises(InputError, match=r"other\.mcap already exists; --force replaces it"):
        commands(asked, standalone_mode=False)
    assert other.read_bytes() == b"dear"
    assert CliRunner().invoke(commands, [*asked, "--force"]).exit_code == 0
    assert read_log(other).complete


def test_a_log_is_not_written_over_itself(tmp_path, recorded):
    log = tmp_path / "run.mcap"
    log.write_bytes(recorded)
    with pytest.raises(InputError, match="is the log itself"):
        commands(["recover", str(log), "-o", str(log)], standalone_mode=False)
    assert log.read_bytes() == recorded
