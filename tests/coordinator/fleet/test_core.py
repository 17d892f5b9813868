"""The fleet core under way, by hand-made messages: every way to fail, bad bytes."""

from __future__ import annotations

import itertools
from typing import get_args

import pytest

from coordinator.fleet.log_records import LINK_GONE
from coordinator.fleet.own_outage import AWAY, DRAIN
from coordinator.fleet.phases import (
    FAREWELLS,
    FREEZE_PATIENCE,
    GO_LEAD,
    TASK_GRACE,
    TRANSITIONS,
    Event,
)
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import Clock, Hello, Report
from protocol.phases import ARMED, BRAKING, DONE, FREEZE, FROZEN, GO, HOLD, LATE, MOVING, OVER
from protocol.timing import COMMAND_PERIOD, REPORT_TIMEOUT, SECOND
from tests.coordinator.fleet.fleet_floor import DURATION, Floor


def test_commands_carry_rising_sequence_numbers_and_the_same_start():
    floor = Floor().go()
    for _ in range(4):
        floor.everybody(MOVING)
        floor.tick()
    assert [c.sequence for c in floor.commands] == list(range(1, len(floor.commands) + 1))
    assert len({c.start_ns for c in floor.commands if c.phase == GO}) == 1


def test_a_silent_robot_freezes_the_fleet_within_its_timeout_and_a_command():
    floor = Floor().go()
    began = floor.now
    while floor.commands[-1].phase == GO:
        floor.report("R1", MOVING)
        floor.report("R3", MOVING)
        floor.tick()
    assert floor.commands[-1].phase == FREEZE
    assert floor.now - began <= REPORT_TIMEOUT + 2 * COMMAND_PERIOD
    assert floor.fleet.members["R2"].lost
    assert not floor.fleet.members["R1"].lost


def test_a_coordinator_that_was_away_renews_no_lease_before_it_has_heard_everybody_anew():
    floor = Floor().go()
    floor.now += REPORT_TIMEOUT + 4 * COMMAND_PERIOD
    floor.everybody(MOVING)
    said = len(floor.commands)
    floor.tick(0)
    floor.report("R1", MOVING)
    floor.now += DRAIN + 1
    floor.report("R1", MOVING)
    floor.report("R2", MOVING)
    floor.tick()
    assert len(floor.commands) == said
    floor.report("R3", MOVING)
    floor.tick()
    assert floor.commands[-1].phase == GO
    assert len(floor.commands) == said + 1


