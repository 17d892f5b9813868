"""Logs gone on with from a moment: what was stays as it was, what comes is a run like any other."""

import json
import math

import numpy as np
import pytest
from msgspec.structs import replace
from typer.testing import CliRunner

from coordinator.base.errors import InputError
from coordinator.findings.info import summarise
from coordinator.fleet.log_records import LINK_GONE, LINK_UP
from coordinator.log.blackbox_attachments import packed
from coordinator.log.log_file import read_log
from coordinator.log.log_writer import Attachment
from coordinator.log.recorder import Recorder
from coordinator.log.recover import with_files
from coordinator.plan.wire import drive
from coordinator.scenario_files.scenario_reader import parse_scenario
from coordinator.service.replay import check_log
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import Command, Hello, Rest
from protocol.phases import GO, OVER
from protocol.timing import SECOND
from robot_agent.blackbox import HEADER
from sim.campaigns.campaign import run_seed
from sim.judging.blackbox import read_blackbox
from sim.judging.judge import judge
from sim.what_if.continuation import place_of
from sim.what_if.history import read_history
from sim.what_if.shell import carry_on
from sim.world.fault_script import read_faults
from sim.world.run_logs import RunLogs
from sim.world.virtual_fleet import World
from splinefleet import app
from tests.sim.world.test_changed_floor import RACK, a_hall, on_another_floor
from tests.sim.world.test_run_logs import FAULTS, GOOD_LINK, ROBOTS, SEED, logs_of
from tests.sim.world.test_virtual_fleet import SCENARIO, good_link

MOMENTS = (0.0, 2.9, 3.6, 5.0, 8.0, 13.0, 16.0)
"""Under way, while others wait for a dead robot, and before and after the coordinator's return."""


@pytest.fixture(scope="module")
def scenario():
    return parse_scenario(SCENARIO, "three.toml")


def run_into(folder, scenario, *faults):
    run_seed(scenario, SEED, GOOD_LINK, read_faults(faults, ROBOTS), folder)
    return logs_of(folder)[-1]


@pytest.fixture(scope="module")
def quiet(scenario, tmp_path_factory):
    """The log of a run in which nothing goes wrong."""
    return run_into(tmp_path_factory.mktemp("quiet"), scenario)


@pytest.fixture(scope="module")
def stormy(scenario, tmp_path_factory):
    """The last log of a run in which much goes wrong."""
    return run_into(tmp_path_factory.mktemp("stormy"), scenario, *FAULTS)


def phases_of(log):
    found = [decode("command", r.payload) for r in log.records if r.key.endswith("/command")]
    return [(m.epoch, m.phase) for m in found if isinstance(m, Command)]


def test_a_run_that_goes_on_without_faults_goes_as_it_went(quiet, tmp_path):
    name, arrived = carry_on(quiet, 5.0, tmp_path / "new", [], 0)
    assert (name, arrived) == ("three", True)
    before, after = summarise(read_log(quiet)), summarise(read_log(tmp_path / "new" / "run.mcap"))
    for robot in ROBOTS:
        assert after["robots"][robot]["arrived"] == pytest.approx(
            before["robots"][robot]["arrived"], abs=0.5
        )
    assert len(after["epochs"]) == 1
    assert after["lost_messages"] == 0
    verdict = judge(tmp_path / "new")
    assert verdict.collisions == 0
    assert all(robot.arrived and robot.tracking_error < 0.01 for robot in verdict.robots)
    assert all(0.0 < robot.clock_error < 0.01 for robot in verdict.robots)


def test_until_the_moment_every_byte_is_that_of_the_log_and_then_the_faults_come(quiet, tmp_path):
    folder = tmp_path / "new"
    carry_on(quiet, 5.0, folder, ["kill:R1@6"], 0)
    old, new = read_log(quiet), read_log(folder / "run.mcap")
    history = read_history(quiet, 5.0)
    kept = [r for r in old.records if r.log_ns <= history.until_ns]
    fields = [(r.key, r.payload, r.log_ns, r.publish_ns) for r in kept]
    assert [(r.key, r.payload, r.log_ns, r.publish_ns) for r in new.records[: len(kept)]] == fields
    assert new.records[len(kept)].log_ns > history.until_ns
    assert new.metadata["what_if"] == "5"
    assert {phase for _, phase in phases_of(new)} == {GO, OVER}
    gone = (keys.alive("three", "R1"), LINK_GONE)
    lost = next(r.log_ns for r in new.records if (r.key, r.payload) == gone)
    assert lost > history.began_ns + 6 * SECOND
    assert check_log(new).difference == ""
    told = {robot.id: robot for robot in judge(folder).robots}
    assert not told["R1"].arrived
    assert told["R2"].arrived
    assert told["R3"].arrived


