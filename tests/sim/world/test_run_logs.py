"""Logs of fleets in virtual time: run again byte for byte, read by the stock reader and schemas."""

import gzip
import io
import json
from contextlib import closing
from pathlib import Path

import msgspec
import pytest
from mcap.decoder import DecoderFactory
from mcap.reader import make_reader

from coordinator.base.errors import LogError
from coordinator.findings.info import summarise
from coordinator.fleet import epoch_times
from coordinator.fleet.core import Fleet
from coordinator.fleet.log_records import around_key
from coordinator.fleet.phases import GO_LEAD
from coordinator.log.log_file import RESUMED, log_from_bytes, read_log
from coordinator.log.recover import make_whole
from coordinator.scenario_files.scenario_reader import parse_scenario
from coordinator.service.replay import check_log
from protocol.codec import decode
from protocol.messages import Command
from protocol.phases import GO
from protocol.timing import MILLISECOND
from sim.campaigns.campaign import Wish, run_seed
from sim.judging.blackbox import read_blackbox
from sim.processes.boxed_log import put_boxes
from sim.world.fault_script import KINDS, read_faults
from sim.world.run_logs import RunLogs
from tests.json_schema import problems
from tests.sim.world.test_changed_floor import RACK, a_hall, on_another_floor
from tests.sim.world.test_virtual_fleet import SCENARIO

ROBOTS = ("R1", "R2", "R3")
FAULTS = ("kill:R1@3", "corrupt:R2@2:1", "coordinator-hang@6:1.5", "coordinator-restart@10:2")
SEED, GOOD_LINK = 8, Wish(loss=0.0, delay=0.005)
SEEDS = (2, 5, 9, 14, 18, 20, 22, 32)
"""Robots sent around others, hangs under way, coordinators that die and go on from their logs."""


@pytest.fixture(scope="module")
def scenario():
    return parse_scenario(SCENARIO, "three.toml")


@pytest.fixture(scope="module")
def story(scenario, tmp_path_factory):
    """A folder with the logs of a run in which much goes wrong."""
    folder = tmp_path_factory.mktemp("story")
    run_seed(scenario, SEED, GOOD_LINK, read_faults(FAULTS, ROBOTS), folder)
    return folder


def logs_of(folder: Path) -> list[Path]:
    return sorted(folder.glob("run*.mcap"), key=lambda path: len(path.name))


DECODERS = {"msgpack": msgspec.msgpack.decode, "json": json.loads}


class BySchema(DecoderFactory):
    """Decodes by what a log says of itself, with nothing of this project but a validator."""

    def decoder_for(self, message_encoding, schema):
        if schema is None:
            assert message_encoding == "application/octet-stream"
            return lambda data: data
        described = json.loads(schema.data)

        def decoded(data):
            value = DECODERS[message_encoding](data)
            assert list(problems(described, value)) == []
            return value

        return decoded


def test_the_stock_reader_decodes_every_message_of_a_faulty_run_by_its_schema(story, tmp_path):
    on_another_floor(a_hall(), RunLogs(tmp_path), (RACK,))
    seen, plain = set(), 0
    for path in (*logs_of(story), *logs_of(tmp_path)):
        whole = io.BytesIO(make_whole(path.read_bytes(), "log").data)
        reader = make_reader(whole, validate_crcs=True, decoder_factories=[BySchema()])
        for schema, channel, _, value in reader.iter_decoded_messages():
            kind = channel.topic.split("/")[2]
            if schema is None:
                assert decode(kind, value) is None
                plain += 1
            else:
                seen.add(kind)
    assert seen >= {
        *("hello", "plan", "command", "report", "clock", "alive", "epoch", "course"),
    }
    assert plain


def test_a_robot_that_dies_is_told_as_a_link_that_is_gone(story):
    (first, *_) = logs_of(story)
    links = [(r.key[-2:], r.payload) for r in read_log(first).records if "/alive/" in r.key]
    assert [msgspec.msgpack.decode(payload) for robot, payload in links if robot == "R1"] == [
        True,
        False,
    ]


def test_each_log_has_its_scenario_every_plan_and_the_log_before_it(story):
    first, second = logs_of(story)
    assert not read_log(first).complete
    for path in (first, second):
        log = read_log(path)
        assert check_log(log).difference == ""
        epochs = {
            message.epoch
            for record in log.records
            if (message := decode("plan", record.payload)) and record.key.split("/")[2] == "plan"
        }
        assert epochs
        assert {f"plan-{epoch}.json" for epoch in epochs} <= set(log.attachments)
        assert "scenario.json" in log.attachments
    assert read_log(second).attachments[RESUMED] == first.read_bytes()


@pytest.mark.parametrize("seed", SEEDS)
def test_the_logs_of_random_faulty_runs_are_run_again_byte_for_byte(scenario, tmp_path, seed):
    run_seed(scenario, seed, Wish(kinds=tuple(KINDS)), folder=tmp_path)
    for path in logs_of(tmp_path):
        result = check_log(read_log(path))
        assert result.difference == ""
        assert result.commands


