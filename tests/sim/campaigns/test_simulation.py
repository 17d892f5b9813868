"""The simulate command: the files of a run, made in virtual time, the same for the same seed."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from coordinator.base.errors import InputError, PlanError
from coordinator.findings.info import summarise
from coordinator.log.blackbox_attachments import unpacked
from coordinator.log.log_file import read_log
from coordinator.service.replay import check_log
from robot_agent.blackbox import HEADER
from sim.campaigns import simulation
from sim.cli.run_commands import commands
from sim.judging.blackbox import blackbox_text, read_blackbox
from tests.sim.world.test_virtual_fleet import ROBOTS, SCENARIO

FAULTS = ("kill:R1@3", "skid:R3@4:0.01", "coordinator-restart@5:2")


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenario") / "three.toml"
    path.write_bytes(SCENARIO + b"[link]\ndelay = 0.02\nloss = 0.05\n")
    return path


def simulate(scenario, folder, *options):
    words = ["simulate", str(scenario), "--out", str(folder), "--effort", "4", *options]
    return CliRunner().invoke(commands, words)


@pytest.fixture(scope="module")
def sound(scenario, tmp_path_factory):
    """The folder of a run in which nothing goes wrong, and what the command answered."""
    folder = tmp_path_factory.mktemp("sound")
    return folder, simulate(scenario, folder, "--json")


def files_in(folder):
    found = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in found}


def test_a_simulation_leaves_the_files_of_a_run_and_succeeds(sound):
    folder, done = sound
    assert (done.exit_code, done.stderr) == (0, "")
    boxes = {f"blackbox/{robot}.csv" for robot in ROBOTS}
    named = {"scenario.json", "plan.json", "plan.svg", "plan.png", "run.mcap", "summary.json"}
    assert set(files_in(folder)) == named | boxes
    summary = json.loads(done.stdout)
    assert summary == json.loads((folder / "summary.json").read_bytes())
    assert summary["succeeded"]
    assert summary["judge"]["collisions"] == 0
    assert [robot["arrived"] for robot in summary["judge"]["robots"]] == [True] * 3
    assert summary["info"]["positions_on_wire"] == 0


def test_the_log_is_run_again_byte_for_byte_and_holds_the_black_boxes(sound):
    folder, _ = sound
    log = read_log(folder / "run.mcap")
    assert (check_log(log).difference, check_log(log).note) == ("", "")
    assert summarise(log)["robots"].keys() == set(ROBOTS)
    texts = {robot: (folder / "blackbox" / f"{robot}.csv").read_text() for robot in ROBOTS}
    assert unpacked(log.attachments) == texts


def test_a_black_box_has_a_row_per_tick_of_a_robot_that_moves(sound):
    folder, _ = sound
    text = (folder / "blackbox" / "R2.csv").read_text()
    assert text.startswith(HEADER)
    box = read_blackbox(folder / "blackbox" / "R2.csv")
    moving = np.array([phase == "moving" for phase in box.phases])
    assert np.diff(box.t[moving]).max() < 0.011
    assert box.clock_error() < 0.05
    assert box.phases[-1] == "done"


def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(
    scenario, tmp_path, monkeypatch
):
    folders = [tmp_path / name for name in ("one", "two", "three")]
    for folder, seed in zip(folders, ("3", "3", "4"), strict=True):
        folder.mkdir()
        monkeypatch.chdir(folder)
        faults = [word for text in FAULTS for word in ("--fault", text)]
        simulate(scenario, "run", "--seed", seed, *faults)
    one, two, three = map(files_in, folders)
    assert {"run/run-2.mcap", "run/summary.json", "run/blackbox/R1.csv"} < set(one)
    assert one == two
    assert one["run/plan.json"] == three["run/plan.json"]
    assert one["run/blackbox/R2.csv"] != three["run/blackbox/R2.csv"]


def test_a_robot_that_is_killed_does_not_arrive_but_the_others_do(scenario, tmp_path):
    done = simulate(scenario, tmp_path / "run", "--fault", "kill:R1@3")
    assert done.exit_code == 1
    struck, lost, *_ = done.stderr.splitlines()
    assert struck == "3.00 s kill:R1@3"
    assert lost.endswith(" s R1 has lost its link")
    summary = json.loads((tmp_path / "run" / "summary.json").read_bytes())
    robots = {robot["id"]: robot for robot in summary["judge"]["robots"]}
    assert [name for name in ROBOTS if robots[name]["arrived"]] == ["R2", "R3"]
    assert robots["R1"]["fault"].startswith("recording ends at 3.")
    assert summary["judge"]["collisions"] == 0
    assert "R1" in {one["by"] for one in summary["held"]}


def test_others_are_sent_around_a_dead_robot_in_the_same_epoch_and_people_are_told(
    scenario, tmp_path
):
    done = simulate(scenario, tmp_path, "--fault", "kill:R1@5", "--box-rate", "10")
    assert " s others go around R1" in done.stderr
    summary = json.loads((tmp_path / "summary.json").read_bytes())
    assert summary["freezes"] == 0
    assert len(summary["info"]["epochs"]) == 1
    assert not list(tmp_path.glob("plan-*.json"))


def test_a_box_rate_thins_the_boxes_but_keeps_every_change_of_phase(sound, scenario, tmp_path):
    done = simulate(scenario, tmp_path, "--box-rate", "4")
    assert done.exit_code == 0
    for robot in ROBOTS:
        thin = read_blackbox(tmp_path / "blackbox" / f"{robot}.csv")
        full = read_blackbox(sound[0] / "blackbox" / f"{robot}.csv")
        assert len(thin.t) < 1.1 * 4 * (full.t[-1] - full.t[0]) + 5
        assert list(dict.fromkeys(thin.phases)) == list(dict.fromkeys(full.phases))
        assert np.allclose(thin.places, full.at(thin.t))


def test_an_invalid_fault_is_answered_in_one_line_and_leaves_nothing(scenario, tmp_path):
    done = simulate(scenario, tmp_path / "run", "--fault", "kill:R9@3")
    assert isinstance(done.exception, InputError)  # This ends with exit code 2.
    assert done.exception.problems == (
        "--fault kill:R9@3: there is no robot R9; the robots are R1, R2, R3",
    )
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("rate", ["0.5", "200", "nan"])
def test_a_box_rate_is_within_what_the_ticks_allow(scenario, tmp_path, rate):
    assert simulate(scenario, tmp_path / "run", "--box-rate", rate).exit_code == 2
    assert not (tmp_path / "run").exists()


def test_what_has_no_plan_or_is_for_study_leaves_nothing(scenario, tmp_path):
    study, walled = tmp_path / "study.toml", tmp_path / "walled.toml"
    text = scenario.read_text()
    study.write_text(f'policy = "paper"\n{text}')
    walled.write_text(
        text.replace("[[[3.6, 3.6]", "[[[2.8, 0], [3, 0], [3, 5], [2.8, 5]], [[3.6, 3.6]")
    )
    assert "is for study" in str(simulate(study, tmp_path / "runs" / "one").exception)
    assert isinstance(simulate(walled, tmp_path / "runs" / "one").exception, PlanError)
    assert not (tmp_path / "runs").exists()


def test_the_run_of_another_fleet_is_replaced_by_force_only(scenario, tmp_path):
    (tmp_path / "plan.json").write_text('{"scenario": "theirs"}')
    assert "--force replaces it" in str(simulate(scenario, tmp_path).exception)
    assert simulate(scenario, tmp_path, "--force", "--box-rate", "20").exit_code == 0


def test_an_interrupted_simulation_closes_its_log_and_keeps_the_boxes(
    scenario, tmp_path, monkeypatch
):
    def interrupt(world, _document, _watch):
        world.run(5.0)
        raise KeyboardInterrupt

    monkeypatch.setattr(simulation, "run_world", interrupt)
    done = simulate(scenario, tmp_path / "run")
    assert done.exit_code == 130
    assert "interrupted; " in done.stderr
    assert read_log(tmp_path / "run" / "run.mcap").complete
    assert len(read_blackbox(tmp_path / "run" / "blackbox" / "R1.csv").t) > 100
    assert not (tmp_path / "run" / "summary.json").exists()


def test_a_fault_that_comes_too_late_is_told(scenario, tmp_path):
    done = simulate(scenario, tmp_path, "--fault", "hang:R1@500:1", "--box-rate", "20")
    assert done.exit_code == 0
    assert done.stderr.splitlines() == ["hang:R1@500:1: the run had ended before"]


def test_a_fleet_that_does_not_end_is_given_up(scenario, tmp_path, monkeypatch):
    monkeypatch.setattr(simulation, "run_world", lambda *_: (False, 0))
    done = simulate(scenario, tmp_path)
    assert done.exit_code != 0
    assert "given up: the fleet does not come to its end" in done.stderr


def test_the_rows_are_written_as_a_robot_writes_them():
    rows = [(0.0, 1.0, -2.5, 3.1415926, 0.25, "moving", 0.0001), (1.0,) * 5 + ("done", None)]
    assert blackbox_text(rows).decode("ascii") == (
        f"{HEADER}"
        "0.000000,1.000000,-2.500000,3.141593,0.250000,moving,0.000100\n"
        "1.000000,1.000000,1.000000,1.000000,1.000000,done,\n"
    )