@pytest.mark.parametrize("moment", MOMENTS)
def test_a_stormy_run_is_gone_on_with_from_any_moment(stormy, tmp_path, moment):
    folder = tmp_path / "new"
    carry_on(stormy, moment, folder, [f"coordinator-restart@{moment + 1.5}:2"], 1)
    logs = [read_log(path) for path in logs_of(folder)]
    assert len(logs) >= 2
    for log in logs:
        assert check_log(log).difference == ""
    verdict = judge(folder)
    assert verdict.collisions == 0
    dead = {"R1"} if moment > 3.5 else set()
    assert {robot.id for robot in verdict.robots if not robot.arrived} == dead


def test_robots_go_on_under_a_coordinator_that_had_resumed_before_the_moment(quiet, tmp_path):
    """They hear the time of the one that led them, until the other one does."""
    carry_on(quiet, 0.0, tmp_path / "first", ["coordinator-restart@3:2"], 3)
    assert (tmp_path / "first" / "blackbox" / "R1.csv").is_file()
    name, arrived = carry_on(tmp_path / "first" / "run-2.mcap", 7.0, tmp_path / "new", [], 0)
    assert (name, arrived) == ("three", True)
    told = judge(tmp_path / "new")
    assert all(robot.arrived and robot.tracking_error < 0.01 for robot in told.robots)


def test_black_boxes_say_where_everybody_was(quiet, tmp_path):
    first = tmp_path / "first"
    carry_on(quiet, 0.0, first, [], 3)
    data = (first / "run.mcap").read_bytes()
    box = (first / "blackbox" / "R2.csv").read_text()
    shifted = [line.split(",") for line in box.splitlines()[1:]]
    for row in shifted:
        row[2] = f"{float(row[2]) + 0.004:.6f}"
    text = HEADER + "".join(",".join(row) + "\n" for row in shifted)
    (tmp_path / "boxed").mkdir()
    log = tmp_path / "boxed" / "run.mcap"
    log.write_bytes(with_files(data, "log", [packed("R2", text.encode())]))
    carry_on(log, 5.0, tmp_path / "new", [], 0)
    told, true = (
        read_blackbox(tmp_path / "new" / "blackbox" / "R2.csv"),
        read_blackbox(first / "blackbox" / "R2.csv"),
    )
    past, aside = told.t <= 5.0, np.array([0.0, 0.004])
    assert np.allclose(told.places[past], true.at(told.t[past]) + aside, atol=1e-4)
    step = np.hypot(*np.diff(told.places, axis=0).T)
    assert step.max() < 0.012
    assert judge(tmp_path / "new").collisions == 0


def test_a_robot_that_says_where_it_rests_stands_there(quiet):
    history = read_history(quiet, 5.0)
    ride = {one.id: one for one in drive(history.mission.document)}["R1"]
    x, y, heading = place_of(ride, Rest(1.0, 1, off_mm=20, turn_mrad=-100))
    on_path = ride.curve.at_arc([1.0])[0]
    ahead = ride.curve.at_arc([1.001])[0] - on_path
    along = math.atan2(ahead[1], ahead[0])
    assert (x, y) == pytest.approx(
        (on_path[0] - 0.02 * math.sin(along), on_path[1] + 0.02 * math.cos(along)), abs=1e-5
    )
    assert heading == pytest.approx(along - 0.1, abs=1e-3)


def test_a_robot_that_was_started_again_is_another_one_at_another_place(scenario, quiet):
    document = read_history(quiet, 5.0).mission.document
    world = World(scenario, document, good_link())
    world.go_on(6.0)
    world.renew("R1", 77, (1.0, 1.5, 0.5))
    world.go_on(1.0)
    robot = world.robots["R1"]
    assert robot.service.boot == 77
    assert robot.body.true_pose() == (1.0, 1.5, 0.5)
    assert world.fleet.members["R1"].lost


def test_a_robot_that_came_back_with_another_boot_is_known_by_both(quiet, tmp_path):
    log = read_log(quiet)
    path = tmp_path / "again.mcap"
    until = read_history(quiet, 5.0).until_ns
    kept = [r for r in log.records if r.log_ns <= until]
    with Recorder(path, metadata=log.metadata, wall_offset_ns=0) as recorder:
        for name, data in log.attachments.items():
            recorder.attach(name, "application/json", data)
        for record in kept:
            recorder.record(record.key, record.payload, record.log_ns)
        hello = Hello(2, 77, place=(1000, 2000, 500))
        recorder.record(keys.hello("three", "R1"), encode(hello), until)
    known = read_history(path, 5.0).robots["R1"]
    assert [hello.boot for _, hello in known.boots][-1] == 77
    assert known.sequence == 0