def test_who_is_not_heard_anew_after_the_coordinator_was_away_is_lost_where_it_last_was_sure():
    floor = Floor().go()
    sure = floor.now
    floor.now += REPORT_TIMEOUT + 4 * COMMAND_PERIOD
    floor.everybody(MOVING)
    floor.tick(0)
    for _ in range(REPORT_TIMEOUT // COMMAND_PERIOD + 2):
        floor.tick()
        floor.report("R1", MOVING)
        floor.report("R3", MOVING)
    assert floor.commands[-1].phase == FREEZE
    assert floor.fleet.members["R2"].lost
    assert floor.fleet.members["R2"].kept_ns <= sure


def test_what_waited_for_a_coordinator_that_was_away_unnoticed_says_where_a_robot_was_then():
    floor = Floor().go()
    times, said = floor.fleet.times, floor.now
    floor.now += AWAY
    floor.report("R2", MOVING)
    (standing,) = (one for one in floor.fleet.standings() if one.robot == "R2")
    assert standing.since <= (said - times.start_ns - times.behind_ns) / SECOND


def test_a_robot_that_speaks_but_does_not_set_out_freezes_the_fleet():
    floor = Floor()
    for robot in ("R1", "R2", "R3"):
        floor.hello(robot)
    floor.everybody(ARMED)
    floor.tick()
    while floor.commands[-1].phase == GO and floor.now < floor.fleet.times.start_ns + SECOND:
        floor.report("R1", MOVING)
        floor.report("R2", ARMED)
        floor.report("R3", MOVING)
        floor.tick()
    assert floor.commands[-1].phase == FREEZE
    assert floor.now <= floor.fleet.times.start_ns + REPORT_TIMEOUT + 2 * COMMAND_PERIOD


def test_a_robot_called_lost_that_speaks_again_is_waited_for():
    floor = Floor().go()
    for _ in range(8):
        floor.report("R1", MOVING)
        floor.report("R3", MOVING)
        floor.tick()
    assert floor.fleet.members["R2"].lost
    floor.report("R2", BRAKING)
    floor.report("R1", FROZEN, s_m=1.0)
    floor.report("R3", FROZEN, s_m=1.0)
    floor.tick()
    assert not floor.fleet.is_settled(floor.now)
    floor.report("R2", FROZEN, s_m=0.5)
    assert floor.fleet.is_settled(floor.now)


def test_a_fault_report_freezes_the_fleet_at_once():
    floor = Floor().go()
    (sent,) = floor.report("R2", BRAKING, fault=LATE)
    assert decode("command", sent.payload).phase == FREEZE
    assert "behind its plan" in floor.fleet.incidents[-2].text


def test_a_robot_that_stops_without_a_word_freezes_the_fleet():
    floor = Floor().go()
    (sent,) = floor.report("R2", FROZEN)
    assert decode("command", sent.payload).phase == FREEZE


def test_a_robot_that_died_at_its_goal_harms_nobody():
    floor = Floor().go()
    floor.report("R2", DONE)
    for _ in range(20):
        floor.report("R1", MOVING)
        floor.report("R3", MOVING)
        floor.tick()
    assert floor.commands[-1].phase == GO
    floor.everybody(DONE)
    floor.tick()
    assert floor.commands[-1].phase == OVER


def test_a_fleet_that_does_not_arrive_in_time_is_frozen():
    floor = Floor().go()
    floor.now += GO_LEAD + DURATION + TASK_GRACE
    floor.tick()
    for _ in range(2):
        floor.everybody(MOVING)
        floor.tick()
    assert floor.commands[-1].phase == FREEZE


def test_when_all_have_arrived_the_end_is_said_several_times():
    floor = Floor().go()
    floor.everybody(DONE)
    for _ in range(FAREWELLS + 1):
        assert not floor.fleet.is_finished
        floor.tick()
    assert floor.fleet.is_finished
    assert [c.phase for c in floor.commands[-FAREWELLS - 1 :]] == [OVER] * (FAREWELLS + 1)


def test_a_frozen_fleet_is_settled_when_the_living_have_said_where_they_rest():
    floor = Floor().go()
    floor.report("R1", MOVING)
    floor.report("R2", BRAKING, fault=LATE)
    floor.report("R1", FROZEN, s_m=1.0)
    floor.report("R3", FROZEN)
    floor.tick()
    assert floor.commands[-1].wanted == ("R3",)
    assert not floor.fleet.is_settled(floor.now)
    floor.report("R3", FROZEN, s_m=2.5)
    floor.report("R2", FROZEN, fault=LATE, s_m=0.5)
    floor.tick()
    assert floor.commands[-1].wanted == ()
    assert floor.fleet.is_settled(floor.now)


def test_a_frozen_fleet_does_not_wait_for_the_dead_or_for_ever():
    floor = Floor().go()
    floor.report("R1", FROZEN, s_m=1.0)
    floor.report("R2", FROZEN, s_m=1.0)
    floor.report("R3", BRAKING)
    for _ in range(10):
        floor.report("R1", FROZEN)
        floor.report("R2", FROZEN)
        floor.tick()
    assert floor.fleet.is_settled(floor.now)
    stubborn = Floor().go()
    stubborn.everybody(BRAKING)
    for _ in range((FREEZE_PATIENCE + 2 * SECOND) // COMMAND_PERIOD + 1):
        stubborn.everybody(BRAKING)
        stubborn.tick()
    assert stubborn.fleet.is_settled(stubborn.now)


def test_reports_of_other_boots_and_older_sequences_change_nothing():
    floor = Floor().go()
    floor.report("R1", BRAKING, boot=9, fault=LATE)
    floor.report("R1", BRAKING, fault=LATE, sequence=0)
    floor.tick()
    assert floor.commands[-1].phase == GO


@pytest.mark.parametrize(
    ("key", "payload"),
    [
        ("splinefleet/hall/report/R1", b"\x00garbage"),
        ("splinefleet/hall/report/R1", encode(Hello(1, 1))),
        ("splinefleet/hall/nonsense/R1", b""),
        ("splinefleet/other/report/R1", encode(Report(1, 1, 1, 1))),
        ("elsewhere", b""),
        ("splinefleet/hall/clock/R1", encode(Clock(1, 2, 3, 4))),
    ],
)
def test_bad_bytes_are_counted_and_change_nothing(key, payload):
    floor = Floor().go()
    assert floor.fleet.hear(key, payload, floor.now) == []
    assert floor.fleet.bad_messages == 1
    floor.everybody(MOVING)
    floor.tick()
    assert floor.commands[-1].phase == GO


def test_every_cell_of_the_table_that_is_not_listed_changes_nothing():
    for phase, event in itertools.product((HOLD, GO, FREEZE, OVER), get_args(Event)):
        fleet = Floor().fleet
        fleet.phase = phase
        fleet._turn(event, 0)
        assert fleet.phase == TRANSITIONS.get((phase, event), phase)


def test_all_robots_whose_links_go_at_once_are_told_of():
    floor = Floor().go()
    for robot in ("R1", "R2"):
        floor.take(floor.fleet.hear(keys.alive("hall", robot), LINK_GONE, floor.now))
    for _ in range(20):
        floor.report("R3", FROZEN, s_m=1.0)
        floor.tick()
    told = [one.text for one in floor.fleet.incidents if one.kind == "fault"]
    assert told == ["R1 has lost its link", "R2 has lost its link"]


def test_a_robot_that_falls_silent_while_the_fleet_freezes_is_told_of_once():
    floor = Floor().go()
    floor.take(floor.fleet.hear(keys.alive("hall", "R1"), LINK_GONE, floor.now))
    for _ in range(20):
        floor.report("R3", FROZEN, s_m=1.0)
        floor.tick()
    told = [one.text for one in floor.fleet.incidents if one.kind == "fault"]
    assert told == ["R1 has lost its link", "R2 has fallen silent"]
