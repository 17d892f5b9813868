"""What the robot's command refuses before it looks for a coordinator."""

import pytest
from typer.testing import CliRunner

from robot_agent.commands import _tell, commands
from robot_agent.words import SOMEWHERE


@pytest.mark.parametrize("place", ["nan 0 0", "inf 0 0", "1 1 nan", "1 1e300 0", "3000000 0 0"])
def test_a_robot_stands_nowhere_but_at_a_place(place):
    options = ["R1", "--connect", "tcp/127.0.0.1:1", "--at", *place.split()]
    done = CliRunner().invoke(commands, options)
    assert done.exit_code == 2
    assert "is not a place" in done.output


@pytest.mark.parametrize("name", [".", "..", "a/b", "R*", ""])
def test_a_robots_name_is_one_that_keys_and_folders_bear(name):
    done = CliRunner().invoke(commands, [name, "--connect", "tcp/127.0.0.1:1"])
    assert done.exit_code == 2
    assert "is not 1 to 32 of A-Z a-z 0-9" in " ".join(done.output.split())


@pytest.mark.parametrize(
    ("locked", "said"),
    [(False, "`x --connect tcp/a:1`"), (True, "`x --connect tcp/a:1 --keys ...`")],
)
def test_commands_that_are_advised_name_the_endpoint(capsys, locked, said):
    _tell("tcp/a:1", f"`x {SOMEWHERE}`", locked=locked)
    assert capsys.readouterr().err.rstrip().endswith(said)
