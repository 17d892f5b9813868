"""The fleet core under way, by hand-made messages: every way to fail, STOP, bad bytes."""

from __future__ import annotations

import itertools
from typing import get_args

import pytest

from coordinator.fleet.log_records import LINK_GONE
from coordinator.fleet.member import Member
from coordinator.fleet.phases import (
    FAREWELLS,
    FREEZE_PATIENCE,
    GO_LEAD,
    HELD_PATIENCE,
    SILENT_PATIENCE,
    TRANSITIONS,
    Event,
)
from coordinator.fleet.sent_courses import Span
from coordinator.fleet.standstills import STUCK_MS
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import GO_ON, HALT, Clock, Hello, Report, Rest, Tell
from protocol.phases import (
    BRAKING,
    CLOCK_UNSURE,
    DONE,
    FREEZE,
    FROZEN,
    GO,
    HOLD,
    IDLE,
    MOVING,
    OFF_PATH,
    OVER,
    STOP,
)
from protocol.timing import COMMAND_PERIOD, REPORT_TIMEOUT, SECOND
from tests.coordinator.fleet.fleet_floor import NAMES, TAU_MS, Floor, bounds, chain


def test_commands_carry_rising_sequence_numbers_and_the_same_start():
    floor = Floor().go()
    for _ in range(4):
        floor.everybody(MOVING)
        floor.tick()
    assert [c.sequence for c in floor.commands] == list(range(1, len(floor.commands) + 1))
    assert len({c.start_ns for c in floor.commands if c.phase == GO}) == 1


def told_of(floor, kind="fault"):
    return [one.text for one in floor.fleet.incidents if one.kind == kind]


def drive(floor, seconds, *names, **fields):
    """Let these robots say that they move until the time has passed or the phase has changed."""
    until, phase = floor.now + round(seconds * SECOND), floor.fleet.phase
    while floor.now < until and floor.fleet.phase == phase:
        for name in names:
            floor.report(name, MOVING, **fields)
        floor.tick()


def time_to_give_up(floor, robot, *names):
    """Let robots say that they move; return how long [ns] it takes until one is given up."""
    began = floor.now
    while robot not in floor.fleet.grants.given_up and floor.now - began < 60 * SECOND:
        drive(floor, 0.1, *names)
    return floor.now - began


def assert_others_drive_on(floor, *names):
    """For as long as anybody waits for anything, the fleet goes on in the same epoch."""
    drive(floor, 60.0, *names)
    assert {(one.phase, one.epoch) for one in floor.commands if one.phase != HOLD} == {(GO, 1)}


def test_a_silent_robot_is_told_of_and_nothing_else_happens_while_it_holds_nobody():
    floor = Floor().go()
    began = floor.now
    while not floor.fleet.members["R2"].lost:
        drive(floor, 0.1, "R1", "R3")
    assert floor.now - began <= REPORT_TIMEOUT + 2 * COMMAND_PERIOD
    assert_others_drive_on(floor, "R1", "R3")
    assert told_of(floor) == ["R2 has fallen silent"]
    assert floor.fleet.grants.given_up == set()


def test_a_silent_robot_that_holds_another_one_for_long_is_given_up_and_nobody_freezes():
    floor = Floor(rule=chain).go()
    passed = time_to_give_up(floor, "R2", "R1", "R3")
    assert SILENT_PATIENCE <= passed <= SILENT_PATIENCE + 5 * SECOND
    told = floor.fleet.grants.ends.told_ms("R2")
    assert_others_drive_on(floor, "R1", "R3")
    assert told_of(floor) == ["R2 has fallen silent", "others go around R2"]
    assert floor.fleet.grants.ends.told_ms("R2") == told
    assert [(one.robot, one.by) for one in floor.fleet.held()] == [("R1", "R2")]


