"""A robot that has come back, and what operators ask of it, by hand-made messages."""

from __future__ import annotations

import itertools

import pytest

from coordinator.fleet.came_back import ASKERS, Admission
from coordinator.fleet.log_records import LINK_GONE
from coordinator.fleet.phases import FREEZE_PATIENCE
from coordinator.fleet.sent_courses import Span
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import Admit, Refusal
from protocol.phases import (
    ARMED,
    FREEZE,
    FROZEN,
    GO,
    HOLD,
    IDLE,
    MOVING,
)
from protocol.timing import COMMAND_PERIOD, REPORT_TIMEOUT, SECOND
from tests.coordinator.fleet.fleet_floor import PARTS, Floor, adopt, frozen_but, grants, state_of

PATIENCE = FREEZE_PATIENCE + 3 * SECOND
"""A robot that was admitted is waited for no longer than that."""


def ask(floor, operator=7):
    return floor.take(
        floor.fleet.hear(keys.admit("hall", "R2"), encode(Admit(operator)), floor.now)
    )


def others(floor, phase, **fields):
    for name in ("R1", "R3"):
        floor.report(name, phase, epoch=floor.fleet.epoch, **fields)


def freezes_in(floor, seconds, operators, knocks):
    """Count how often a fleet freezes that others ask again and again for a robot's sake.

    `knocks(now_ns)`: what the robot says then, the fields of its Hello, None for nothing.  The
    others go on whenever they may.
    """
    before = len(floor.commands) - 1
    for tick in range(seconds * SECOND // COMMAND_PERIOD):
        said = knocks(floor.now)
        if said is not None:
            floor.hello("R2", **said)
        for operator in operators if tick % 10 == 0 else ():
            ask(floor, operator)
        phase = floor.fleet.phase
        others(
            floor,
            {HOLD: ARMED, GO: MOVING}.get(phase, FROZEN),
            **({"s_m": 1.0} if phase == FREEZE else {}),
        )
        floor.tick()
        if floor.fleet.is_settled(floor.now):
            parts = {name: PARTS[name] for name in ("R1", "R3")}
            floor.take(floor.fleet.adopt(floor.fleet.next_epoch, parts, floor.now, grants()))
    phases = [command.phase for command in floor.commands[before:]]
    return sum(a != FREEZE and b == FREEZE for a, b in itertools.pairwise(phases))


def test_a_robot_that_came_back_is_taken_in_at_the_place_it_says_when_it_is_admitted():
    floor = frozen_but("R2")
    adopt(floor, "R1", "R3")
    for name in ("R1", "R3"):
        floor.report(name, ARMED, epoch=2)
    floor.tick()
    (refusal,) = floor.fleet.hear(keys.admit("hall", "R2"), encode(Admit(1)), floor.now)
    assert decode("plan", refusal.payload) == Refusal(
        1, "R2 has not come back: start its program first"
    )
    assert floor.hello("R2", boot=9, place=(9_000, 0, 0)) == []
    assert floor.commands[-1].phase == GO
    (sent,) = floor.fleet.hear(keys.admit("hall", "R2"), encode(Admit(1)), floor.now)
    assert decode("command", sent.payload).phase == FREEZE
    for name in ("R1", "R3"):
        floor.report(name, FROZEN, epoch=2, s_m=0.5)
    floor.tick()
    assert not floor.fleet.is_settled(floor.now)
    floor.hello("R2", boot=9, place=(1_500, -20, 1_571))
    floor.tick()
    assert floor.fleet.is_settled(floor.now)
    told = {standing.robot: standing for standing in floor.fleet.standings()}
    assert (told["R2"].state, told["R2"].place) == ("rests", (1.5, -0.02, 1.571))
    floor.fleet.adopt(3, PARTS, floor.now, grants())
    (sent,) = floor.report("R2", IDLE, boot=9, epoch=0)
    assert sent.payload == PARTS["R2"].plan


def test_who_asked_for_a_robot_that_was_admitted_is_refused_only_when_it_gets_no_part():
    floor = frozen_but("R2")
    adopt(floor, "R1", "R3")
    floor.hello("R2", boot=9, place=(0, 0, 0))

    def ask(operator):
        return floor.fleet.hear(keys.admit("hall", "R2"), encode(Admit(operator)), floor.now)

    (sent,) = ask(7)
    assert decode("command", sent.payload).phase == FREEZE
    floor.hello("R2", boot=9, place=(1_500, -20, 1_571))
    before = len(floor.fleet.incidents)
    assert ask(7) == []
    floor.fleet.adopt(3, PARTS, floor.now, grants())
    assert ask(7) == []
    floor.fleet.adopt(4, {"R1": PARTS["R1"], "R3": PARTS["R3"]}, floor.now, grants())
    floor.fleet.members["R2"].stays = "no way"
    (sent,) = ask(7)
    assert decode("plan", sent.payload) == Refusal(7, "R2 stays where it is: no way")
    told = [one.text for one in floor.fleet.incidents[before:] if one.kind == "not admitted"]
    floor.fleet.members["R2"].finished = True
    (sent,) = ask(7)
    assert decode("plan", sent.payload) == Refusal(7, "R2 has arrived already")
    assert told == ["R2 stays where it is: no way"]


@pytest.mark.parametrize(
    ("robot", "said"),
    [("R1", "R1 is driving already"), ("RX", "RX is not in fleet hall, which has R1, R2, R3")],
)
def test_an_operator_who_asks_in_vain_is_told_why_and_everybody_else_once(robot, said):
    floor = Floor().go()
    floor.report("R1", MOVING)
    before = len(floor.fleet.incidents)
    for _ in range(5):
        (sent,) = floor.fleet.hear(keys.admit("hall", robot), encode(Admit(7)), floor.now)
        assert (sent.key, decode("plan", sent.payload)) == (
            keys.plan("hall", robot),
            Refusal(7, said),
        )
    assert [incident.text for incident in floor.fleet.incidents[before:]] == [said]


def test_that_a_robot_has_not_come_back_is_told_again_when_that_has_changed_only():
    floor, said = frozen_but("R2"), "R2 has not come back: start its program first"
    before = len(floor.fleet.incidents)
    for _ in range(5):
        (sent,) = floor.fleet.hear(keys.admit("hall", "R2"), encode(Admit(7)), floor.now)
        assert decode("plan", sent.payload) == Refusal(7, said)
    assert [i.text for i in floor.fleet.incidents[before:]] == [said]


@pytest.mark.parametrize("says", [True, False])
def test_an_admitted_robot_that_never_says_where_it_stands_is_not_waited_for_for_ever(says):
    """One that falls silent is not waited for at all."""
    floor = frozen_but("R2")
    adopt(floor, "R1", "R3")
    floor.hello("R2", boot=9, place=(0, 0, 0))
    floor.fleet.hear(keys.admit("hall", "R2"), encode(Admit(1)), floor.now)
    patience = FREEZE_PATIENCE + 3 * SECOND if says else REPORT_TIMEOUT + COMMAND_PERIOD
    assert not floor.fleet.is_settled(floor.now + COMMAND_PERIOD)
    for tick in range(patience // COMMAND_PERIOD):
        assert floor.fleet.members["R2"].admission.is_awaited or tick > 4
        for name in ("R1", "R3"):
            floor.report(name, FROZEN, s_m=1.25)
        if says:
            floor.hello("R2", boot=9)
        floor.tick()
    floor.tick()
    assert floor.fleet.is_settled(floor.now)
    assert state_of(floor) == {"R1": "rests", "R3": "rests"}


@pytest.mark.parametrize("gone", [True, False])
def test_a_robot_that_came_back_and_died_again_freezes_nobody(gone):
    floor = frozen_but("R2")
    adopt(floor, "R1", "R3")
    floor.hello("R2", boot=9, place=(0, 0, 0))
    if gone:
        floor.fleet.hear(keys.alive("hall", "R2"), LINK_GONE, floor.now)
    else:
        for _ in range(REPORT_TIMEOUT // COMMAND_PERIOD + 1):
            floor.report("R1", ARMED, epoch=2)
            floor.report("R3", ARMED, epoch=2)
            floor.tick()
    before = len(floor.fleet.incidents)
    for _ in range(3):
        assert ask(floor) == []
    told = [incident.text for incident in floor.fleet.incidents[before:]]
    assert told == ["R2 has come back but is no longer heard; start its program again"]
    floor.hello("R2", boot=9, place=(0, 0, 0))
    (sent,) = ask(floor)
    assert decode("command", sent.payload).phase == FREEZE


def test_who_asked_for_a_robot_that_did_not_say_where_it_stands_is_refused_and_others_are_not():
    floor = frozen_but("R2")
    adopt(floor, "R1", "R3")
    floor.hello("R2", boot=9)
    (sent,) = ask(floor)
    assert decode("command", sent.payload).phase == FREEZE
    for _ in range((FREEZE_PATIENCE + 3 * SECOND) // COMMAND_PERIOD):
        for name in ("R1", "R3"):
            floor.report(name, FROZEN, s_m=1.25)
        floor.hello("R2", boot=9)
        floor.tick()
    floor.fleet.adopt(3, {name: PARTS[name] for name in ("R1", "R3")}, floor.now, grants())
    (sent,) = ask(floor)
    assert decode("plan", sent.payload).reason.startswith(
        "R2 did not say where it stands; start its"
    )
    assert floor.fleet.phase == HOLD
    (sent,) = floor.fleet.hear(keys.admit("hall", "R2"), encode(Admit(8)), floor.now)
    assert decode("command", sent.payload).phase == FREEZE


def test_a_robot_admitted_late_in_a_freeze_is_given_time_to_say_where_it_stands():
    floor = frozen_but("R2")
    adopt(floor, "R1", "R3")
    floor.hello("R2", boot=9)
    ask(floor)
    for _ in range((FREEZE_PATIENCE + 3 * SECOND) // COMMAND_PERIOD):
        floor.report("R1", FROZEN, s_m=1.25)
        floor.report("R3", FROZEN, s_m=1.25)
        floor.hello("R2", boot=9)
        floor.tick()
    assert floor.fleet.phase == FREEZE
    floor.fleet.hear(keys.admit("hall", "R2"), encode(Admit(8)), floor.now)
    for _ in range(10):
        floor.hello("R2", boot=9)
        floor.tick()
        assert floor.fleet.members["R2"].admission.is_awaited
    floor.hello("R2", boot=9, place=(1_000, 0, 0))
    assert floor.fleet.members["R2"].standing(2, [Span(0, 0, 1_000)], 0).place == (1.0, 0.0, 0.0)


@pytest.mark.parametrize("operators", [(7,), (7, 8), tuple(range(7, 17))])
def test_who_asks_in_turn_for_a_robot_that_says_no_place_freezes_its_fleet_once(operators):
    floor = frozen_but("R2")
    adopt(floor, "R1", "R3")
    assert freezes_in(floor, 60, operators, lambda _now: {"boot": 9}) == 1
    (sent,) = ask(floor, operators[-1])
    assert decode("plan", sent.payload).reason.startswith(
        "R2 did not say where it stands; start its"
    )


@pytest.mark.parametrize("period", [2, 3, 5])
def test_a_robot_that_comes_back_again_and_again_freezes_its_fleet_twice_for_each_who_asks(period):
    floor = frozen_but("R2")
    adopt(floor, "R1", "R3")

    def crashing(now):
        if now // SECOND % period:
            return None
        return {"boot": 9 + now // (period * SECOND)}

    assert freezes_in(floor, 60, (7,), crashing) == 2
    assert freezes_in(floor, 60, (7, 8), crashing) == 2


def test_a_robot_that_crashes_while_it_is_waited_for_is_taken_in_when_it_is_back():
    floor = frozen_but("R2")
    adopt(floor, "R1", "R3")
    floor.hello("R2", boot=9)
    ask(floor)
    floor.fleet.hear(keys.alive("hall", "R2"), LINK_GONE, floor.now)
    others(floor, FROZEN, s_m=1.25)
    floor.tick()
    floor.tick()
    assert floor.fleet.is_settled(floor.now)
    floor.hello("R2", boot=10)
    (sent,) = ask(floor)
    assert decode("command", sent.payload).phase == FREEZE
    floor.hello("R2", boot=10, place=(1_000, 1_000, 0))
    assert floor.fleet.members["R2"].rest.place == (1.0, 1.0, 0.0)


def test_so_many_ask_in_vain_that_the_first_are_forgotten():
    admission = Admission()
    for boot in range(ASKERS + 10):
        admission.ask(boot, 0)
        admission.look(0, None, 1)
    assert len(admission.in_vain) == ASKERS
    assert ASKERS + 9 in admission.in_vain


def test_a_second_who_asks_for_a_robot_that_is_being_taken_in_is_not_refused():
    floor = frozen_but("R2")
    adopt(floor, "R1", "R3")
    floor.hello("R2", boot=9)
    ask(floor, 7)
    assert decode("command", ask(floor, 8)[0].payload).phase == FREEZE
    floor.hello("R2", boot=9, place=(1_500, -20, 1_571))
    assert ask(floor, 7) == ask(floor, 8) == ask(floor, 9) == []
    floor.take(floor.fleet.adopt(3, PARTS, floor.now, grants()))
    assert ask(floor, 7) == ask(floor, 8) == ask(floor, 9) == []


def test_a_new_epoch_ends_the_waiting_for_a_robot_that_has_no_part_in_it():
    floor = frozen_but("R2")
    adopt(floor, "R1", "R3")
    floor.hello("R2", boot=9)
    ask(floor)
    floor.take(floor.fleet.adopt(3, {"R1": PARTS["R1"]}, floor.now, grants()))
    assert not floor.fleet.members["R2"].admission.is_awaited


def test_a_late_hello_of_a_program_that_was_ended_is_not_taken_for_the_newer_one_at_the_door():
    floor = frozen_but("R2")
    adopt(floor, "R1", "R3")
    floor.hello("R2", boot=8, sequence=1)
    floor.hello("R2", boot=9, sequence=1)
    ask(floor)
    floor.hello("R2", boot=8, sequence=2, place=(3_000, 6_500, 0))
    assert floor.fleet.members["R2"].rest is None
    floor.hello("R2", boot=9, sequence=2, place=(10_000, 4_000, 0))
    assert floor.fleet.members["R2"].rest.place == (10.0, 4.0, 0.0)
    assert floor.fleet.members["R2"].boot == 9


def test_a_program_is_heard_again_when_the_newer_one_is_gone():
    floor = frozen_but("R2")
    adopt(floor, "R1", "R3")
    floor.hello("R2", boot=8, sequence=1)
    floor.hello("R2", boot=9, sequence=1)
    floor.tick(REPORT_TIMEOUT + COMMAND_PERIOD)
    floor.hello("R2", boot=8, sequence=2)
    ask(floor)
    floor.hello("R2", boot=8, sequence=3, place=(1_500, 0, 0))
    assert floor.fleet.members["R2"].boot == 8
