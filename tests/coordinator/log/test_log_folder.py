"""A log that is a folder: files by size, each of which begins with a checkpoint."""

import shutil

import pytest
from msgspec.structs import replace

from coordinator.base.errors import InputError
from coordinator.findings.info import summarise
from coordinator.findings.log_proof import prove_log
from coordinator.fleet.log_records import is_checkpoint_key
from coordinator.log.head import resumed
from coordinator.log.log_file import (
    is_unfinished,
    logs_before,
    read_log,
    read_newest,
    readable_logs_before,
)
from coordinator.log.log_folder import numbered_files
from coordinator.log.log_writer import Attachment
from coordinator.log.recorder import Recorder
from coordinator.mission import mission_driver
from coordinator.mission.checkpoint import checkpoint_of
from coordinator.service.replay import check_log, mission_at_end
from sim.world.run_logs import WALL_OFFSET_NS, RunLogs
from tests.sim.world.test_checkpoints import a_busy_day
from tests.sim.world.test_orders_in_time import a_world

LEAST = 20_000


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The two logs of a fleet whose coordinator was killed, as single files."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mission_driver, "_CHECKPOINT_SHARE", 0)
        logs = RunLogs(tmp_path_factory.mktemp("run"))
        world = a_world(
            a_busy_day("rooms", 6, 3),
            logs=logs,
            faults=["coordinator-restart@40:3"],
            checkpoint_bytes=10_000,
        )
        world.run(600.0)
        logs.close()
    return [read_log(path) for path in logs.paths]


def recorded(log, folder, head, *, stop=None):
    """Record a log's messages again, into the next files of a folder."""
    metadata, files = head
    recorder = Recorder(
        folder,
        metadata=metadata,
        wall_offset_ns=WALL_OFFSET_NS,
        attachments=files,
        most_bytes=LEAST,
    )
    for number, one in enumerate(log.records[:stop]):
        recorder.record(one.key, one.payload, one.log_ns)
        if number % 50 == 0:
            recorder.sync()
    return recorder


def head_of(log):
    names = ("scenario.json", "plan-1.json")
    files = [Attachment(name, "application/json", log.attachments[name]) for name in names]
    return log.metadata, files


@pytest.fixture(scope="module")
def day(run, tmp_path_factory):
    """The same as one folder."""
    folder = tmp_path_factory.mktemp("day")
    first, second = run
    assert recorded(first, folder, head_of(first)).sync()
    began_ns = int(second.metadata["began_ns"])
    recorded(second, folder, resumed(head_of(second), b"", began_ns)).close()
    return folder


def test_the_files_of_a_folder_hold_all_that_was_recorded_in_order(run, day):
    assert len(numbered_files(day)) > 4
    log = read_log(day)
    for one, single in zip([*logs_before(log), log], run, strict=True):
        assert [r[:3] for r in map(tuple_of, one.records)] == [
            r[:3] for r in map(tuple_of, single.records)
        ]
    assert log.complete
    assert log.remarks == []
    assert not is_unfinished(day)


def tuple_of(record):
    return record.key, record.payload, record.log_ns


def test_each_later_file_is_enough_to_go_on_from(day):
    files = numbered_files(day)
    for file in files[1:]:
        part = read_log(file)
        assert is_checkpoint_key(part.records[0].key)
        assert checkpoint_of(mission_at_end(replace(part, records=part.records[:1]))) == (
            part.records[0].payload
        )
        assert check_log(part).difference == ""
    newest, data = read_newest(day)
    assert (newest, data) == (read_log(files[-1]), files[-1].read_bytes())


def test_the_day_is_checked_proven_and_summed_up_as_one_log(run, day):
    log = read_log(day)
    assert check_log(log).difference == ""
    assert prove_log(log, before=logs_before(log)).holds
    told = summarise(log, before=readable_logs_before(log))
    single = summarise(run[-1], before=readable_logs_before(run[-1]))
    assert told["orders"] == single["orders"]
    assert told["keys"] == single["keys"]


def test_the_oldest_files_may_be_deleted(day, tmp_path):
    kept = numbered_files(day)[2:]
    for file in kept:
        (tmp_path / file.name).write_bytes(file.read_bytes())
    assert check_log(read_log(tmp_path)).difference == ""


