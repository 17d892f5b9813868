"""Robots that were lost and are heard again: what is told of them, and how operators admit them."""

from __future__ import annotations

import pytest

from coordinator.fleet.log_records import LINK_GONE
from coordinator.fleet.member import STRIKES
from coordinator.fleet.phases import SILENT_PATIENCE
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import Admit, Refusal
from protocol.phases import (
    ARMED,
    BRAKING,
    DONE,
    FREEZE,
    FROZEN,
    GO,
    HOLD,
    IDLE,
    MOVING,
    OFF_PATH,
    OVER,
)
from protocol.timing import COMMAND_PERIOD, REPORT_TIMEOUT
from tests.coordinator.fleet.fleet_floor import (
    NAMES,
    PARTS,
    Floor,
    adopt,
    frozen_but,
    grants,
    state_of,
)

WAY_IN = "it waits to be admitted: `splinefleet admit R2 --connect ...`"


def told(floor, *kinds):
    return [incident.text for incident in floor.fleet.incidents if incident.kind in kinds]


def ask(floor, operator=7):
    admit = encode(Admit(operator))
    return floor.take(floor.fleet.hear(keys.admit("hall", "R2"), admit, floor.now))


def going_without_r2():
    """A fleet under way in its second epoch, in which R2, lost in the first, has no part."""
    floor = frozen_but("R2")
    adopt(floor, "R1", "R3")
    for name in ("R1", "R3"):
        floor.report(name, ARMED, epoch=2)
    floor.tick()
    for name in ("R1", "R3"):
        floor.report(name, MOVING, epoch=2)
    assert floor.fleet.phase == GO
    return floor


def rest_and_settle(floor):
    for name in ("R1", "R3"):
        floor.report(name, FROZEN, epoch=2, s_m=0.5)
    floor.tick()
    floor.tick()
    assert floor.fleet.is_settled(floor.now)


def test_a_robot_heard_again_is_told_of_once_with_what_an_operator_can_do():
    floor = going_without_r2()
    for _ in range(5):
        floor.report("R2", BRAKING)
        floor.tick()
    assert told(floor, "back") == [f"R2 is heard again; {WAY_IN}"]


def test_a_robot_whose_hello_is_the_first_word_again_is_told_of():
    floor = going_without_r2()
    floor.hello("R2")
    floor.report("R2", FROZEN)
    assert told(floor, "back") == [f"R2 is heard again; {WAY_IN}"]


def test_a_robot_heard_again_before_the_next_plan_is_there_is_planned_for():
    floor = frozen_but("R2")
    floor.report("R2", FROZEN, s_m=0.75)
    assert told(floor, "back") == ["R2 is heard again; it goes on"]
    assert ask(floor) == []
    assert told(floor, "not admitted") == []
    floor.tick()
    assert floor.fleet.is_settled(floor.now)
    assert state_of(floor) == dict.fromkeys(NAMES, "rests")