@pytest.mark.parametrize(
    ("until", "faults", "problem"),
    [
        (500.0, [], "after the end of the log"),
        (5.0, ["kill:R1@3"], "is before --until 5 s"),
        (5.0, ["kill:R9@7"], "no robot R9"),
        (5.0, ["nonsense"], "is not one of"),
    ],
)
def test_what_makes_no_sense_is_told_in_a_line(quiet, tmp_path, until, faults, problem):
    with pytest.raises(InputError, match=problem):
        carry_on(quiet, until, tmp_path / "new", faults, 0)


def test_a_log_that_is_over_foreign_or_in_its_own_folder_is_refused(quiet, tmp_path):
    log = read_log(quiet)
    end = (log.records[-1].log_ns - read_history(quiet, 1.0).began_ns) / SECOND
    with pytest.raises(InputError, match="mission had ended"):
        carry_on(quiet, math.floor(end * 100) / 100, tmp_path / "new", [], 0)
    with pytest.raises(InputError, match="is the folder of the log"):
        carry_on(quiet, 5.0, quiet.parent, [], 0)
    beside = tmp_path / "beside.mcap"
    with Recorder(beside, metadata={"fleet": "f", "passive": "yes"}, wall_offset_ns=0) as recorder:
        recorder.record("x", b"", 1)
    with pytest.raises(InputError, match="a listener's recording"):
        read_history(beside, 1.0)
    early = tmp_path / "early.mcap"
    with Recorder(early, metadata={"fleet": "f"}, wall_offset_ns=0) as recorder:
        recorder.record("x", b"", 1)
    with pytest.raises(InputError, match="no robot was ever sent"):
        read_history(early, 1.0)


def test_a_moment_before_everything_in_a_log_is_told_in_a_line(quiet, monkeypatch):
    log = read_log(quiet)
    late = [replace(record, log_ns=record.log_ns + 20 * SECOND) for record in log.records]
    changed = replace(log, records=late)
    monkeypatch.setattr("sim.what_if.history.read_log", lambda _path: changed)
    with pytest.raises(InputError, match="--until: 5 s is before the log's first message"):
        read_history(quiet, 5.0)


def test_a_stranger_in_the_log_is_no_robot_of_what_comes(quiet, tmp_path):
    log, place = read_log(quiet), tmp_path / "with.mcap"
    metadata = {name: text for name, text in log.metadata.items() if name != "wall_offset_ns"}
    files = [Attachment(n, "application/json", d) for n, d in log.attachments.items()]
    offset_ns = int(log.metadata["wall_offset_ns"])
    with Recorder(place, metadata=metadata, wall_offset_ns=offset_ns, attachments=files) as copy:
        for record in log.records:
            if "/report/" in record.key:
                copy.record(keys.alive("three", "R9"), LINK_UP, record.log_ns)
            copy.record(record.key, record.payload, record.log_ns)
    assert "R9" not in read_history(place, 5.0).robots
    assert carry_on(place, 5.0, tmp_path / "new", [], 0) == ("three", True)


def test_plans_of_later_epochs_lie_in_the_folder_as_in_the_log(tmp_path):
    (tmp_path / "old").mkdir()
    logs = RunLogs(tmp_path / "old")
    on_another_floor(a_hall(), logs, (RACK,))
    carry_on(logs.paths[-1], 9.0, tmp_path / "new", [], 0)
    kept = read_log(logs_of(tmp_path / "new")[-1]).attachments["plan-2.json"]
    assert (tmp_path / "new" / "plan-2.json").read_bytes() == kept


def test_the_command_leaves_a_run_and_tells_of_it(quiet, tmp_path):
    out = tmp_path / "new"
    words = ["replay", str(quiet), "--until", "5", "--fault", "stall:R2@6:1", "--out", str(out)]
    done = CliRunner().invoke(app, [*words, "--json"])
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert told["succeeded"]
    assert told["judge"]["collisions"] == 0
    assert {path.name for path in out.iterdir()} >= {
        *("run.mcap", "plan.json", "scenario.json", "summary.json", "plan.svg", "blackbox"),
    }
    assert read_log(out / "run.mcap").attachments.keys() >= {"blackbox/R1.csv.gz"}
    both = CliRunner().invoke(app, ["replay", str(quiet), "--until", "5", "--check"])
    assert both.exit_code == 2