def test_one_whose_link_is_gone_is_given_up_sooner_than_one_that_is_silent():
    floor = Floor(rule=chain).go()
    drive(floor, 2.0, "R1", "R2", "R3")
    floor.fleet.hear(keys.alive("hall", "R2"), LINK_GONE, floor.now)
    passed = time_to_give_up(floor, "R2", "R1", "R3")
    assert HELD_PATIENCE <= passed < SILENT_PATIENCE
    assert_others_drive_on(floor, "R1", "R3")


def test_a_robot_that_is_not_certain_of_the_time_has_not_stopped():
    member = Floor().go().fleet.members["R1"]
    for fault, stopped in ((CLOCK_UNSURE, False), (OFF_PATH, True)):
        member.phase, member.fault = IDLE, fault
        assert member.has_stopped(1) == stopped


def test_a_late_robot_holds_those_behind_it_and_nobody_plans_anew():
    floor = Floor(rule=chain).go()
    late = 0
    for step in range(600):
        late = min(step * 2, 400)
        floor.report("R1", MOVING, late=late)
        floor.report("R2", MOVING, late=late)
        floor.report("R3", MOVING)
        floor.tick()
    assert floor.commands[-1].phase == GO
    granted = dict(floor.commands[-1].held)
    stood_ms = floor.fleet.times.plan_ms(floor.now) - 50 * late
    assert granted[0] <= stood_ms + TAU_MS
    assert 2 not in granted


def test_who_holds_whom_is_known_and_since_when():
    floor = Floor(rule=chain).go()
    drive(floor, 10.0, "R1", "R2", "R3")
    assert floor.fleet.held() == []
    began = floor.fleet.times.plan_ms(floor.now)
    drive(floor, 4.0, "R1", "R3")
    (held,) = floor.fleet.held()
    assert (held.robot, held.by) == ("R1", "R2")
    assert began <= held.since_ms <= began + 2_000


def test_a_robot_that_waits_behind_one_that_is_held_is_held_by_the_one_that_stands():
    floor = Floor(rule=chain).go()
    drive(floor, 10.0, "R1", "R2", "R3")
    for step in range(40):
        floor.report("R1", MOVING, late=2 * step)
        floor.report("R2", MOVING, late=2 * step)
        floor.tick()
    assert floor.fleet.grants.standstills.behind(["R3"]) == {"R1", "R2"}
    assert floor.fleet.grants.standstills.behind(["R1"]) == set()


STUCK = (
    "R2 does not get on: its wheels may be stuck. "
    "Press STOP before you free it; it goes on by itself"
)


def test_a_robot_that_does_not_get_on_is_found_though_the_coordinator_is_away_again_and_again():
    floor = Floor(rule=chain).go()
    drive(floor, 3.0, "R1", "R2", "R3")
    began, stood_ms, looks = floor.now, floor.fleet.times.plan_ms(floor.now), 0
    while not floor.fleet.grants.given_up and floor.now - began < 60 * SECOND:
        late = (floor.fleet.times.plan_ms(floor.now) - stood_ms) // 50
        for name in NAMES:
            floor.report(name, MOVING, late=0 if name == "R3" else late)
        looks += 1
        floor.tick(COMMAND_PERIOD * (3 if looks % 20 == 0 else 1))
    assert floor.now - began < 20 * SECOND
    assert told_of(floor) == [STUCK, "others go around R2"]


def test_a_robot_at_the_end_of_its_authority_that_is_lost_does_not_stand_at_its_start():
    member = Floor().fleet.members["R1"]
    standing = member.standing(1, [Span(0, 5_056, 5_056)], 0)
    assert (standing.s, standing.since, standing.until) == (None, 5.056, 5.056)
    assert member.standing(1, [Span(0, 0, 0)], 0).s == 0.0


