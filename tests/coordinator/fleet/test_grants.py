"""The authority that Commands state, by hand-made staircases and messages."""

import numpy as np
import pytest

from coordinator.fleet.grants import Grants
from coordinator.plan.staircases import Staircases
from protocol.messages import MOST_HELD, Report
from protocol.phases import FREEZE, FROZEN, GO, LATE, MOVING
from protocol.timing import LATE_STEP_MS
from tests.coordinator.fleet.fleet_floor import NAMES, Floor

HEADROOM = 1_000
TAU = 500


def staircases(*pairs):
    """Staircases of one knot each: (ahead, behind, from when [ms], need [ms])."""
    pairs = sorted(pairs, key=lambda pair: (pair[1], pair[0]))
    ahead, behind, at, need = np.array(pairs, np.int64).reshape(-1, 4).T
    first = np.arange(len(pairs) + 1)
    return Staircases(TAU, ahead, behind, first, at.astype(np.int32), need.astype(np.int32))


def report(stamp_ms, late=0, sequence=1):
    return Report(1, sequence, 1, MOVING, stamp_ms=stamp_ms, late=late)


def test_robots_that_meet_nobody_get_the_headroom():
    grants = Grants(staircases(), ["R1", "R2"], HEADROOM)
    assert grants.grant(2_000) == (3_000, ())


def test_a_robot_that_says_nothing_is_granted_no_more_than_the_slack_and_is_named():
    grants = Grants(staircases(), ["R1", "R2"], HEADROOM)
    for now in range(0, 10_000, 100):
        stated = grants.grant(now)
        grants.hear("R1", report(now))
    assert stated == (10_900, (("R2", 3_000),))


def test_the_one_behind_is_held_until_the_one_ahead_says_that_it_has_passed():
    grants = Grants(staircases((0, 1, 4_000, 3_000)), ["R1", "R2"], HEADROOM)
    for now in range(0, 6_000, 100):
        grants.grant(now)
        grants.hear("R2", report(now))
        grants.hear("R1", report(now, late=-(-max(now - 2_000, 0) // LATE_STEP_MS)))
    assert grants.grant(6_000).held == (("R2", 3_999), ("R1", 5_000))
    grants.hear("R1", report(6_000, late=2_950 // LATE_STEP_MS))
    assert ("R2", 3_999) not in grants.grant(6_100).held


def test_reports_of_strangers_and_reports_without_a_stamp_say_nothing():
    grants = Grants(staircases(), ["R1"], HEADROOM)
    grants.grant(0)
    grants.hear("R9", report(5_000))
    grants.hear("R1", report(None))
    assert grants.grant(9_000) == (10_000, (("R1", 3_000),))


@pytest.mark.parametrize("more", [0, 1, 40])
def test_those_that_a_command_cannot_name_are_granted_no_more_than_the_rule(more):
    """More robots fall silent, one after another, than a Command can name."""
    count = MOST_HELD + more
    names = [f"R{number}" for number in range(count + 5)]
    grants, told = Grants(staircases(), names, HEADROOM), dict.fromkeys(names, 0)
    for now in range(0, 60_000, 100):
        stated = grants.grant(now)
        held = dict(stated.held)
        assert len(held) <= MOST_HELD
        for number, name in enumerate(names):
            told[name] = max(told[name], held.get(name, stated.authority_ms))
            if number >= count or now <= 100 * number:
                grants.hear(name, report(now))
    for number, name in enumerate(names):
        last = 100 * number if number < count else 59_900
        assert told[name] <= last + 2_000 + HEADROOM


def authorities(floor):
    return [command.authority_ms for command in floor.commands if command.phase == GO]


def a_floor(*pairs):
    floor = Floor()
    floor.fleet._grants = Grants(staircases(*pairs), NAMES, HEADROOM)
    return floor.go()


def test_commands_state_authority_from_go_on_and_none_before_it_or_after_a_freeze():
    floor = a_floor()
    for _ in range(3):
        floor.everybody(MOVING)
        floor.tick()
    assert authorities(floor) == [600, 700, 800, 900]
    while floor.commands[-1].phase != FREEZE:
        floor.tick()
    others = [command for command in floor.commands if command.phase != GO]
    assert {command.authority_ms for command in others} == {None}


def test_a_report_of_another_epoch_or_process_is_no_progress():
    floor = a_floor((0, 1, 300, 200))
    for boot, epoch in ((1, 2), (5, 1)):
        wrong = Report(boot, next(floor.sequence), epoch, MOVING, stamp_ms=900)
        floor.hear("splinefleet/hall/report/R1", wrong)
    floor.everybody(MOVING)
    for _ in range(3):
        floor.tick()
    assert ("R2", TAU - 1) in floor.commands[-1].held
    right = Report(1, next(floor.sequence), 1, MOVING, stamp_ms=250)
    floor.hear("splinefleet/hall/report/R1", right)
    floor.tick()
    assert floor.commands[-1].held == ()


@pytest.mark.parametrize(("held", "strikes"), [(True, set()), (False, {1})])
def test_a_robot_that_is_late_because_others_held_it_gets_no_strike(held, strikes):
    floor = a_floor(*[(0, 1, 0, 60_000)] * held)
    for _ in range(12):
        floor.everybody(MOVING)
        now = (floor.now - floor.fleet.times.start_ns) // 1_000_000
        for name in NAMES:
            stamped = Report(1, next(floor.sequence), 1, MOVING, stamp_ms=now)
            floor.hear(f"splinefleet/hall/report/{name}", stamped)
        floor.tick()
    floor.report("R2", FROZEN, fault=LATE)
    assert floor.commands[-1].phase == FREEZE
    assert floor.fleet.members["R2"].struck == strikes
