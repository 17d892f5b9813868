"""What becomes of places that an operator closes and opens."""

from contextlib import contextmanager

import pytest
from typer.testing import CliRunner

from coordinator.cli import block_commands
from protocol.messages import Block, Unblock

WET = Block(1, "wet", ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)))


class Line:
    """A line to a fleet in which some places are closed, and which answers at once."""

    boot = 7

    def __init__(self, *closed):
        self.closed = {one.id: one for one in closed}
        self.asked = []

    def blocks(self):
        return self.closed

    def must_be_heard(self):
        pass

    def ask_until(self, _key, message, fits):
        self.asked.append(message)
        return message if fits(message) else None


@pytest.mark.parametrize(
    ("closed", "code", "said", "asked"),
    [
        ((WET,), 0, "wet is open", [Unblock(7, "wet")]),
        ((), 1, "no place wet is closed", []),
        ((Block(1, "dry", WET.polygon),), 1, "no place wet is closed; closed are dry", []),
    ],
)
def test_only_a_place_that_is_closed_is_opened(monkeypatch, capsys, closed, code, said, asked):
    line = Line(*closed)

    @contextmanager
    def fleet_line(*_):
        yield line

    monkeypatch.setattr(block_commands, "fleet_line", fleet_line)
    command = ["unblock", "wet", "--connect", "tcp/127.0.0.1:9"]
    done = CliRunner().invoke(block_commands.commands, command)
    assert (done.exit_code, line.asked) == (code, asked)
    assert said in done.output + capsys.readouterr().err