def test_a_process_that_has_said_only_hello_gives_way_to_the_next_one():
    floor = Floor()
    floor.hello("R1", boot=999)
    (sent,) = floor.hello("R1", boot=1)
    assert sent.payload == b"plan of R1"
    floor.report("R1", IDLE)
    (refusal,) = floor.hello("R1", boot=999, sequence=1)
    assert decode("plan", refusal.payload).reason == "another R1 is already in fleet hall"


def test_a_report_of_a_strange_process_does_not_make_a_resumed_coordinator_give_up():
    floor = Floor().go()
    floor.fleet.take_over(78, floor.now, floor.now)
    floor.report("R1", FROZEN, boot=999, epoch=3, s_m=0.5)
    assert not floor.fleet.superseded
    floor.report("R1", FROZEN, epoch=3, s_m=0.5)
    assert floor.fleet.superseded


def test_a_coordinator_that_was_away_goes_on_and_calls_nobody_silent():
    floor = Floor().go()
    floor.now += 60 * SECOND
    floor.tick(0)
    assert floor.commands[-1].phase == GO
    drive(floor, 0.5, "R1", "R2", "R3")
    assert floor.commands[-1].phase == GO
    assert told_of(floor) == []


def test_who_is_not_heard_anew_after_the_coordinator_was_away_is_lost_where_it_was_known_to_be():
    floor = Floor().go()
    drive(floor, 2.0, "R1", "R2", "R3")
    known = bounds(floor.fleet, "R2")
    floor.now += 60 * SECOND
    drive(floor, 4.0, "R1", "R3")
    assert floor.fleet.members["R2"].lost
    assert bounds(floor.fleet, "R2")[0] == known[0]
    assert known[1] <= bounds(floor.fleet, "R2")[1] <= known[0] + 3.6


def test_a_robot_called_lost_that_speaks_again_drives_on():
    floor = Floor(rule=chain).go()
    drive(floor, 3.0, "R1", "R3")
    assert floor.fleet.members["R2"].lost
    drive(floor, 20.0, "R1", "R2", "R3")
    assert not floor.fleet.members["R2"].lost
    assert floor.commands[-1].phase == GO
    assert told_of(floor, "back") != []


def test_a_robot_with_a_fault_is_told_of_at_once_and_the_others_drive_on():
    floor = Floor().go()
    floor.report("R2", BRAKING, fault=OFF_PATH)
    assert told_of(floor) == ["R2 stopped: off its path"]
    for _ in range(200):
        floor.report("R1", MOVING)
        floor.report("R2", FROZEN, fault=OFF_PATH)
        floor.report("R3", MOVING)
        floor.tick()
    assert floor.commands[-1].phase == GO


@pytest.mark.parametrize("is_heard", [True, False])
def test_a_fleet_ends_when_nobody_has_got_on_for_long_and_no_order_is_open(is_heard):
    floor = Floor().go()
    floor.report("R1", DONE)
    floor.report("R2", FROZEN, fault=OFF_PATH)
    assert_others_drive_on(floor, "R3")
    floor.report("R3", DONE)
    began = floor.now
    while floor.fleet.phase == GO and floor.now - began < 60 * SECOND:
        if is_heard:
            floor.report("R2", FROZEN, fault=OFF_PATH)
        floor.tick()
    assert SILENT_PATIENCE - SECOND <= floor.now - began <= SILENT_PATIENCE + 5 * SECOND
    assert (floor.commands[-1].phase, floor.commands[-1].epoch) == (OVER, 1)
    assert not floor.fleet.members.has_arrived
    assert any("the fleet ends, R2 did not arrive" in text for text in told_of(floor, "stays"))


