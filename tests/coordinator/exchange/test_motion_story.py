"""Motions for other tools, held against the robot's own arithmetic."""

import csv
import io
import sys

import pytest
from typer.testing import CliRunner

from coordinator.base.errors import PlanError
from coordinator.cli.log_commands import commands
from coordinator.cli.plan_commands import newest_plan
from coordinator.exchange.motion_story import csv_lines, story_of_log, story_of_plan
from coordinator.log.log_file import read_log
from coordinator.log.log_writer import Attachment
from coordinator.log.recorder import Recorder
from coordinator.plan import trajectory
from coordinator.plan.plan_file import to_json
from protocol import keys, phases
from protocol.codec import encode
from protocol.messages import Command
from tests.coordinator.findings.two_epochs import (
    BEGIN,
    FREEZE_1,
    GO_1,
    GO_2,
    WALL,
    RobotsOwn,
    log_of,
)
from tests.foxglove_file import messages_of


def rows_of(lines):
    return [
        (row["robot"], *(float(row[name]) for name in ("t", "x", "y", "heading", "s", "v")))
        for row in csv.DictReader(io.StringIO("\n".join(lines)))
    ]


def test_a_plans_csv_is_that_of_the_plan_command(document):
    expected = list(trajectory.csv_rows(document, 0.05))
    assert list(csv_lines(story_of_plan(document), 0.05)) == expected


def test_every_row_of_a_plan_is_where_the_robot_itself_would_be(document):
    own = {robot.id: RobotsOwn(document, robot) for robot in document.robots}
    for robot, t, *seen in rows_of(csv_lines(story_of_plan(document), 0.1)):
        assert seen == pytest.approx(own[robot].at(t), abs=3e-4)


def test_a_log_is_told_over_all_its_epochs_through_braking_and_rest(story, document, second):
    first = {robot.id: RobotsOwn(document, robot) for robot in document.robots}
    later = RobotsOwn(second, second.robots[0])
    frozen = FREEZE_1 - GO_1
    rest, slowing = first["R1"].rest(frozen)
    found = rows_of(csv_lines(story, 0.05))
    ones = [row[1:] for row in found if row[0] == "R1"]
    for t, *seen in ones:
        if t <= frozen:
            assert seen == pytest.approx(first["R1"].at(t), abs=1e-3)
        elif t < GO_2 - GO_1:
            assert t <= frozen + slowing + 1e-6
            left = frozen + slowing - t
            assert seen[3] == pytest.approx(rest - 0.5 * first["R1"].rate * left**2, abs=1e-3)
            assert seen[4] == pytest.approx(first["R1"].rate * left, abs=1e-3)
        else:
            assert seen == pytest.approx(later.at(t - (GO_2 - GO_1)), abs=1e-3)
    times = [t for t, *_ in ones]
    assert times == sorted(times)
    assert times[-1] == pytest.approx(GO_2 - GO_1 + later.line.finish)
    two = [row for row in found if row[0] == "R2"]
    assert two[-1][1] == pytest.approx(3.5 - GO_1)  # when it was last heard
    assert two[-1][6] == pytest.approx(first["R2"].line.v_at(2.5), abs=1e-3)


def test_a_log_without_plans_attached_is_told_from_the_messages(tmp_path, story, document, second):
    path = log_of(tmp_path / "bare.mcap", document, second, attached=False)
    bare = story_of_log(read_log(path))
    assert list(csv_lines(bare, 0.05)) == list(csv_lines(story, 0.05))
    assert {leg.driven.radius for leg in bare.legs} == {0.2}


def test_a_log_that_goes_on_from_another_finds_the_plans_inside_that(tmp_path, document, second):
    inner = Attachment(
        "resumed.mcap",
        "application/x",
        log_of(tmp_path / "inner.mcap", document, second).read_bytes(),
    )
    path = tmp_path / "outer.mcap"
    with Recorder(
        path, metadata={"fleet": "test"}, wall_offset_ns=WALL, attachments=[inner]
    ) as log:
        go = Command(10, 1, 1, 2, phases.GO, BEGIN, BEGIN)
        log.record(keys.command("test"), encode(go), BEGIN)
    legs = story_of_log(read_log(path)).legs
    assert {(leg.epoch, leg.driven.id) for leg in legs} >= {(1, "R1"), (2, "R1")}


def test_the_command_writes_both_from_both(tmp_path, document, second):
    log_of(tmp_path / "run.mcap", document, second)
    (tmp_path / "plan.json").write_bytes(to_json(document))
    for source in ("run.mcap", "plan.json"):
        for kind, name in (("csv", "a.csv"), ("foxglove", "a.mcap")):
            arguments = ["export", source, "--to", kind, "-o", name]
            arguments[1], arguments[5] = str(tmp_path / source), str(tmp_path / name)
            assert CliRunner().invoke(commands, arguments).exit_code == 0
        assert (tmp_path / "a.csv").read_text().startswith("robot,t,x,y,heading,s,v\n")
        assert messages_of((tmp_path / "a.mcap").read_bytes())


def test_only_what_is_for_viewers_loads_their_kit(tmp_path, document, monkeypatch):
    monkeypatch.setitem(sys.modules, "foxglove", None)
    for module in ("foxglove", "point_clouds", "foxglove_scene"):
        monkeypatch.delitem(sys.modules, f"coordinator.exchange.{module}", raising=False)
    (tmp_path / "plan.json").write_bytes(to_json(document))
    for kind, name in (("csv", "a.csv"), ("vda5050", "orders"), ("foxglove", "a.mcap")):
        words = ["export", str(tmp_path / "plan.json"), "--to", kind, "-o", str(tmp_path / name)]
        done = CliRunner().invoke(commands, words)
        assert (done.exit_code == 0) == (kind != "foxglove"), done.output


def test_a_log_from_beside_is_plotted_as_its_messages_have_it(tmp_path, document, second, capsys):
    path = log_of(tmp_path / "beside.mcap", document, second, attached=False)
    plan = newest_plan(path, "to draw")
    assert [robot.id for robot in plan.robots] == [robot.id for robot in second.robots]
    assert "epoch 2: the plan is put together from messages" in capsys.readouterr().err
    assert newest_plan(log_of(tmp_path / "run.mcap", document, second), "to draw") == second


def test_a_log_in_which_nobody_was_sent_off_has_nothing_to_export(tmp_path):
    path = tmp_path / "run.mcap"
    with Recorder(path, metadata={"fleet": "test"}, wall_offset_ns=WALL) as log:
        log.record(keys.command("test"), encode(Command(9, 1, 1, 1, phases.HOLD, 0, 0)), BEGIN)
    arguments = ["export", str(path), "--to", "csv", "-o", str(tmp_path / "a.csv")]
    with pytest.raises(PlanError, match="no robot was sent on its way"):
        commands(arguments, standalone_mode=False)
