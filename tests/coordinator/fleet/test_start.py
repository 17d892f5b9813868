"""Robots join a fleet core, by hand-made messages, until it says GO."""

from __future__ import annotations

import math

import pytest

from coordinator.fleet.phases import GO_LEAD
from protocol import keys
from protocol.codec import decode
from protocol.messages import Clock, Refusal
from protocol.phases import ARMED, GO, HOLD, IDLE
from protocol.timing import COMMAND_PERIOD, REPORT_TIMEOUT
from tests.coordinator.fleet.fleet_floor import NAMES, Floor


def test_a_known_robot_gets_its_plan_and_a_lost_plan_comes_again_on_its_report():
    floor = Floor()
    (sent,) = floor.hello("R2")
    assert (sent.key, sent.payload) == ("splinefleet/hall/plan/R2", b"plan of R2")
    assert floor.hello("R2") == []
    floor.now += COMMAND_PERIOD
    (again,) = floor.report("R2", IDLE, epoch=0)
    assert again.payload == b"plan of R2"


@pytest.mark.parametrize(
    ("robot", "fields", "said"),
    [
        ("R9", {}, "R9 is not in fleet hall"),
        ("R1", {"version": 1}, "protocol version 1"),
        ("R1", {"radius_m": 0.3}, "radius 0.3 m"),
        ("R1", {"max_speed_mps": 0.4}, "0.4 m/s"),
        ("R1", {"max_accel_mps2": 0.3}, "brakes with 0.3 m/s^2, its plan needs 0.4 m/s^2"),
    ],
    ids=["an unknown name", "another protocol", "too wide", "too slow", "too weak brakes"],
)
def test_a_robot_that_cannot_join_is_refused_in_a_sentence(robot, fields, said):
    (sent,) = Floor().hello(robot, boot=9, **fields)
    refusal = decode("plan", sent.payload)
    assert sent.key == keys.plan("hall", robot)
    assert isinstance(refusal, Refusal)
    assert refusal.boot == 9
    assert said in refusal.reason


@pytest.mark.parametrize(("needed", "joins"), [(0.3, True), (0.4, False), (math.inf, False)])
def test_stated_brakes_are_held_against_those_that_the_plan_counts_on(needed, joins):
    floor = Floor()
    floor.fleet.members["R1"].accel = needed
    (sent,) = floor.hello("R1", max_accel_mps2=0.3)
    assert (sent.payload == b"plan of R1") == joins


def test_a_second_process_with_a_robots_name_is_refused_while_the_first_speaks():
    floor = Floor()
    floor.hello("R1", boot=1)
    floor.report("R1", IDLE)
    assert isinstance(decode("plan", floor.hello("R1", boot=2)[0].payload), Refusal)
    floor.now += REPORT_TIMEOUT + 1
    assert floor.hello("R1", boot=2)[0].payload == b"plan of R1"


def test_a_robot_restarted_under_way_waits_to_be_admitted():
    floor = Floor().go()
    floor.now += REPORT_TIMEOUT + 1
    assert floor.hello("R1", boot=2) == []
    assert floor.fleet.incidents[-1].kind == "back"


def test_the_fleet_goes_when_the_last_robot_is_armed_and_not_before():
    floor = Floor()
    for robot in NAMES:
        floor.hello(robot)
    for robot in NAMES[:2]:
        floor.report(robot, ARMED)
    floor.tick()
    assert floor.commands[-1].phase == HOLD
    floor.report("R3", ARMED)
    floor.tick()
    assert floor.commands[-1].phase == GO
    assert floor.commands[-1].start_ns == floor.now + GO_LEAD


def test_an_armed_robot_that_has_gone_silent_holds_the_fleet():
    floor = Floor()
    for robot in NAMES:
        floor.hello(robot)
    floor.everybody(ARMED)
    floor.tick(REPORT_TIMEOUT + 1)
    assert floor.commands[-1].phase == HOLD
    assert floor.fleet.missing(floor.now) == list(NAMES)


def test_the_clock_is_answered_with_the_question_and_the_time():
    floor = Floor()
    (sent,) = floor.hear(keys.clock("hall", "R1"), Clock(5, 123))
    assert decode("clock", sent.payload) == Clock(5, 123, floor.now, floor.now, floor.fleet.boot)
    assert floor.hear(keys.clock("hall", "R9"), Clock(5, 123)) == []


def test_a_stranger_that_floods_refusals_fills_no_memory():
    floor = Floor()
    for boot in range(500):
        floor.hello("R9", boot=boot)
    assert len(floor.fleet.incidents) <= 100
