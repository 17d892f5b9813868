"""Files of every released version are read as their own version reads them; newer ones, refused."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from coordinator.base.errors import InputError
from coordinator.log.log_file import log_from_bytes, read_log
from coordinator.log.recorder import Recorder
from coordinator.log.versions import ours
from coordinator.plan.plan_file import from_json
from splinefleet import app
from tests.golden.make_run import KEPT, RUNS, facts

VERSIONS = sorted(folder.name for folder in RUNS.iterdir())


def run(*command):
    done = CliRunner().invoke(app, [str(word) for word in command])
    assert done.exit_code == 0, done.output
    return done.output


def log_of(tmp_path, **metadata):
    """Return the path of a log that states these versions."""
    path = tmp_path / "run.mcap"
    recorder = Recorder(path, metadata={"fleet": "f", **ours(), **metadata}, wall_offset_ns=0)
    recorder.close()
    return path


def test_the_version_of_today_has_a_run():
    assert ours()["splinefleet"] in VERSIONS


@pytest.mark.parametrize("version", VERSIONS)
def test_info_verify_and_judge_say_of_a_run_what_they_said_when_it_was_made(version):
    kept = RUNS / version
    assert all((kept / part).exists() for part in KEPT)
    assert facts(kept) == json.loads((kept / "facts.json").read_text())


@pytest.mark.parametrize("version", VERSIONS)
def test_pictures_motions_and_plans_of_a_run_can_be_had(version, tmp_path):
    log, plan = RUNS / version / "run.mcap", RUNS / version / "plan.json"
    picture, motions = tmp_path / "run.html", tmp_path / "motions.csv"
    run("plot", log, "-o", picture)
    run("export", log, "--to", "csv", "-o", motions)
    assert all(name in picture.read_text() for name in ("R1", "R2", "R3", "parts"))
    assert {line.split(",")[0] for line in motions.read_text().splitlines()[1:]} >= {"R1", "R3"}
    assert "proof holds" in run("verify", plan)
    assert f"splinefleet {version}, protocol " in run("info", log)


def test_a_log_of_a_later_protocol_is_refused_with_both_versions(tmp_path):
    path = log_of(tmp_path, protocol="9", splinefleet="7.1.0")
    for command in ("info", "verify", "replay"):
        assert isinstance(CliRunner().invoke(app, [command, str(path)]).exception, InputError)
    with pytest.raises(InputError) as refused:
        read_log(path)
    (problem,) = refused.value.problems
    assert problem.startswith(f"{path}: holds messages of protocol 9, written by splinefleet 7.1.0")
    assert f"this is splinefleet {ours()['splinefleet']}" in problem


@pytest.mark.parametrize("stated", ["1", "0003", "-1", "three", "", "9" * 20])
def test_a_log_whose_protocol_is_older_or_makes_no_sense_is_read(stated, tmp_path):
    path = log_of(tmp_path, protocol=stated)
    assert log_from_bytes(Path(path).read_bytes(), "log").metadata["protocol"] == stated


def test_a_plan_of_a_later_format_is_said_to_be_one():
    plan = json.loads((RUNS / VERSIONS[-1] / "plan.json").read_text())
    told = {"splinefleet.plan/2": "; a later splinefleet wrote it", "other/1": ""}
    for stated, later in told.items():
        with pytest.raises(InputError) as refused:
            from_json(json.dumps({**plan, "format": stated}).encode())
        problem = f"plan: format is '{stated}', must be 'splinefleet.plan/1'{later}"
        assert refused.value.problems == (problem,)