def test_the_log_of_a_coordinator_that_died_before_its_first_command_is_run_again(
    scenario, tmp_path
):
    faults = read_faults(("coordinator-restart@4:0.2", "coordinator-restart@4.21:0.2"), ROBOTS)
    run_seed(scenario, SEED, GOOD_LINK, faults, tmp_path)
    checks = [check_log(read_log(path)) for path in logs_of(tmp_path)]
    assert [check.difference for check in checks] == ["", "", ""]
    assert sorted(check.commands > 0 for check in checks) == [False, True, True]


def test_the_same_run_gives_the_same_logs_byte_for_byte(story, scenario, tmp_path):
    run_seed(scenario, SEED, GOOD_LINK, read_faults(FAULTS, ROBOTS), tmp_path)
    assert [path.read_bytes() for path in logs_of(tmp_path)] == [
        path.read_bytes() for path in logs_of(story)
    ]


def test_a_log_that_cannot_be_written_is_told_in_a_sentence(tmp_path):
    logs = RunLogs(tmp_path)
    logs.close()  # Nothing was begun, so there is nothing to close.
    logs.begin(({}, []))
    logs.record("splinefleet/f/command", b"x", 1)
    logs._writer._stream.close()
    with pytest.raises(LogError, match=r"run\.mcap: the log cannot be written: .*closed file"):
        logs.close()


def test_after_a_cut_nothing_is_recorded_until_the_next_log(tmp_path):
    with closing(RunLogs(tmp_path)) as logs:
        logs.begin(({}, []))
        logs.record("splinefleet/f/command", b"x", 1)
        before = logs.cut()
        logs.record("splinefleet/f/command", b"y", 2)
        logs.attach("plan-2.json", "application/json", b"{}")
    assert (tmp_path / "run.mcap").read_bytes() == before
    log = log_from_bytes(before, "log")
    assert ([record.payload for record in log.records], log.complete) == ([b"x"], False)


def test_a_power_cut_leaves_what_was_brought_to_the_disk(tmp_path):
    with closing(RunLogs(tmp_path, power_cuts=True)) as logs:
        logs.begin(({}, []))
        logs.record("splinefleet/f/command", b"x", 1)
        logs.sync()
        logs.record("splinefleet/f/command", b"y", 2)
        before = logs.cut()
    assert (tmp_path / "run.mcap").read_bytes() == before
    assert [record.payload for record in log_from_bytes(before, "log").records] == [b"x"]


def test_a_core_that_decides_otherwise_is_found_at_the_first_message_that_differs(
    story, monkeypatch
):
    log = read_log(logs_of(story)[0])
    place = next(
        i
        for i, record in enumerate(log.records)
        if isinstance(told := decode("command", record.payload), Command) and told.phase == GO
    )
    assert check_log(log).difference == ""
    monkeypatch.setattr(epoch_times, "GO_LEAD", GO_LEAD + MILLISECOND)
    found = check_log(log).difference
    assert found.startswith(f"message {place} on {log.records[place].key}, ")
    assert "byte" in found


def test_a_core_that_sends_nobody_around_a_lost_robot_is_found_where_the_log_has_it(
    story, monkeypatch
):
    log = read_log(logs_of(story)[0])
    place = next(i for i, one in enumerate(log.records) if one.key == around_key("three"))
    monkeypatch.setattr(Fleet, "go_around", lambda *_: None)
    assert check_log(log).difference.startswith(f"message {place} on {around_key('three')}, ")


def test_black_boxes_are_put_into_the_newest_closed_log_and_nothing_else_changes(story, tmp_path):
    first, second = logs_of(story)
    (tmp_path / "blackbox").mkdir()
    rows = "t,x,y,heading,s,phase\n0.000000,1.0,2.0,0.0,0.0,MOVING\n"
    (tmp_path / "blackbox" / "R1.csv").write_text(rows)
    for path in (first, second):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    put_boxes(tmp_path)
    assert (tmp_path / first.name).read_bytes() == first.read_bytes()
    boxed, before = read_log(tmp_path / second.name), read_log(second)
    assert boxed.complete
    assert [(r.key, r.payload, r.log_ns, r.publish_ns) for r in boxed.records] == [
        (r.key, r.payload, r.log_ns, r.publish_ns) for r in before.records
    ]
    assert boxed.metadata == before.metadata
    added = boxed.attachments.pop("blackbox/R1.csv.gz")
    assert gzip.decompress(added).decode() == rows
    assert boxed.attachments == before.attachments
    assert check_log(boxed).difference == ""
    assert summarise(boxed) == summarise(before)
    assert len(read_blackbox(tmp_path / "blackbox" / "R1.csv").t) == 1
