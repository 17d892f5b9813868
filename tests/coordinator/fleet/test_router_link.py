"""A fleet whose messages pass through a router that may die, hang and come back."""

from __future__ import annotations

import pytest

from coordinator.fleet.log_records import LINK_GONE, LINK_UP, is_router_key, link_record, router_key
from coordinator.fleet.own_outage import AWAY
from coordinator.fleet.phases import RESUME_PATIENCE
from coordinator.log.channels import describe
from protocol import keys
from protocol.messages import Report, Rest
from protocol.phases import ARMED, DONE, FREEZE, FROZEN, GO, HOLD, MOVING
from protocol.timing import COMMAND_PERIOD, MILLISECOND, REPORT_TIMEOUT, SECOND
from tests.coordinator.fleet.fleet_floor import NAMES, Floor

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
def test_a_router_that_dies_freezes_the_fleet_and_nobody_is_given_up(tokens_first):
    floor = routed()
    if tokens_first:
        lose_tokens(floor)
    tell(floor, up=False)
    if not tokens_first:
        lose_tokens(floor)
    wait(floor, LONG)
    assert floor.fleet.phase == FREEZE
    assert not floor.fleet.is_settled(floor.now)
    tell(floor, up=True)
    for name in NAMES:
        floor.tick()
        assert not floor.fleet.is_settled(floor.now)
        floor.report(name, FROZEN, s_m=1.0)
    assert floor.fleet.is_settled(floor.now)
    assert lost(floor) == set()
    assert incidents(floor) == ["the router is gone", "the router is back"]


def test_a_robot_that_does_not_come_back_with_the_router_is_lost_where_it_was_last_heard():
    floor = routed()
    kept = floor.fleet.members["R2"].kept_ns
    tell(floor, up=False)
    wait(floor, 2 * SECOND)
    tell(floor, up=True)
    back = floor.now
    while not floor.fleet.is_settled(floor.now):
        for name in ("R1", "R3"):
            floor.report(name, FROZEN, s_m=1.0)
        floor.tick()
    assert 0 <= floor.now - back - RESUME_PATIENCE <= COMMAND_PERIOD
    assert lost(floor) == {"R2"}
    (where,) = [one for one in floor.fleet.standings() if one.robot == "R2"]
    assert where.since == (kept - AWAY - floor.fleet.times.zero_ns) / SECOND


def test_robots_that_fall_silent_together_are_waited_for_where_there_is_a_router():
    direct, behind = Floor().go(), routed()
    for floor in (direct, behind):
        wait(floor, REPORT_TIMEOUT + SECOND)
        assert lost(floor) == set(NAMES)
    assert direct.fleet.is_settled(direct.now)
    assert not behind.fleet.is_settled(behind.now)
    wait(behind, LONG)
    assert behind.fleet.is_settled(behind.now)


def test_a_robot_whose_own_link_is_gone_is_not_waited_for():
    floor = routed()
    for name in ("R1", "R3"):
        floor.report(name, DONE)
    floor.fleet.hear(keys.alive("hall", "R2"), LINK_GONE, floor.now)
    wait(floor, SECOND)
    assert floor.fleet.is_settled(floor.now)


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


@pytest.mark.parametrize("has_router", [True, False])
def test_what_a_router_has_held_back_says_nothing_of_now(has_router):
    floor = routed() if has_router else Floor().go()
    heard = floor.fleet.members["R1"].heard_ns
    floor.tick(150 * MILLISECOND)
    floor.tick(180 * MILLISECOND)
    floor.report("R1", MOVING)
    assert (floor.fleet.members["R1"].heard_ns == heard) == has_router
    floor.tick(60 * MILLISECOND)
    floor.report("R1", MOVING)
    assert floor.fleet.members["R1"].heard_ns == floor.now


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
