"""Programs in place of the agent's core: what is said of those that do not work."""

import pytest
from typer.testing import CliRunner

from robot_agent.commands import commands as agent_commands
from robot_agent.program import Program, ProgramError, ProgramService
from robot_agent.service import Robot
from sim.cli.run_commands import commands as run_commands
from sim.world.body import SimulatedBody
from sim.world.memory_transport import MemoryNetwork
from tests.system.fleet_tools import ROOT

SCENARIO = str(ROOT / "examples" / "paper_five.toml")


def refused(commands, *arguments):
    done = CliRunner().invoke(commands, arguments)
    assert done.exit_code == 2
    return " ".join(done.output.split())


def program(tmp_path, text):
    """A shell program that does as the text says."""
    file = tmp_path / "core"
    file.write_text(f"#!/bin/sh\n{text}\n")
    file.chmod(0o755)
    return file


def test_a_core_that_is_no_program_is_told():
    said = refused(agent_commands, "R1", "--connect", "tcp/127.0.0.1:1", "--core", "/no/core")
    assert "/no/core: No such file or directory" in said


@pytest.mark.parametrize(
    ("core", "expected"),
    [("/no/core", "no file '/no/core'"), (f"R9={SCENARIO}", "no robot 'R9', there are R1, R2")],
)
def test_a_core_of_a_run_names_a_file_and_a_robot_that_there_are(core, expected):
    assert expected in refused(run_commands, "run", SCENARIO, "--core", core)


@pytest.mark.processes
@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("exit 3", "has ended, exit code 3"),
        ("while read line; do echo tick 1 2 3; done", "'tick 1 2 3' is not a tick"),
        ("while read line; do echo tick x y; done", "is not a tick"),
    ],
)
def test_a_robot_whose_program_makes_no_sense_ends_and_says_why(tmp_path, text, expected):
    network, body = MemoryNetwork(1), SimulatedBody(0.5)
    with Program(program(tmp_path, text)) as core:
        service = ProgramService(
            core, Robot("R1"), network.session("robot"), body, "f", clock=lambda: 0
        )
        service.rescue(ValueError("a tick failed"), 0)
        assert not service.tick(0)
    assert expected in service.refusal


def test_the_words_of_the_example_are_those_that_are_read():
    source = (ROOT / "firmware" / "examples" / "host.c").read_text()
    told = "tick PHASE FAULT SPEED CURVATURE DISTANCE TURN PLACE EPOCH REVISION HOLDS LEAVES"
    assert f"{told} READING TIME" in source
    with pytest.raises(ProgramError, match="No such file"):
        Program(ROOT / "no core")
