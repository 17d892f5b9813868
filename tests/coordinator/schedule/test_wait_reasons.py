"""Why robots wait: against the motions themselves and against planning the other way round."""

import math

import numpy as np
import pytest

from coordinator.schedule.priority_order import Deadlock, find_schedule, place_in_order
from coordinator.schedule.wait_reasons import explain_waits
from tests.coordinator.schedule.fleets import line
from tests.coordinator.schedule.fleets_on_lines import (
    NEED,
    fleet_on,
    random_fleet,
    tangled_fleet,
)
from tests.sweeps import seeds


def in_order(fleet, order):
    """Motions in an order of robots, None when the order does not work."""
    found = place_in_order(fleet.junctions, order)
    return None if isinstance(found, Deadlock) else found.all()


def explained(fleet, motions):
    names = [f"R{index}" for index in range(len(motions))]
    return explain_waits(fleet.junctions, motions, names)


def total(fleet, motions):
    return sum(m.finish - t.alone for m, t in zip(motions, fleet.junctions.tracks, strict=True))


@pytest.mark.parametrize("accel", [0.7, math.inf])
@pytest.mark.parametrize("speeds", [[0.9, 0.8], [0.5, 0.9]])
@pytest.mark.parametrize(
    "second", [line((3, -3), (3, 3)), line((0, -3), (6, 3)), line((4, -2), (4, 4))]
)
def test_the_other_way_round_costs_what_planning_in_the_other_order_costs(accel, speeds, second):
    fleet = fleet_on([line((0, 0), (6, 0)), second], speeds, accel=accel, tau=1.0)
    for order in ((0, 1), (1, 0)):
        motions = in_order(fleet, order)
        for reason in explained(fleet, motions):
            assert reason.robot == f"R{order[1]}"
            assert reason.yields_to == f"R{order[0]}"
            other = total(fleet, in_order(fleet, order[::-1])) - total(fleet, motions)
            assert reason.otherwise == pytest.approx(other, abs=1e-6)


def test_both_ways_round_are_each_others_opposite():
    fleet = fleet_on([line((0, 0), (6, 0)), line((3, -3), (3, 3))], tau=1.0)
    told = [explained(fleet, in_order(fleet, order)) for order in ((0, 1), (1, 0))]
    assert [len(reasons) for reasons in told] == [1, 1]
    assert told[0][0].otherwise == pytest.approx(-told[1][0].otherwise, abs=2e-3)


@pytest.mark.parametrize("seed", seeds(12))
def test_in_a_pair_with_many_zones_no_order_of_the_two_beats_what_is_told(seed):
    """The other way round is said of one zone: the best plan that has it so is no worse."""
    fleet = tangled_fleet(seed, 2)
    for order in ((0, 1), (1, 0)):
        motions, other = in_order(fleet, order), in_order(fleet, order[::-1])
        if motions is None or other is None:
            continue
        for reason in explained(fleet, motions):
            if reason.otherwise is not None:
                assert reason.otherwise <= total(fleet, other) - total(fleet, motions) + 1e-6


def test_when_the_other_cannot_pass_second_there_is_no_other_way():
    """The second robot's start lies on the first one's way: it has to go first."""
    fleet = fleet_on([line((0, 0), (6, 0)), line((2, 0.1), (2, 4))], [1.0, 0.1])
    reasons = explained(fleet, in_order(fleet, (1, 0)))
    assert [(reason.robot, reason.yields_to) for reason in reasons] == [("R0", "R1")]
    assert reasons[0].otherwise is None


@pytest.mark.parametrize("make", [random_fleet, tangled_fleet])
@pytest.mark.parametrize("seed", range(8))
def test_reasons_are_the_waits_for_others_along_each_path(make, seed):
    fleet = make(seed, 4)
    motions = find_schedule(fleet.junctions, [0] * 4, 2)
    if isinstance(motions, Deadlock):
        return
    reasons = explained(fleet, motions)
    waits = [(i, wait) for i, m in enumerate(motions) for wait in m.waits if wait.owner >= 0]
    told = [(reason.robot, reason.s, reason.yields_to) for reason in reasons]
    assert told == [(f"R{i}", wait.s, f"R{wait.owner}") for i, wait in waits]
    for reason, (index, wait) in zip(reasons, waits, strict=True):
        motion = motions[index]
        arrived = max(motion.reached(np.array([wait.s]))[0], 0.0)
        assert reason.wait == pytest.approx(max(wait.depart - arrived, 0.0), abs=1e-6)
        check_zone(fleet, index, wait, reason)


def check_zone(fleet, index, wait, reason):
    """The two stretches begin and end where the robots' paths are as near as is allowed."""
    assert wait.s <= reason.zone[1]
    mine, theirs = fleet.curves[index], fleet.curves[wait.owner]
    on_mine = mine.at_arc(np.linspace(*reason.zone, 200))
    on_theirs = theirs.at_arc(np.linspace(*reason.their_zone, 200))
    gaps = np.hypot(*(on_mine[:, None] - on_theirs).transpose(2, 0, 1))
    for nearest in (gaps.min(axis=0), gaps.min(axis=1)):
        assert nearest.max() < NEED + 0.03
    assert gaps.min() < NEED


def test_explaining_leaves_motions_and_junctions_as_they_were():
    fleet = tangled_fleet(3, 4)
    motions = find_schedule(fleet.junctions, [0] * 4, 1)
    waits = [list(motion.waits) for motion in motions]
    first = explained(fleet, motions)
    assert [motion.waits for motion in motions] == waits
    assert explained(fleet, motions) == first
    assert explained(fleet.anew(), motions) == first


def test_a_fleet_that_does_not_wait_has_nothing_to_tell():
    fleet = fleet_on([line((0, y), (5, y)) for y in range(3)])
    assert explained(fleet, in_order(fleet, (0, 1, 2))) == []


def test_the_shortest_of_very_many_waits_are_told_without_the_other_way(monkeypatch):
    monkeypatch.setattr("coordinator.schedule.wait_reasons._MOST", 1)
    fleet = fleet_on(
        [line((0, 0), (9, 0)), line((3, -3), (3, 3)), line((6, -6), (6, 3))], 0.5, tau=2.0
    )
    motions = in_order(fleet, (0, 1, 2))
    reasons = explained(fleet, motions)
    assert len(reasons) == 2
    longest = max(reasons, key=lambda reason: reason.wait)
    for reason in reasons:
        assert (reason.otherwise is not None) == (reason is longest)
