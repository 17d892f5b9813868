"""docs/first-fleet.md: its scenario has a proven plan, its commands are commands."""

import re
import shlex

import pytest
import typer.main

from coordinator.planning.planner import plan_scenario
from coordinator.scenario_files.scenario_reader import parse_scenario
from splinefleet import app
from tests.test_readme import ROOT

PAGE = (ROOT / "docs" / "first-fleet.md").read_text()
(SCENARIO,) = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
COMMANDS = [
    line.removesuffix("&").strip()
    for block in re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL)
    for line in block.splitlines()
    if line.startswith("splinefleet ")
]


def test_the_plan_is_the_one_that_is_printed():
    plan = plan_scenario(parse_scenario(SCENARIO.encode(), "hall.toml"))
    assert plan.proof.holds
    for robot in plan.robots:
        row = rf"│ {robot.id}  .*{robot.start_time:.2f}.*│ {robot.finish_time:.2f} .*│ "
        assert re.search(rf"{row}{robot.wire_bytes} ", PAGE), robot.id
    assert f"least separation {plan.proof.least_separation:.4f} m" in PAGE


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_of_it_is_understood(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    main = typer.main.get_command(app)
    name, *words = shlex.split(command)[1:]
    context = main.make_context("splinefleet", [name])
    main.get_command(context, name).make_context(name, words, parent=context)


def test_it_uses_every_program_of_a_run():
    assert {shlex.split(command)[1] for command in COMMANDS} >= {
        "admit", "agent", "coordinator", "info", "judge", "plan", "replay", "view",
    }  # fmt: skip
