"""What may be asked for with --fault, what is done for it and when."""

import itertools
import math

import pytest

from coordinator.base.errors import InputError
from protocol import keys
from protocol.codec import decode
from sim.world.fault_text import KINDS, Fault, fault_help, parse_faults, strikes_of
from sim.world.random_traffic import LONGEST, noise

ROBOTS = ["R1", "R2"]


def acts_of(*texts):
    return [(s.time, s.act, s.first) for s in strikes_of(parse_faults(texts, ROBOTS))]


def test_faults_come_back_in_order_of_time():
    faults = parse_faults(["hang:R2@9.5", "coordinator-kill@4", "kill:R1@8"], ROBOTS)
    assert faults == [
        Fault("coordinator-kill", "", 4.0),
        Fault("kill", "R1", 8.0),
        Fault("hang", "R2", 9.5, math.inf),
    ]
    assert [fault.act for fault in faults] == ["kill", "kill", "stop"]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("slow:R1@8:0.6", 0.6),
        ("stall:R1@8", math.inf),
        ("stall:R1@8:2.5", 2.5),
        ("skid:R1@8", 0.1),
        ("skid:R1@8:-0.3", -0.3),
        ("cut:R1@8:5", 5.0),
        ("clock-step:R1@8:-3600", -3600.0),
        ("corrupt:R1@8", 3.0),
        ("corrupt:R1@8:1", 1.0),
        ("coordinator-restart@10", 3.0),
        ("coordinator-restart@10:0.5", 0.5),
    ],
)
def test_the_number_after_the_time_has_a_default_where_it_may_be_left_out(text, value):
    (fault,) = parse_faults([text], ROBOTS)
    assert fault.value == value


def test_a_fault_that_ends_strikes_twice():
    assert acts_of("cut:R1@8:5") == [(8.0, "cut", True), (13.0, "heal", False)]
    assert acts_of("coordinator-restart@10:2") == [(10.0, "kill", True), (12.0, "resume", False)]
    assert acts_of("coordinator-hang@10") == [(10.0, "stop", True), (15.0, "continue", False)]


def test_strikes_of_several_faults_are_in_order_of_time():
    assert acts_of("cut:R1@1:9", "skid:R2@2", "kill:R2@2.5") == [
        (1.0, "cut", True),
        (2.0, "body", True),
        (2.5, "kill", True),
        (10.0, "heal", False),
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("explode:R1@3", "'explode' is not one of kill"),
        ("restart:R1@3", "'restart' is only with `simulate`; here it is one of kill, "),
        ("kill:R7@3", "no robot R7"),
        ("kill@3", "kill:ROBOT@SECONDS"),
        ("kill:R1", "kill:ROBOT@SECONDS"),
        ("kill:R1@-3", "-3 s is before the first GO; the time is 0 or more"),
        ("skid:R1@-0.5:-0.1", "-0.5 s is before the first GO; the time is 0 or more"),
        ("kill:R1@3:4", "of the form kill:ROBOT@SECONDS"),
        ("slow:R1@3", "slow:ROBOT@SECONDS:SHARE"),
        ("slow:R1@3:1.5", "SHARE 1.5 is not within 0 to 1"),
        ("slow:R1@3:half", "slow:ROBOT@SECONDS:SHARE"),
        ("cut:R1@3", "cut:ROBOT@SECONDS:SECONDS"),
        ("cut:R1@3:-1", "SECONDS -1 is not within"),
        ("skid:R1@3:50", "METRES 50 is not within -10 to 10"),
        ("stall@3", "stall:ROBOT@SECONDS[:SECONDS]"),
        ("coordinator-kill:R1@3", "coordinator-kill@SECONDS"),
        ("coordinator-restart:R1@3", "coordinator-restart@SECONDS[:SECONDS]"),
        ("", "'' is not one of"),
    ],
)
def test_a_fault_that_cannot_be_is_told_in_one_line(text, said):
    with pytest.raises(InputError) as caught:
        parse_faults([text], ROBOTS)
    (problem,) = caught.value.problems
    assert said in problem


def test_all_wrong_faults_are_told_at_once():
    with pytest.raises(InputError) as caught:
        parse_faults(["kill:R7@3", "kill:R1@3", "cut:R1@3"], ROBOTS)
    assert len(caught.value.problems) == 2


def test_the_help_names_every_kind_and_says_of_which_nothing_is_expected():
    said = fault_help()
    assert all(f"{kind}" in said for kind in KINDS)
    jumps = "the wall clock jumps by SECONDS; this must change nothing"
    assert f"clock-step:ROBOT@SECONDS:SECONDS ({jumps})" in said


def test_noise_goes_on_all_four_keys_of_one_robot_and_means_nothing():
    heard = list(itertools.islice(noise("two", "R1", seed=5), 400))
    assert {key for key, _ in heard} == {
        keys.hello("two", "R1"),
        keys.report("two", "R1"),
        keys.clock("two", "R1"),
        keys.plan("two", "R1"),
    }
    assert all(decode(key.split("/")[2], payload) is None for key, payload in heard)
    assert max(len(payload) for _, payload in heard) <= LONGEST
    assert heard == list(itertools.islice(noise("two", "R1", seed=5), 400))
