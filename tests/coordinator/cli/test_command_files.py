"""The files that commands are given and asked for: of the right kind, in a folder that is there."""

import fcntl
import json
import shutil
from pathlib import Path

import pytest
import typer
from msgspec.structs import replace
from typer.testing import CliRunner

from coordinator.base.errors import InputError
from coordinator.base.own_file import open_own
from coordinator.log.log_writer import Attachment
from coordinator.log.recorder import Recorder
from coordinator.plan.plan_file import to_json
from coordinator.planning.planner import plan_scenario
from coordinator.scenario_files.scenario_reader import scenario_to_json
from coordinator.scenario_files.toml_writer import scenario_to_toml
from protocol.codec import encode
from protocol.messages import Report
from protocol.phases import MOVING
from splinefleet import app
from tests.scenarios import a_robot, a_scenario

HALL = a_scenario([a_robot("R1", (1.0, 1.0), (9.0, 7.0))])


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("files")
    (folder / "hall.toml").write_bytes(scenario_to_toml(HALL))
    (folder / "hall.json").write_bytes(scenario_to_json(HALL))
    (folder / "broken.toml").write_text("a = 1\n= 2")
    document = plan_scenario(HALL, effort=0)
    (folder / "plan.json").write_bytes(to_json(document))
    scenario = Attachment("scenario.json", "application/json", scenario_to_json(HALL))
    Recorder(folder / "run.mcap", metadata={}, wall_offset_ns=0, attachments=[scenario]).close()
    return folder


@pytest.fixture
def folder(made, tmp_path, monkeypatch):
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def problem_of(command):
    """The one line that a command ends with, and no file that it has made."""
    with pytest.raises((InputError, typer.TyperException)) as caught:
        app(command.split(), standalone_mode=False)
    error = caught.value
    (line,) = getattr(error, "problems", None) or error.format_message().splitlines()
    return line


MAKES = "`splinefleet plan hall.toml -o hall.json` makes one"
TELLS = "`splinefleet info run.mcap` tells what happened"
PROVES = "`splinefleet verify plan.json` proves it again, `plot` draws it"


@pytest.mark.parametrize(
    ("command", "line"),
    [
        ("verify hall.toml", f"hall.toml is a scenario, not a plan; {MAKES}"),
        ("plot hall.toml -o a.svg", f"hall.toml is a scenario, not a plan; {MAKES}"),
        (
            "verify hall.json",
            "hall.json is a scenario, not a plan; "
            "`splinefleet plan hall.json -o hall-plan.json` makes one",
        ),
        ("verify run.mcap", "run.mcap: holds no plan that could be proven"),
        ("plan plan.json", f"plan.json is a plan, not a scenario; {PROVES}"),
        ("plan run.mcap", f"run.mcap is a log, not a scenario; {TELLS}"),
        ("verify plan.json --scenario plan.json", f"plan.json is a plan, not a scenario; {PROVES}"),
        (
            "info hall.toml",
            "hall.toml is a scenario, not a log; `splinefleet run hall.toml` records one",
        ),
        ("replay plan.json --check", f"plan.json is a plan, not a log; {PROVES}"),
        ("replay plan.json", f"plan.json is a plan, not a log; {PROVES}"),
        ("recover plan.json", f"plan.json is a plan, not a log; {PROVES}"),
        (
            "export hall.toml --to csv -o a.csv",
            "hall.toml is a scenario, not a log; `splinefleet run hall.toml` records one",
        ),
    ],
)
@pytest.mark.usefixtures("folder")
def test_a_file_of_another_kind_is_named_with_what_to_do_with_it(command, line):
    assert problem_of(command) == line


@pytest.mark.usefixtures("folder")
def test_a_file_of_no_kind_is_still_told_with_its_fault():
    assert problem_of("verify broken.toml").startswith("broken.toml: JSON is malformed")
    assert problem_of("info broken.toml") == "broken.toml: is not an MCAP file"


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("plan hall.toml -o plan.toml", "'--output': plan.toml does not end in .json"),
        ("plan hall.toml -o plan", "'--output': plan does not end in .json"),
        ("plan hall.toml --csv a.txt", "'--csv': a.txt does not end in .csv"),
        ("plan hall.toml -o new/a.json", "'--output': new/a.json: there is no folder new"),
        ("plan hall.toml --csv new/a.csv", "'--csv': new/a.csv: there is no folder new"),
        ("plan hall.toml -o plan.json/a.json", "there is no folder plan.json"),
        ("plot plan.json -o new/a.svg", "'--output': new/a.svg: there is no folder new"),
        ("recover run.mcap -o new/a.mcap", "'--output': new/a.mcap: there is no folder new"),
        ("recover run.mcap -o whole.json", "'--output': whole.json does not end in .mcap"),
        ("export plan.json --to csv -o new/a.csv", "'--output': new/a.csv: there is no folder new"),
        ("export plan.json --to csv -o -", "'--output': - does not end in .csv"),
        ("export plan.json --to foxglove -o a.csv", "'--output': a.csv does not end in .mcap"),
        ("export run.mcap --to foxglove -o run.mcap", "run.mcap is the source itself"),
        ("plot plan.json -o a.pdf", "must end in .svg or .png, a page in .html, not in '.pdf'"),
        ("plot run.mcap -o a.svg", "run.mcap: holds no plan, so there is nothing to draw"),
        ("replay run.mcap --fault kill:R1@3", "has no effect without --until"),
        ("replay run.mcap --out what-if", "has no effect without --until"),
        (
            "coordinator hall.toml --resume run.mcap --log run.mcap",
            "--log: run.mcap is the log to resume from; name another file",
        ),
        (
            "coordinator hall.toml --resume gone.mcap",
            "--resume: gone.mcap: No such file or directory",
        ),
        ("coordinator hall.toml --resume hall.toml", "--resume: hall.toml is a scenario"),
        (
            "coordinator hall.toml --resume .",
            "--resume: .: has no log in files run-0001.mcap",
        ),
        ("coordinator hall.toml --log new/run.mcap", "'--log': new/run.mcap: there is no folder"),
        ("coordinator hall.toml --plan-out p.txt", "'--plan-out': p.txt does not end in .json"),
    ],
)
def test_a_file_that_has_no_place_or_another_suffix_is_refused_before_any_work(
    folder, command, said
):
    before = sorted(folder.rglob("*"))
    assert said in problem_of(command)
    assert sorted(folder.rglob("*")) == before