def test_a_file_that_was_begun_when_its_coordinator_was_killed_is_passed_over(run, day, tmp_path):
    for file in numbered_files(day):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    last = numbered_files(day)[-1]
    head = last.read_bytes()[:300]
    number = len(numbered_files(day))
    for length in (0, 8, 40, 300):
        (tmp_path / f"run-{number + 1:04d}.mcap").write_bytes(head[:length])
        assert read_newest(tmp_path)[0].records == read_log(last).records
        assert len(read_log(tmp_path).records) == len(run[-1].records)
    (tmp_path / f"run-{number + 1:04d}.mcap").write_bytes(b"no log at all")
    with pytest.raises(InputError, match=r"is not an MCAP file|is not the log"):
        read_log(tmp_path)


def test_a_folder_without_a_log_is_told(tmp_path):
    with pytest.raises(InputError, match=r": holds no log$"):
        read_log(tmp_path)


def test_a_folder_without_a_log_says_which_of_its_folders_has_one(day, tmp_path):
    shutil.copytree(day, tmp_path / "day")
    with pytest.raises(InputError, match=r": holds no log; a log is in day$"):
        read_log(tmp_path)


@pytest.fixture
def two(tmp_path_factory, tmp_path):
    """A folder with the logs of two coordinators, the second of which resumes the first."""
    folder = next(tmp_path_factory.getbasetemp().glob("run*/run-2.mcap")).parent
    shutil.copy(folder / "run.mcap", tmp_path / "z.mcap")
    shutil.copy(folder / "run-2.mcap", tmp_path / "a.mcap")
    return tmp_path


def test_the_folder_of_a_run_is_read_by_its_newest_log(run, tmp_path_factory):
    folder = next(tmp_path_factory.getbasetemp().glob("run*/run-2.mcap")).parent
    log = read_log(folder)
    assert (log.records, log.remarks) == (run[-1].records, [])


def test_logs_of_any_name_are_read_by_the_one_that_resumes_the_others(run, two):
    log = read_log(two)
    assert (log.records, log.remarks) == (run[-1].records, [])


def test_what_is_no_log_of_the_coordinator_is_named(run, two):
    (two / "export.mcap").write_bytes(b"no log at all")
    listener = {"fleet": run[0].metadata["fleet"], "passive": "yes"}
    Recorder(two / "beside.mcap", metadata=listener, wall_offset_ns=0).close()
    log = read_log(two)
    assert log.records == run[-1].records
    assert log.remarks == ["not part of the log: beside.mcap, export.mcap"]


def test_other_logs_beside_the_files_of_a_day_are_named(day, two):
    for file in numbered_files(day):
        shutil.copy(file, two)
    log = read_log(two)
    assert log.records == read_log(day).records
    assert log.remarks == ["not part of the log: a.mcap, z.mcap"]


def test_logs_none_of_which_contains_the_others_are_named_and_none_is_taken(two):
    shutil.copy(two / "a.mcap", two / "again.mcap")
    with pytest.raises(InputError, match=r"2 logs, none .*: a\.mcap, again\.mcap; name one of"):
        read_log(two)


def test_a_copy_beside_the_log_of_a_run_is_named_and_the_log_of_the_run_is_taken(run, two):
    shutil.copy(two / "a.mcap", two / "run.mcap")
    log = read_log(two)
    assert log.records == run[-1].records
    assert log.remarks == ["not part of the log: a.mcap"]


def test_a_coordinator_goes_on_in_a_folder_of_numbered_files_alone(two):
    with pytest.raises(InputError, match=r"no log in files run-0001\.mcap, \.\.\.; name the log's"):
        read_newest(two)


def test_damage_in_a_folder_is_told_with_the_file(day, tmp_path):
    for file in numbered_files(day):
        shutil.copy(file, tmp_path)
    last = numbered_files(tmp_path)[-1]
    data = bytearray(last.read_bytes())
    data[len(data) // 2] ^= 0xFF
    last.write_bytes(data)
    log = read_log(tmp_path)
    assert log.damage.startswith(f"{last.name}: damaged at byte ")
    assert not prove_log(log, before=logs_before(log)).holds
