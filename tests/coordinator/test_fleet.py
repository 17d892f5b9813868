"""The fleet core by hand-made messages: every phase, every way to fail, bad bytes."""

import itertools

import pytest

from coordinator.fleet import (
    FAREWELLS,
    FREEZE_PATIENCE,
    FREEZE_SAID,
    GO_LEAD,
    TASK_GRACE,
    TRANSITIONS,
    Fleet,
)
from coordinator.member import Member
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import Clock, Command, Hello, Refusal, Report
from protocol.phases import (
    ARMED,
    BRAKING,
    DONE,
    FREEZE,
    FROZEN,
    GO,
    HOLD,
    IDLE,
    LATE,
    MOVING,
    OVER,
)
from protocol.timing import COMMAND_PERIOD, REPORT_TIMEOUT, SECOND

NAMES = ("R1", "R2", "R3")
DURATION = 10 * SECOND


class Floor:
    """A fleet core and its three robots, each of which says what the test makes it say."""

    def __init__(self, epoch=1):
        members = [
            Member(id=name, radius=0.2, speed=0.5, plan=b"plan of " + name.encode())
            for name in NAMES
        ]
        self.fleet = Fleet("hall", 77, epoch, members, DURATION)
        self.now = 5 * SECOND
        self.sequence = itertools.count(1)
        self.commands = []

    def hello(self, robot="R1", **fields):
        return self.hear(keys.hello("hall", robot), Hello(**{"version": 1, "boot": 1, **fields}))

    def report(self, robot, phase, boot=1, epoch=1, fault=0, s_m=None, sequence=None):
        number = next(self.sequence) if sequence is None else sequence
        return self.hear(keys.report("hall", robot), Report(boot, number, epoch, phase, fault, s_m))

    def hear(self, key, message):
        return self.take(self.fleet.hear(key, encode(message), self.now))

    def tick(self, passed=COMMAND_PERIOD):
        self.now += passed
        return self.take(self.fleet.tick(self.now))

    def take(self, sent):
        for outgoing in sent:
            message = decode(keys.split(outgoing.key)[1], outgoing.payload)
            if isinstance(message, Command):
                self.commands.append(message)
        return sent

    def everybody(self, phase, **fields):
        for robot in NAMES:
            self.report(robot, phase, **fields)

    def go(self):
        for robot in NAMES:
            self.hello(robot)
        self.everybody(ARMED)
        self.tick()
        self.everybody(MOVING)
        return self


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
        ("R1", {"version": 2}, "protocol version 2"),
        ("R1", {"radius_m": 0.3}, "radius 0.3 m"),
        ("R1", {"max_speed_mps": 0.4}, "0.4 m/s"),
    ],
    ids=["an unknown name", "another protocol", "too wide", "too slow"],
)
def test_a_robot_that_cannot_join_is_refused_in_a_sentence(robot, fields, said):
    (sent,) = Floor().hello(robot, boot=9, **fields)
    refusal = decode("plan", sent.payload)
    assert sent.key == keys.plan("hall", robot)
    assert isinstance(refusal, Refusal)
    assert refusal.boot == 9
    assert said in refusal.reason


def test_a_second_process_with_a_robots_name_is_refused_while_the_first_speaks():
    floor = Floor()
    floor.hello("R1", boot=1)
    assert isinstance(decode("plan", floor.hello("R1", boot=2)[0].payload), Refusal)
    floor.now += REPORT_TIMEOUT + 1
    assert floor.hello("R1", boot=2)[0].payload == b"plan of R1"


def test_a_robot_restarted_under_way_waits_for_the_next_start():
    floor = Floor().go()
    floor.now += REPORT_TIMEOUT + 1
    refusal = decode("plan", floor.hello("R1", boot=2)[0].payload)
    assert "under way" in refusal.reason


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


def test_a_coordinator_that_was_away_hears_before_it_calls_anybody_silent():
    floor = Floor().go()
    floor.tick(4 * COMMAND_PERIOD + REPORT_TIMEOUT)
    assert floor.commands[-1].phase == GO
    floor.everybody(MOVING)
    floor.tick()
    assert floor.commands[-1].phase == GO
    floor.tick(3 * REPORT_TIMEOUT)
    floor.tick()
    assert floor.commands[-1].phase == FREEZE


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
    floor.tick(FREEZE_SAID)
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
    floor.tick(FREEZE_SAID)
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
    for _ in range(FREEZE_PATIENCE // COMMAND_PERIOD + 1):
        stubborn.everybody(BRAKING)
        stubborn.tick()
    assert stubborn.fleet.is_settled(stubborn.now)


def test_reports_of_other_boots_and_older_sequences_change_nothing():
    floor = Floor().go()
    floor.report("R1", BRAKING, boot=9, fault=LATE)
    floor.report("R1", BRAKING, fault=LATE, sequence=0)
    floor.tick()
    assert floor.commands[-1].phase == GO


def test_the_clock_is_answered_with_the_question_and_the_time():
    floor = Floor()
    (sent,) = floor.hear(keys.clock("hall", "R1"), Clock(5, 123))
    assert decode("clock", sent.payload) == Clock(5, 123, floor.now, floor.now)
    assert floor.hear(keys.clock("hall", "R9"), Clock(5, 123)) == []


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
    for phase, event in itertools.product(
        (HOLD, GO, FREEZE, OVER), ("all armed", "robot failed", "all done")
    ):
        fleet = Floor().fleet
        fleet.phase = phase
        fleet._turn(event, 0)
        assert fleet.phase == TRANSITIONS.get((phase, event), phase)


def test_a_stranger_that_floods_refusals_fills_no_memory():
    floor = Floor()
    for boot in range(500):
        floor.hello("R9", boot=boot)
    assert len(floor.fleet.incidents) <= 100
