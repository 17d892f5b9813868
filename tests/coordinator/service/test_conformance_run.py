"""The shell around an examination, and the command's answers."""

import json

import pytest
from typer.testing import CliRunner

from coordinator.base.errors import InputError
from coordinator.cli.conformance_command import commands
from coordinator.conformance.courses import Pace
from coordinator.conformance.examiner import Examiner
from coordinator.conformance.exchanges import EXCHANGES
from coordinator.service.conformance_run import examine, read_box
from protocol.timing import MILLISECOND
from robot_agent.service import Robot, RobotService
from sim.processes.local_fleet import free_port
from sim.world.body import SimulatedBody
from sim.world.memory_transport import MemoryNetwork
from splinefleet import app


def test_the_shell_plays_the_exchanges_on_a_link_and_tells_each_step():
    network = MemoryNetwork()
    robot = RobotService(
        Robot("R1", 0.15, 0.5, 0.5), network.session("robot"), SimulatedBody(0.5), "demo"
    )

    def clock():
        network.advance(network.now_ns + 5 * MILLISECOND)
        robot.tick(network.now_ns)
        return network.now_ns

    told = []
    examiner = Examiner("demo", "R1", 1_000, Pace(), exchanges=EXCHANGES[:2])
    examine(examiner, "demo", network.session("examiner"), told.append, clock)
    assert examiner.conforms
    assert told == [EXCHANGES[0].name, EXCHANGES[1].name, "the fleet has ended"]
    assert robot.agent.finished


def test_a_black_box_is_read_and_another_file_is_told_in_a_line(tmp_path):
    box = tmp_path / "R1.csv"
    box.write_text("t,x,y,heading,s,phase,estimate\n0.5,1.0,2.0,0.1,0.0,moving,\n")
    assert read_box(box) == [(0.5, 1.0, 2.0)]
    box.write_text("a,b\n1,2\n")
    with pytest.raises(InputError, match="needs columns t, x and y"):
        read_box(box)
    with pytest.raises(InputError, match="No such file"):
        read_box(tmp_path / "none.csv")


def test_a_command_that_no_robot_answers_ends_with_exit_code_1_and_says_so():
    line = ["--listen", f"tcp/127.0.0.1:{free_port()}", "--wait", "1", "--json"]
    done = CliRunner().invoke(commands, line)
    assert done.exit_code == 1
    answer = json.loads(done.stdout)
    assert (answer["robot"], answer["conforms"]) == (None, False)
    assert {row["verdict"] for row in answer["requirements"]} == {"not tried"}


@pytest.mark.parametrize(
    "wrong", [["--robot", "a b"], ["--at", "nan", "0", "0"], ["--restart", "--blackbox", "R1.csv"]]
)
def test_wrong_options_end_with_exit_code_2(wrong):
    assert CliRunner().invoke(app, ["conformance", *wrong]).exit_code == 2
