"""Messages of the past put on the wire once more: the coordinator does as if they had not come."""

from __future__ import annotations

import pytest

from coordinator.fleet.member import BOOTS
from protocol import keys
from protocol.messages import Admit, Command
from protocol.phases import ARMED, DONE, FREEZE, FROZEN, GO, IDLE, MOVING, OFF_PATH
from protocol.timing import COMMAND_PERIOD, REPORT_TIMEOUT
from tests.coordinator.fleet.fleet_floor import NAMES, Floor, adopt, frozen_but


def state(floor, robot="R1"):
    member = floor.fleet.members[robot]
    return member.boot, member.phase, member.epoch, member.heard_ns, member.finished, member.rest


@pytest.mark.parametrize("phase", [IDLE, ARMED, DONE, FROZEN])
def test_a_report_of_an_earlier_sequence_changes_nothing(phase):
    floor = Floor().go()
    before = state(floor)
    floor.now += REPORT_TIMEOUT // 2
    for sequence in (0, 1, floor.fleet.members["R1"].sequence):
        s_m = 0.5 if phase == FROZEN else None
        assert floor.report("R1", phase, sequence=sequence, s_m=s_m) == []
    assert state(floor) == before
    assert floor.fleet.phase == GO


def test_a_report_of_an_earlier_process_changes_nothing():
    floor = Floor().go()
    before = state(floor)
    assert floor.report("R1", FROZEN, boot=2, sequence=10**6, fault=OFF_PATH, s_m=0.5) == []
    assert state(floor) == before


def test_a_dead_robot_is_not_kept_alive_by_what_it_said_before():
    floor = Floor().go()
    for name in ("R1", "R3"):
        floor.hello(name, sequence=8)
    floor.hello("R2", sequence=8)
    last = floor.fleet.members["R2"].sequence
    for _ in range(REPORT_TIMEOUT // COMMAND_PERIOD + 2):
        for name in ("R1", "R3"):
            floor.report(name, MOVING)
        floor.hello("R2", sequence=8)
        floor.hello("R2", sequence=3)
        floor.report("R2", MOVING, sequence=last)
        floor.tick()
    assert floor.fleet.members["R2"].lost


def test_the_place_in_an_old_hello_is_not_taken_for_where_a_robot_stands():
    floor = frozen_but("R2")
    adopt(floor, "R1", "R3")
    floor.hello("R2", boot=9, sequence=1, place=(9_000, 9_000, 0))
    floor.hello("R2", boot=10, sequence=1, place=(9_000, 9_000, 0))
    floor.hear(keys.admit("hall", "R2"), Admit(1))
    floor.hello("R2", boot=9, sequence=1, place=(9_000, 9_000, 0))
    assert floor.fleet.members["R2"].rest is None
    floor.hello("R2", boot=10, sequence=2, place=(1_500, 0, 0))
    assert floor.fleet.members["R2"].rest.place == (1.5, 0.0, 0.0)


def test_a_hello_that_states_no_number_is_heard_as_ever():
    floor = Floor()
    for name in NAMES:
        floor.hello(name)
        assert floor.fleet.members[name].boot == 1


def test_what_is_remembered_of_hellos_is_bounded():
    floor = Floor()
    for boot in range(1_000):
        floor.hello("R1", boot=boot, sequence=1)
    assert len(floor.fleet.members["R1"].hellos) == BOOTS


def test_a_command_of_an_earlier_coordinator_ends_no_coordinator():
    floor = Floor(epoch=3).go()
    for command in (
        Command(10**6, 0, 10**6, 9, FREEZE, 0, 0),
        Command(1, 1, 10**6, 3, FREEZE, 0, 0),
        Command(77, 1, 10**6, 9, FREEZE, 0, 0),
    ):
        assert floor.hear(keys.command("hall"), command) == []
    assert not floor.fleet.superseded