def test_a_robot_lost_again_and_heard_again_is_told_of_again():
    floor = frozen_but("R2")
    for _ in range(2):
        floor.report("R2", FROZEN, s_m=0.75)
        for _ in range(REPORT_TIMEOUT // COMMAND_PERIOD + 2):
            for name in ("R1", "R3"):
                floor.report(name, FROZEN, s_m=1.25)
            floor.tick()
    assert told(floor, "back") == ["R2 is heard again; it goes on"] * 2
    assert told(floor, "fault")[-2:] == ["R2 has fallen silent"] * 2


@pytest.mark.parametrize(
    ("finished", "stays", "said"),
    [(True, "", "it has arrived"), (False, "no way", "it stays where it is: no way")],
)
def test_a_robot_heard_again_that_needs_nothing_or_cannot_go_on_is_told_as_such(
    finished, stays, said
):
    floor = going_without_r2()
    floor.fleet.members["R2"].finished, floor.fleet.members["R2"].stays = finished, stays
    floor.report("R2", FROZEN)
    assert told(floor, "back") == [f"R2 is heard again; {said}"]


def test_a_robot_that_speaks_but_does_not_say_where_it_rests_was_never_unheard():
    floor = frozen_but("R2")
    for _ in range(200):
        floor.everybody(FROZEN)
        floor.tick()
    assert floor.fleet.members["R2"].lost
    assert len(told(floor, "back")) == 1


def test_a_robot_heard_again_is_taken_in_where_it_rests_when_it_is_admitted():
    floor = going_without_r2()
    floor.report("R2", FROZEN, s_m=0.75)
    (sent,) = ask(floor)
    assert decode("command", sent.payload).phase == FREEZE
    assert told(floor, "admitted") == ["R2 is admitted"]
    assert ask(floor) == ask(floor, 8) == []
    rest_and_settle(floor)
    standings = {standing.robot: standing for standing in floor.fleet.standings()}
    rests = standings["R2"]
    assert (rests.state, rests.epoch, rests.s) == ("rests", 1, 0.75)
    floor.take(floor.fleet.adopt(3, PARTS, floor.now, grants()))
    assert floor.fleet.phase == HOLD
    (sent,) = floor.report("R2", FROZEN)
    assert sent.payload == PARTS["R2"].plan
    assert ask(floor) == []
    assert told(floor, "not admitted") == []


def test_a_robot_heard_again_that_has_yet_to_say_where_it_rests_is_admitted_once_it_has():
    floor = going_without_r2()
    floor.report("R2", BRAKING)
    assert ask(floor) == ask(floor) == []
    assert told(floor, "not admitted") == ["R2 has not said where it rests yet, ask again"]
    assert floor.fleet.phase == GO
    floor.report("R2", FROZEN, s_m=0.75)
    (sent,) = ask(floor)
    assert decode("command", sent.payload).phase == FREEZE


def test_a_robot_heard_again_and_admitted_that_is_lost_again_is_admitted_when_it_is_back():
    floor = going_without_r2()
    floor.report("R2", FROZEN, s_m=0.75)
    ask(floor)
    floor.fleet.hear(keys.alive("hall", "R2"), LINK_GONE, floor.now)
    rest_and_settle(floor)
    assert state_of(floor) == {"R1": "rests", "R2": "lost", "R3": "rests"}
    parts = {name: PARTS[name] for name in ("R1", "R3")}
    floor.take(floor.fleet.adopt(3, parts, floor.now, grants()))
    said = "R2 has not come back: start its program first"
    (refusal,) = ask(floor)
    assert decode("plan", refusal.payload) == Refusal(7, said)
    assert told(floor, "not admitted") == [said]
    floor.report("R2", IDLE, epoch=0)
    (sent,) = ask(floor)
    assert decode("command", sent.payload).phase == FREEZE


def test_a_robot_that_failed_too_often_goes_on_when_it_is_admitted():
    floor = going_without_r2()
    floor.fleet.members["R2"].struck.update(range(STRIKES))
    floor.report("R2", FROZEN, fault=OFF_PATH, s_m=0.75)
    ask(floor)
    rest_and_settle(floor)
    assert state_of(floor)["R2"] == "rests"


def test_a_process_that_was_taken_for_dead_is_admitted_though_another_had_come_in_its_place():
    floor = going_without_r2()
    floor.hello("R2", boot=9)
    floor.report("R2", FROZEN, s_m=0.75)
    refusal = floor.hello("R2", boot=9, sequence=2)
    assert decode("plan", refusal[0].payload) == Refusal(9, "another R2 is already in fleet hall")
    (sent,) = ask(floor)
    assert decode("command", sent.payload).phase == FREEZE
    rest_and_settle(floor)
    assert state_of(floor)["R2"] == "rests"


@pytest.mark.parametrize("news", ["gone", "silent", "gone after silence"])
def test_two_robots_that_die_at_once_are_both_told_of_once(news):
    floor = Floor().go()
    dead = ("R2", "R3")

    def link_gone():
        for name in dead:
            floor.take(floor.fleet.hear(keys.alive("hall", name), LINK_GONE, floor.now))

    if news == "gone":
        link_gone()
    for _ in range(REPORT_TIMEOUT // COMMAND_PERIOD + 2):
        floor.report("R1", MOVING)
        floor.tick()
    if news == "gone after silence":
        link_gone()
    floor.report("R1", DONE)
    for _ in range(SILENT_PATIENCE // COMMAND_PERIOD + 5):
        floor.tick()
    assert (floor.fleet.phase, floor.fleet.epoch) == (OVER, 1)
    what = "has lost its link" if news == "gone" else "has fallen silent"
    assert told(floor, "fault") == [f"{name} {what}" for name in dead]


def test_a_robot_that_dies_while_the_fleet_freezes_for_another_is_told_of():
    floor = Floor().go()
    while not told(floor, "fault"):
        floor.tick()
        floor.report("R1", MOVING)
        floor.report("R3", MOVING)
    floor.fleet.leave_floor(floor.now)
    for _ in range(REPORT_TIMEOUT // COMMAND_PERIOD + 1):
        floor.report("R1", FROZEN, s_m=0.5)
        floor.tick()
    assert told(floor, "fault") == ["R2 has fallen silent", "R3 has fallen silent"]