@pytest.mark.usefixtures("folder")
def test_a_log_that_a_coordinator_is_writing_is_not_resumed():
    with Path("run-0001.mcap").open("wb") as log, open_own(Path("day.mcap"), replace=True):
        fcntl.flock(log.fileno(), fcntl.LOCK_EX)
        for resume, file in ((".", "run-0001.mcap"), ("day.mcap", "day.mcap")):
            problem = problem_of(f"coordinator hall.toml --resume {resume} --log b.mcap")
            assert f"--resume: {file}: a coordinator is writing it; end that one" in problem


def test_a_plan_is_written_where_it_may_be(folder):
    result = CliRunner().invoke(app, ["plan", "hall.toml", "-o", "A.JSON", "--effort", "0"])
    assert result.exit_code == 0
    assert (folder / "A.JSON").exists()
    assert "wrote A.JSON" in result.stderr


@pytest.mark.parametrize("command", ["plot run.mcap -o a.svg", "export run.mcap --to vda5050 -o o"])
def test_of_a_log_with_several_epochs_the_last_ones_plan_is_taken_and_that_is_said(folder, command):
    plan = plan_scenario(HALL, effort=0)
    plans = [
        Attachment(f"plan-{n}.json", "application/json", to_json(replace(plan, epoch=n)))
        for n in (1, 2, 10)
    ]
    Recorder(folder / "run.mcap", metadata={}, wall_offset_ns=0, attachments=plans).close()
    result = CliRunner().invoke(app, command.split())
    assert result.exit_code == 0
    assert "run.mcap: using the plan of epoch 10, the last of 3" in result.stderr
    if command.startswith("plot"):
        assert f"{HALL.name}, epoch 10" in (folder / "a.svg").read_text()


def test_a_stray_file_beside_a_log_is_told_of_and_one_that_was_asked_for_is_an_error(folder):
    key, report = "splinefleet/f/report/R1", encode(Report(9, 1, 1, MOVING))
    with Recorder(folder / "r.mcap", metadata={"fleet": "f"}, wall_offset_ns=0) as log:
        log.record(key, report, 0)
    (folder / "R1.csv").write_text("not a black box")
    result = CliRunner().invoke(app, ["info", "r.mcap", "--json"])
    assert result.exit_code == 0
    assert json.loads(result.stdout)["messages"] == 1
    assert "R1.csv: line 1: the columns are not" in problem_of("info r.mcap --blackbox .")
    assert "'nowhere' does not exist" in problem_of("info r.mcap --blackbox nowhere")


def without(plan, *names):
    """A plan file that says nothing of its floor or of its robots' limits."""
    fields = json.loads(plan)
    if "clearance" in names:
        fields["workspace"] = None
    for robot in fields["robots"] if "limits" in names else ():
        robot["limits"] = None
    return json.dumps(fields)


@pytest.mark.parametrize(
    ("unproven", "options", "exit_code"),
    [
        ([], [], 0),
        (["clearance"], [], 1),
        (["clearance"], ["--allow-unproven", "limits"], 1),
        (["clearance"], ["--allow-unproven", "clearance"], 0),
        (["clearance"], ["--scenario", "hall.toml"], 0),
        (["limits"], [], 1),
        (["clearance", "limits"], ["--allow-unproven", "clearance"], 1),
        (
            ["clearance", "limits"],
            ["--allow-unproven", "clearance", "--allow-unproven", "limits"],
            0,
        ),
        ([], ["--allow-unproven", "everything"], 2),
    ],
)
def test_what_a_plan_file_leaves_unproven_is_refused_unless_it_is_allowed_by_name(
    folder, unproven, options, exit_code
):
    (folder / "plan.json").write_text(without((folder / "plan.json").read_bytes(), *unproven))
    result = CliRunner().invoke(app, ["verify", "plan.json", *options])
    assert result.exit_code == exit_code
    if exit_code == 1:
        (name,) = {*unproven} - {*options}
        assert f"plan.json: {name} is not proven" in result.output
