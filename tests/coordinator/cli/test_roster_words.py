"""What is told of a robot that has not joined in time."""

import pytest
import typer

from coordinator.cli import roster_commands
from protocol.messages import UNDER_WAY, Join, OrderState
from protocol.phases import GO, STOP


class Line:
    """A line to a fleet that takes the robot in, and does not hear it."""

    boot, fleet = 7, "hall"

    def __init__(self, phase):
        self.phase = phase

    def messages(self, _say):
        yield OrderState("join-R9", UNDER_WAY, "R9", released_ms=5)


@pytest.mark.parametrize(
    ("phase", "why"), [(GO, "is its program running"), (STOP, "the fleet is stopped")]
)
def test_a_robot_that_does_not_join_is_told_with_what_it_may_wait_for(phase, why, capsys):
    join = Join(7, "R9", (1.0, 1.0, 0.0), 0.2, 0.8)
    with pytest.raises(typer.Exit):
        roster_commands._ask(Line(phase), "join-R9", join)
    assert f"R9 has not joined yet; {why}" in " ".join(capsys.readouterr().err.split())
