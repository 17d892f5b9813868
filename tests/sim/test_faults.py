"""What may be asked for with --fault."""

import signal

import pytest

from coordinator.errors import InputError
from sim.faults import Fault, parse_faults

ROBOTS = ["R1", "R2"]


def test_faults_come_back_in_order_of_time_with_their_signals():
    faults = parse_faults(["hang:R2@9.5", "coordinator-kill@4", "kill:R1@8"], ROBOTS)
    assert faults == [
        Fault("coordinator-kill", "", 4.0),
        Fault("kill", "R1", 8.0),
        Fault("hang", "R2", 9.5),
    ]
    assert [fault.signal for fault in faults] == [signal.SIGKILL, signal.SIGKILL, signal.SIGSTOP]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("explode:R1@3", "'explode' is none of kill"),
        ("kill:R7@3", "no robot R7"),
        ("kill@3", "kill:ROBOT@SECONDS"),
        ("kill:R1", "kill:ROBOT@SECONDS"),
        ("kill:R1@-3", "kill:ROBOT@SECONDS"),
        ("coordinator-kill:R1@3", "coordinator-kill@SECONDS"),
        ("", "'' is none of"),
    ],
)
def test_a_fault_that_cannot_be_is_told_in_one_line(text, said):
    with pytest.raises(InputError) as caught:
        parse_faults([text], ROBOTS)
    (problem,) = caught.value.problems
    assert said in problem
