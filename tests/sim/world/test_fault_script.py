"""Faults in virtual time read as they are written, and are drawn from the seed alone."""

from itertools import pairwise
from random import Random

import pytest

from coordinator.base.errors import InputError
from sim.world.fault_script import (
    KINDS,
    MOST_FAULTS,
    draw_faults,
    known_kinds,
    read_faults,
    write_fault,
)
from sim.world.fault_text import KINDS as PROCESS_KINDS
from sim.world.fault_text import ONLY_VIRTUAL, Fault

ROBOTS = ("R1", "R2", "R3")


@pytest.mark.parametrize(
    "text",
    [
        "kill:R3@8",
        "hang:R1@2.5",
        "hang:R1@2.5:3",
        "slow:R3@8:0.6",
        "skid:R2@1:-0.08",
        "cut:R1@3:5",
        "driver-error:R1@4",
        "coordinator-hang@10:2",
    ],
)
def test_a_fault_is_written_as_it_was_read(text):
    assert [write_fault(one) for one in read_faults([text], ROBOTS)] == [text]


def test_the_kinds_that_real_processes_do_not_have_are_known_to_them():
    assert set(ONLY_VIRTUAL) == KINDS.keys() - PROCESS_KINDS.keys()


def test_what_is_drawn_reads_back_the_same():
    for seed in range(200):
        for fault in draw_faults(Random(seed), ROBOTS, 30.0, tuple(KINDS)):
            assert read_faults([write_fault(fault)], ROBOTS) == [fault]


def test_a_seed_draws_the_same_faults_again_of_the_kinds_asked_for():
    for seed in range(50):
        drawn = draw_faults(Random(seed), ROBOTS, 30.0, ("kill", "cut"))
        assert drawn == draw_faults(Random(seed), ROBOTS, 30.0, ("kill", "cut"))
        assert 1 <= len(drawn) <= MOST_FAULTS
        assert {fault.kind for fault in drawn} <= {"kill", "cut"}


def test_faults_come_under_way_and_some_soon_after_another():
    drawn = [draw_faults(Random(seed), ROBOTS, 30.0, tuple(KINDS)) for seed in range(300)]
    gaps = [b.time - a.time for some in drawn for a, b in pairwise(some)]
    assert all(0.0 <= fault.time <= 31.5 + 6.0 * MOST_FAULTS for some in drawn for fault in some)
    assert sum(gap < 1.0 for gap in gaps) > 30
    assert {fault.kind for some in drawn for fault in some} == set(KINDS)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("burn:R1@3", "'burn' is not one of"),
        ("coordinator-kill@3", "'coordinator-kill' is only with `run`; here it is one of kill, "),
        ("kill@3", "is not of the form kill:ROBOT@SECONDS"),
        ("slow:R1@3", "is not of the form slow:ROBOT@SECONDS:SHARE"),
        ("slow:R1@3:1.5", "SHARE 1.5 is not within 0 to 1"),
        ("kill:R1@-3", "-3 s is before the first GO; the time is 0 or more"),
        ("kill:R9@3", "there is no robot R9; the robots are R1, R2, R3"),
        ("coordinator-hang:R1@3", "is not of the form coordinator-hang@SECONDS[:SECONDS]"),
    ],
)
def test_a_fault_that_makes_no_sense_is_told_in_one_line(text, problem):
    with pytest.raises(InputError, match=r"--fault") as caught:
        read_faults([text, "kill:R1@1", text], ROBOTS)
    assert len(caught.value.problems) == 2
    assert problem in caught.value.problems[0]


def test_kinds_that_there_are_not_are_named():
    assert known_kinds("kill, cut") == ("kill", "cut")
    with pytest.raises(InputError, match="'burn'"):
        known_kinds("kill,burn")


def test_a_fault_says_when_it_never_ends():
    assert read_faults(["hang:R1@2"], ROBOTS) == [Fault("hang", "R1", 2.0, float("inf"))]