def test_stop_stops_everybody_and_the_plan_goes_on_where_it_was():
    floor = Floor().go()
    drive(floor, 5.0, "R1", "R2", "R3")
    before = floor.commands[-1]
    stopped = floor.now
    floor.take(floor.fleet.stop(floor.now))
    drive(floor, 60.0, "R1", "R2", "R3")
    assert {one.phase for one in floor.commands if one.said_ns > stopped} == {STOP}
    assert floor.commands[-1].headroom_ms == 0
    floor.take(floor.fleet.go_on(floor.now))
    after = floor.commands[-1]
    assert (after.phase, after.epoch) == (GO, before.epoch)
    assert after.start_ns - before.start_ns == floor.now - stopped + GO_LEAD
    drive(floor, 5.0, "R1", "R2", "R3")
    assert floor.commands[-1].phase == GO
    assert told_of(floor) == []


def test_who_repeats_that_the_fleet_goes_on_does_not_undo_a_later_stop_of_somebody_else():
    floor = Floor().go()

    def say(boot, what):
        floor.take(floor.fleet.hear(keys.tell("hall"), encode(Tell(boot, what)), floor.now))
        return floor.fleet.phase

    assert say(7, HALT) == STOP
    assert say(8, GO_ON) == GO
    for _ in range(20):
        assert say(7, HALT) == STOP
        drive(floor, 0.2, "R1", "R2", "R3")
        assert say(8, GO_ON) == STOP
    drive(floor, 1.2, "R1", "R2", "R3")
    assert say(8, GO_ON) == STOP
    assert say(9, GO_ON) == GO
    assert say(7, HALT) == STOP
    assert say(7, GO_ON) == GO


def test_no_robot_is_told_more_than_the_log_says_ahead():
    floor = Floor().go()
    floor.allowed_ms = 4_000
    drive(floor, 10.0, "R1", "R2", "R3")
    said = floor.commands[-1]
    assert (said.said_ns - said.start_ns) // 1_000_000 + said.headroom_ms == 4_000


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


def test_a_robot_that_does_not_get_on_although_nobody_holds_it_is_given_up():
    floor = Floor(rule=chain).go()
    drive(floor, 6.0, "R1", "R2", "R3")
    began = floor.now
    late = 0
    while not floor.fleet.grants.given_up and floor.now - began < 60 * SECOND:
        late += 2
        floor.report("R1", MOVING, late=late)
        floor.report("R2", MOVING, late=late)
        floor.report("R3", MOVING)
        floor.tick()
    patience_ms = STUCK_MS + HELD_PATIENCE // 1_000_000
    assert patience_ms <= (floor.now - began) // 1_000_000 <= patience_ms + 3_000
    assert told_of(floor) == [STUCK, "others go around R2"]
    assert (floor.commands[-1].phase, floor.commands[-1].epoch) == (GO, 1)


def test_when_all_have_arrived_the_end_is_said_several_times():
    floor = Floor().go()
    floor.everybody(DONE)
    for _ in range(FAREWELLS + 1):
        assert not floor.fleet.is_finished
        floor.tick()
    assert floor.fleet.is_finished
    assert [c.phase for c in floor.commands[-FAREWELLS - 1 :]] == [OVER] * (FAREWELLS + 1)


def test_a_robot_that_leaves_once_it_has_heard_the_end_is_not_lost():
    floor = Floor().go()
    for robot in ("R1", "R3"):
        floor.report(robot, DONE)
    floor.report("R2", FROZEN, fault=OFF_PATH)
    while floor.fleet.phase != OVER:
        floor.report("R2", FROZEN, fault=OFF_PATH)
        floor.tick()
    floor.fleet.hear(keys.alive("hall", "R2"), LINK_GONE, floor.now)
    assert not floor.fleet.members["R2"].lost


def test_a_frozen_fleet_is_settled_when_the_living_have_said_where_they_rest():
    floor = Floor().go()
    floor.fleet.leave_floor(floor.now)
    floor.report("R2", BRAKING, fault=OFF_PATH)
    floor.report("R1", FROZEN, s_m=1.0)
    floor.report("R3", FROZEN)
    floor.tick()
    assert floor.commands[-1].wanted == ("R3",)
    assert not floor.fleet.is_settled(floor.now)
    floor.report("R3", FROZEN, s_m=2.5)
    floor.report("R2", FROZEN, fault=OFF_PATH, s_m=0.5)
    floor.tick()
    assert floor.commands[-1].wanted == ()
    assert floor.fleet.is_settled(floor.now)


