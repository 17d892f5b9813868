"""Whom a coordinator says that it waits for: after a second, why, and when that changes."""

from coordinator.fleet.hold_reasons import PATIENCE, RollCall, missing_in_words
from coordinator.fleet.log_records import LINK_GONE
from coordinator.fleet.member import Member
from protocol.phases import ARMED, BRAKING, CLOCK_UNSURE, FROZEN, HOLD, IDLE, MOVING, OFF_PATH
from protocol.timing import COMMAND_PERIOD, REPORT_TIMEOUT, SECOND
from tests.coordinator.fleet.fleet_floor import Floor, chain


def ticks(floor, call, seconds):
    """What is told while this long passes; robots that have said something keep saying it."""
    told = []
    for _ in range(round(seconds * 10)):
        for member in floor.fleet.members.values():
            if member.sequence >= 0:
                floor.report(member.id, member.phase, epoch=member.epoch, fault=member.fault)
        floor.tick()
        told.append(call.news(floor.fleet, floor.now))
    return [text for text in told if text]


def test_nothing_is_told_of_robots_that_come_within_a_second():
    floor, call = Floor(), RollCall()
    assert ticks(floor, call, 0.9) == []
    floor.go()
    assert ticks(floor, call, 5.0) == []


def test_those_that_have_not_said_hello_are_told_once_and_again_when_that_changes():
    floor, call = Floor(), RollCall()
    assert ticks(floor, call, 3.0) == ["HOLD, waiting for R1, R2, R3: have not said hello"]
    floor.hello("R2")
    floor.report("R2", ARMED)
    assert ticks(floor, call, 2.0) == ["HOLD, waiting for R1, R3: have not said hello"]


def test_one_that_does_not_arm_is_told_with_its_fault_in_words():
    floor, call = Floor(), RollCall()
    for robot in ("R1", "R2", "R3"):
        floor.hello(robot)
    floor.report("R1", ARMED)
    floor.report("R2", IDLE, fault=CLOCK_UNSURE)
    floor.report("R3", IDLE, epoch=0)
    assert ticks(floor, call, 2.0) == [
        "HOLD, waiting for R2: has said hello but does not arm, clock not certain; "
        "R3: has said hello but does not hold its plan yet"
    ]
    floor.report("R3", IDLE, fault=OFF_PATH)
    assert ticks(floor, call, 2.0) == [
        "HOLD, waiting for R2: has said hello but does not arm, clock not certain; "
        "R3: has said hello but does not arm, off its path"
    ]


def test_one_that_has_left_or_fallen_silent_is_told_so():
    floor = Floor()
    for robot in ("R1", "R2", "R3"):
        floor.hello(robot)
    floor.fleet.hear("splinefleet/hall/alive/R1", LINK_GONE, floor.now)
    for _ in range(REPORT_TIMEOUT // COMMAND_PERIOD + 2):
        floor.tick()
        floor.report("R3", IDLE)
    assert missing_in_words(floor.fleet, floor.now) == (
        "R1: has lost its link; R2: has fallen silent; R3: holds its plan but is not armed yet"
    )


def test_a_frozen_fleet_tells_who_has_not_said_where_it_rests():
    floor, call = Floor().go(), RollCall()
    floor.fleet.leave_floor(floor.now)
    floor.report("R1", FROZEN, s_m=1.0)
    floor.report("R2", FROZEN, s_m=1.0)
    floor.report("R3", BRAKING)
    assert ticks(floor, call, 1.5) == ["FREEZE, waiting for R3: has not said where it rests"]


def test_who_is_held_by_whom_is_told_once_it_has_lasted():
    floor, call = Floor(rule=chain).go(), RollCall()
    told = []
    for step in range(90):
        for robot in ("R1", "R2", "R3"):
            late = max(2 * (step - 20), 0) if robot != "R3" and step < 60 else 0
            floor.report(robot, MOVING, late=late)
        floor.tick()
        told += filter(None, [call.news(floor.fleet, floor.now)])
    held = "GO, waiting for R1: held by R2, which is late"
    assert told == [held, "GO, nobody waits any more"]


def test_who_is_held_by_a_lost_robot_is_told_so():
    floor, call = Floor(rule=chain).go(), RollCall()
    told = []
    for step in range(70):
        for robot in ("R1", "R2", "R3"):
            if robot != "R2" or step < 20:
                floor.report(robot, MOVING)
        floor.tick()
        told += filter(None, [call.news(floor.fleet, floor.now)])
    assert told[0] == "GO, waiting for R1: held by R2, which is not heard"


def test_a_line_names_ten_and_counts_the_others():
    floor = Floor()
    for number in range(4, 18):
        name = f"R{number}"
        floor.fleet.members[name] = Member(id=name, radius=0.2, speed=0.5, plan=b"")
    assert floor.fleet.phase == HOLD
    said = missing_in_words(floor.fleet, floor.now)
    assert said.endswith("R9, R10 and 7 more: have not said hello")


def test_changes_within_a_second_are_told_together():
    floor, call = Floor(), RollCall()
    ticks(floor, call, 1.1)
    told = []
    for robot in ("R1", "R2"):
        floor.hello(robot)
        floor.report(robot, ARMED)
        told += ticks(floor, call, 0.3)
    assert told == []
    assert ticks(floor, call, 1.0) == ["HOLD, waiting for R3: has not said hello"]
    assert PATIENCE == SECOND
