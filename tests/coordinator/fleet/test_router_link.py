"""A fleet whose messages pass through a router that may die, hang and come back."""

from __future__ import annotations

import pytest

from coordinator.fleet.log_records import LINK_GONE, LINK_UP, is_router_key, link_record, router_key
from coordinator.fleet.phases import RESUME_PATIENCE, SILENT_PATIENCE
from coordinator.log.channels import describe
from protocol import keys
from protocol.messages import Report, Rest
from protocol.phases import ARMED, DONE, FROZEN, GO, HOLD, MOVING, OVER
from protocol.timing import COMMAND_PERIOD, REPORT_TIMEOUT, SECOND
from tests.coordinator.fleet.fleet_floor import NAMES, Floor, bounds

LONG = 20 * SECOND


def tell(floor, up):
    assert floor.fleet.hear(router_key("hall"), link_record(up), floor.now) == []


def routed(under_way=True):
    floor = Floor()
    tell(floor, up=True)
    return floor.go() if under_way else floor


def wait(floor, time_ns):
    for _ in range(time_ns // COMMAND_PERIOD):
        floor.tick()


def lose_tokens(floor):
    for name in NAMES:
        floor.fleet.hear(keys.alive("hall", name), LINK_GONE, floor.now)


def incidents(floor):
    return [one.text for one in floor.fleet.incidents if one.kind == "router"]


def lost(floor):
    return {name for name in NAMES if floor.fleet.members[name].lost}


@pytest.mark.parametrize("tokens_first", [True, False])
def test_a_router_that_dies_stops_nothing_but_what_is_granted_and_nobody_is_given_up(tokens_first):
    floor = routed()
    if tokens_first:
        lose_tokens(floor)
    tell(floor, up=False)
    if not tokens_first:
        lose_tokens(floor)
    wait(floor, 5 * SECOND)
    granted = max(bounds(floor.fleet, name)[1] for name in NAMES)
    wait(floor, LONG)
    assert max(bounds(floor.fleet, name)[1] for name in NAMES) == granted
    tell(floor, up=True)
    for _ in range(20):
        floor.everybody(MOVING)
        floor.tick()
    assert (floor.fleet.phase, floor.fleet.epoch) == (GO, 1)
    assert lost(floor) == set()
    assert min(bounds(floor.fleet, name)[1] for name in NAMES) > granted
    assert incidents(floor) == ["the router is gone", "the router is back"]


def test_a_robot_that_does_not_come_back_with_the_router_is_lost_where_it_was_last_heard():
    floor = routed()
    wait(floor, SECOND)
    floor.everybody(MOVING)
    known = bounds(floor.fleet, "R2")[0]
    tell(floor, up=False)
    wait(floor, 2 * SECOND)
    tell(floor, up=True)
    back = floor.now
    while not lost(floor):
        for name in ("R1", "R3"):
            floor.report(name, MOVING)
        floor.tick()
    assert 0 <= floor.now - back - RESUME_PATIENCE - REPORT_TIMEOUT <= 2 * COMMAND_PERIOD
    assert lost(floor) == {"R2"}
    assert bounds(floor.fleet, "R2")[0] == known


def test_robots_that_fall_silent_together_are_waited_for_where_there_is_a_router():
    direct, behind = Floor().go(), routed()
    for floor in (direct, behind):
        wait(floor, REPORT_TIMEOUT + SILENT_PATIENCE + SECOND)
        assert lost(floor) == set(NAMES)
    assert direct.fleet.phase == OVER
    assert behind.fleet.phase == GO
    wait(behind, 2 * LONG)
    assert behind.fleet.phase == OVER
    assert direct.fleet.epoch == behind.fleet.epoch == 1


def test_a_robot_whose_own_link_is_gone_is_not_waited_for():
    floor = routed()
    for name in ("R1", "R3"):
        floor.report(name, DONE)
    floor.fleet.hear(keys.alive("hall", "R2"), LINK_GONE, floor.now)
    wait(floor, SILENT_PATIENCE + SECOND)
    assert (floor.fleet.phase, floor.fleet.epoch) == (OVER, 1)


def test_a_fleet_that_has_not_begun_holds_while_its_router_is_away():
    floor = routed(under_way=False)
    for name in NAMES:
        floor.hello(name)
    tell(floor, up=False)
    lose_tokens(floor)
    wait(floor, SECOND)
    assert floor.fleet.phase == HOLD
    tell(floor, up=True)
    for _ in range(2):
        floor.everybody(ARMED)
        floor.tick()
    assert floor.fleet.phase == GO


def test_news_of_the_router_have_a_key_of_their_own_that_nobody_can_speak_on():
    key = router_key("hall")
    assert is_router_key(key)
    assert not is_router_key(keys.alive("hall", "router"))
    assert keys.split(key) is None
    assert describe(key).fits(LINK_UP)
    assert not describe(key).fits(b"no")


def test_a_router_that_came_back_lets_no_lie_about_an_epoch_end_the_coordinator():
    floor = routed()
    for up in (False, True):
        tell(floor, up)
    lie = Report(1, 999, 9, FROZEN, 0, Rest(1.0, 9))
    assert floor.hear(keys.report("hall", "R1"), lie) == []
    assert not floor.fleet.superseded
    assert floor.fleet.bad_messages == 1