def test_a_frozen_fleet_does_not_wait_for_the_dead_or_for_ever():
    floor = Floor().go()
    floor.fleet.leave_floor(floor.now)
    floor.report("R1", FROZEN, s_m=1.0)
    floor.report("R2", FROZEN, s_m=1.0)
    floor.report("R3", BRAKING)
    for _ in range(15):
        floor.report("R1", FROZEN)
        floor.report("R2", FROZEN)
        floor.tick()
    assert floor.fleet.is_settled(floor.now)
    stubborn = Floor().go()
    stubborn.fleet.leave_floor(stubborn.now)
    stubborn.everybody(BRAKING)
    for _ in range((FREEZE_PATIENCE + 2 * SECOND) // COMMAND_PERIOD + 1):
        stubborn.everybody(BRAKING)
        stubborn.tick()
    assert stubborn.fleet.is_settled(stubborn.now)


def test_reports_of_other_boots_and_older_sequences_change_nothing():
    floor = Floor().go()
    floor.report("R1", BRAKING, boot=9, fault=OFF_PATH)
    floor.report("R1", BRAKING, fault=OFF_PATH, sequence=0)
    floor.tick()
    assert floor.commands[-1].phase == GO


@pytest.mark.parametrize(
    ("key", "payload"),
    [
        ("splinefleet/hall/report/R1", b"\x00garbage"),
        ("splinefleet/hall/report/R1", encode(Hello(2, 1))),
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
    for phase, event in itertools.product((HOLD, GO, FREEZE, OVER, STOP), get_args(Event)):
        fleet = Floor().fleet
        fleet.phase = phase
        fleet._turn(event, 0)
        assert fleet.phase == TRANSITIONS.get((phase, event), phase)


def test_all_robots_whose_links_go_at_once_are_told_of():
    floor = Floor().go()
    for robot in ("R1", "R2"):
        floor.take(floor.fleet.hear(keys.alive("hall", robot), LINK_GONE, floor.now))
    drive(floor, 2.0, "R3")
    assert told_of(floor) == ["R1 has lost its link", "R2 has lost its link"]


def test_a_robot_that_falls_silent_while_the_fleet_freezes_is_told_of_once():
    floor = Floor().go()
    floor.fleet.leave_floor(floor.now)
    floor.take(floor.fleet.hear(keys.alive("hall", "R1"), LINK_GONE, floor.now))
    for _ in range(20):
        floor.report("R3", FROZEN, s_m=1.0)
        floor.tick()
    assert told_of(floor) == ["R1 has lost its link", "R2 has fallen silent"]


def test_time_in_which_the_coordinator_was_away_counts_against_no_robot_that_stands():
    floor = Floor().go()
    floor.tick()
    still = floor.fleet.grants.standstills
    before, latest = still.got_on_ms.copy(), still.got_on_latest_ms
    floor.tick(passed=3 * SECOND)
    assert (still.got_on_ms - before).tolist() == [3_000] * len(before)
    assert still.got_on_latest_ms == latest + 3_000


def test_a_robot_that_stops_on_a_newer_course_unheard_is_asked_where_it_rests():
    member = Member("R1", 0.2, 0.5, b"", boot=1)
    member.hear(Report(1, 1, 1, FROZEN, 2, Rest(2.0, 1)), SECOND)
    assert member.is_at_rest()
    member.hear(Report(1, 4, 1, FROZEN, 2, revision=1, holds=1), 2 * SECOND)
    assert not member.is_at_rest()
    member.hear(Report(1, 5, 1, FROZEN, 2, Rest(0.5, 1, revision=1), revision=1), 3 * SECOND)
    assert member.rest_s == 0.5
