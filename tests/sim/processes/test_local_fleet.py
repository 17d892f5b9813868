"""The folder of a local fleet, before anything is started."""

import re
import subprocess

import pytest
from typer.testing import CliRunner

from coordinator.base.errors import InputError
from coordinator.scenario_files.scenario_reader import read_scenario
from sim.cli.run_commands import commands
from sim.processes.local_fleet import LocalFleet
from sim.processes.run_folder import RunFolder
from splinefleet import app
from tests.sim.campaigns.test_campaign import PAPER


def test_what_an_earlier_run_left_in_the_folder_does_not_mix_with_a_new_one(tmp_path):
    fleet = LocalFleet(read_scenario(PAPER), tmp_path, speed=1.0, effort=0, faults=[])
    (tmp_path / "blackbox").mkdir()
    (tmp_path / "faults").mkdir()
    stale = ("run.mcap", "run-2.mcap", "plan.json", "plan-3.json", "plan.svg", "summary.json")
    for name in (*stale, "blackbox/R9.csv", "faults/R1.txt", "notes.txt"):
        (tmp_path / name).write_text("old")
    fleet._prepare_folder()
    left = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    assert left == {"notes.txt", "scenario.json"}
    assert not (tmp_path / "faults").exists()


def test_a_run_tells_why_its_fleet_does_not_go(tmp_path, capsys):
    fleet = LocalFleet(read_scenario(PAPER), tmp_path, speed=1.0, effort=0, faults=[])
    said = {
        "warning": "R1: has no valid key",
        "hello": "R2 says hello",
        "back": "R3 is heard again",
        "timeout": "gave up",
    }
    for event, text in said.items():
        fleet._events.put((None, {"event": event, "text": text}))
    fleet._events.put((None, None))
    assert not fleet._follow()
    first, back, second = capsys.readouterr().err.splitlines()
    assert re.fullmatch(r"\d\d:\d\d:\d\d R1: has no valid key", first)
    assert back.endswith(" R3 is heard again")
    assert re.fullmatch(r"\d\d:\d\d:\d\d gave up", second)


def test_a_run_tells_where_its_coordinator_listens(tmp_path, capsys, monkeypatch):
    fleet = LocalFleet(read_scenario(PAPER), tmp_path, speed=1.0, effort=0, faults=[])
    monkeypatch.setattr(fleet, "_start_robot", lambda _: None)
    fleet._events.put((None, {"event": "listening", "text": "listening on tcp/127.0.0.1:7"}))
    fleet._events.put((None, None))
    assert not fleet._follow()
    assert capsys.readouterr().err.endswith(" listening on tcp/127.0.0.1:7\n")


def test_a_run_under_way_tells_who_is_held_by_whom(tmp_path, capsys):
    fleet = LocalFleet(read_scenario(PAPER), tmp_path, speed=1.0, effort=0, faults=[])
    fleet._coordinator = subprocess.Popen(["true"])
    text = "GO, waiting for R2: held by R1, which is not heard"
    fleet._events.put((fleet._coordinator, {"event": "waiting", "text": text}))
    fleet._events.put((fleet._coordinator, None))
    fleet._drive_on()
    assert capsys.readouterr().err.endswith(f" {text}\n")


def test_a_run_whose_coordinator_was_killed_tells_how_to_go_on(tmp_path, capsys):
    fleet = LocalFleet(read_scenario(PAPER), tmp_path, speed=2.0, effort=0, faults=[])
    fleet._coordinator = subprocess.Popen(["sleep", "60"])
    fleet._coordinator.kill()
    fleet._events.put((fleet._coordinator, None))
    fleet._drive_on()
    (ended,) = capsys.readouterr().err.splitlines()
    assert ended.endswith("the coordinator has ended: robots stand where their authority ends")
    (tmp_path / "blackbox").mkdir()
    rows = "0.0,0,0,0,0,moving,\n2.0,1.23456,-2.5,-0.5,3.0,armed,\n"
    (tmp_path / "blackbox" / "R2.csv").write_text(f"t,x,y,heading,s,phase,estimate\n{rows}")
    fleet._tell_how_to_go_on()
    how, where = capsys.readouterr().err.splitlines()
    reach = f"R2 --connect={fleet.endpoint} --fleet=paper-five"
    assert where.endswith(
        f"R2 stands at (1.23, -2.50): "
        f"`splinefleet agent {reach} --speed=2.0 --blackbox={tmp_path}/blackbox/R2.csv "
        f"--at 1.235 -2.500 -0.500`, "
        f"then `splinefleet admit {reach}`"
    )
    assert f"`splinefleet coordinator {tmp_path}/scenario.json --listen=tcp/127.0.0.1:" in how
    assert f"--resume={tmp_path}/run.mcap --log={tmp_path}/run-2.mcap --speed=2.0" in how


def test_the_run_of_another_fleet_is_replaced_by_force_only(tmp_path):
    RunFolder(tmp_path, "ours", force=False)
    (tmp_path / "plan.json").write_text('{"scenario": "theirs"}')
    with pytest.raises(InputError, match="holds a run of fleet 'theirs'; --force replaces it"):
        RunFolder(tmp_path, "ours", force=False)
    RunFolder(tmp_path, "ours", force=True)
    RunFolder(tmp_path, "theirs", force=False)


def test_a_refused_run_leaves_nothing_behind(tmp_path):
    blocked = tmp_path / "blocked.toml"
    text = (
        '[workspace]\nbounds = [0, 0, 9, 9]\n[[robots]]\nid = "A"\nradius = 0.2\nmax_speed = 1.0\n'
    )
    blocked.write_text(f'policy = "paper"\n{text}start = [1, 1]\ngoal = [8, 8]\n')
    out = tmp_path / "runs" / "one"
    done = CliRunner().invoke(commands, ["run", str(blocked), "--out", str(out)])
    assert done.exit_code == 2
    assert not (tmp_path / "runs").exists()
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "scenario.json").write_bytes(blocked.read_bytes())
    place = RunFolder(tmp_path / "kept", "blocked", force=False)
    (tmp_path / "kept" / "scenario.json").write_text("new")
    place.leave_nothing()
    assert [path.name for path in (tmp_path / "kept").iterdir()] == ["scenario.json"]
    assert (tmp_path / "kept" / "scenario.json").read_bytes() == blocked.read_bytes()


def test_a_file_in_the_place_of_the_folder_is_told(tmp_path):
    taken = tmp_path / "plan.json"
    taken.write_bytes(b"x")
    with pytest.raises(InputError, match=r"--out: .*plan\.json is not a folder"):
        RunFolder(taken, "hall", force=False)


def test_faults_that_are_drawn_and_faults_that_are_given_do_not_go_together():
    words = ["campaign", "examples/paper_five.toml", "--faults", "kill", "--fault", "none"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 2
