"""Orders of robots: against every permutation, sampling, priorities, deadlocks."""

import itertools
import math

import numpy as np
import pytest

from coordinator.schedule.detours import blocking_pairs
from coordinator.schedule.neighbourhood_search import delays
from coordinator.schedule.precedence import first_order, stuck_pairs
from coordinator.schedule.priority_order import Deadlock, find_schedule, place_in_order
from coordinator.schedule.safe_intervals import earliest_motion
from tests.coordinator.schedule.fleets import line
from tests.coordinator.schedule.fleets_on_lines import (
    fleet_on,
    placed,
    random_fleet,
    tangled_fleet,
    winding_fleet,
)

MAKERS = [random_fleet, tangled_fleet]


def total(fleet, motions):
    return sum(delays(fleet.junctions, motions))


def scheduled(fleet, effort, priorities=None):
    return find_schedule(fleet.junctions, priorities or [0] * len(fleet.curves), effort)


def in_order(fleet, order):
    found = place_in_order(fleet.junctions, order)
    return None if isinstance(found, Deadlock) else found.all()


def politely(fleet, order):
    """Motions in an order without waits where somebody has yet to pass, None if there are none."""
    table = placed(fleet, [None] * len(order))
    for index in order:
        motion = earliest_motion(fleet.junctions, table, index, anywhere=False)
        if motion is None:
            return None
        table.put(index, motion)
    return table.all()


def best_order(fleet, plan_in=in_order):
    """The least sum of delays over all orders of whole robots, infinite if none works."""
    plans = (plan_in(fleet, order) for order in itertools.permutations(range(len(fleet.curves))))
    return min((total(fleet, plan) for plan in plans if plan is not None), default=math.inf)


def facts(motions):
    """All that tells motions apart, as bytes."""
    parts = [(m.knots_s, m.knots_w, m.knots_t, np.array(m.arrivals)) for m in motions]
    waits = repr([motion.waits for motion in motions]).encode()
    return b"".join(part.tobytes() for four in parts for part in four) + waits


@pytest.mark.parametrize("count", [2, 3, 4])
@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("make", MAKERS)
def test_a_schedule_is_found_when_any_order_works_and_is_no_worse_than_the_best(make, seed, count):
    fleet = make(10 * seed + count, count)
    found = scheduled(fleet, 40)
    assert isinstance(found, Deadlock) == (best_order(fleet) == math.inf)
    if not isinstance(found, Deadlock):
        assert total(fleet, found) <= best_order(fleet, politely) + 1e-6
        assert total(fleet, found) >= -1e-6
        assert fleet.slack(found, step=0.04) >= -2e-3


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("make", MAKERS)
def test_motions_in_any_order_that_works_are_tau_safe(make, seed):
    fleet = make(seed, 4)
    for order in list(itertools.permutations(range(4)))[seed % 3 :: 5]:
        motions = in_order(fleet, order)
        if motions is not None:
            assert fleet.slack(motions, step=0.05) >= -2e-3


@pytest.mark.parametrize(("count", "effort"), [(6, 0), (6, 3), (9, 0), (9, 4)])
@pytest.mark.parametrize("seed", range(3))
def test_larger_fleets_are_tau_safe_too(seed, count, effort):
    fleet = tangled_fleet(100 + seed, count, size=9.0)
    found = scheduled(fleet, effort)
    assert isinstance(found, Deadlock) or fleet.slack(found, step=0.05) >= -2e-3


def test_curves_that_wind_through_each_other_are_tau_safe():
    solved = 0
    for seed in range(6):
        fleet = winding_fleet(seed, 3)
        found = scheduled(fleet, 3)
        if not isinstance(found, Deadlock):
            solved += 1
            assert fleet.slack(found, step=0.05) >= -2e-3
    assert solved > 0


@pytest.mark.parametrize("count", [4, 9])
@pytest.mark.parametrize("seed", range(4))
def test_more_effort_is_never_worse(seed, count):
    fleet = tangled_fleet(seed, count, size=1.0 + count)
    found = [scheduled(fleet, effort) for effort in (0, 1, 2, 5, 20)]
    if not isinstance(found[0], Deadlock):
        costs = [total(fleet, motions) for motions in found]
        for less, more in itertools.pairwise(costs):
            assert more <= less + 1e-6


def test_of_two_robots_the_faster_goes_first_and_a_priority_overrules_it():
    fleet = fleet_on([line((-3, 0), (3, 0)), line((0, -3), (0, 3))], [0.5, 0.51], tau=1.0)
    alone = [track.alone for track in fleet.junctions.tracks]
    plain = scheduled(fleet, 0)
    assert plain[1].finish == pytest.approx(alone[1])
    assert plain[0].finish > alone[0] + 0.5
    ruled = scheduled(fleet, 20, [1, 0])
    assert ruled[0].finish == pytest.approx(alone[0])
    assert ruled[1].finish > alone[1] + 0.5


def test_robots_that_never_meet_do_not_wait():
    fleet = fleet_on([line((0, y), (5, y)) for y in range(4)])
    assert total(fleet, scheduled(fleet, 5)) == pytest.approx(0.0, abs=1e-9)


def test_a_robot_that_ends_on_anothers_way_lets_it_pass_first():
    fleet = fleet_on([line((0, 0), (5, 0)), line((2, 3), (2, 0.2))], [0.2, 1.0])
    found = scheduled(fleet, 10)
    assert found[1].finish > found[0].reached(np.array([2.0]))[0]


def test_a_robot_that_starts_on_anothers_way_leaves_before_it_comes():
    fleet = fleet_on([line((0, 0), (5, 0)), line((2, 0.1), (2, 4))], [1.0, 0.1])
    found = scheduled(fleet, 10)
    assert found[1].waits == []
    assert found[0].reached(np.array([1.7]))[0] > found[1].left(np.array([0.3]))[0]


def test_two_that_swap_places_on_one_line_are_a_deadlock_of_both():
    fleet = fleet_on([line((0, 0), (5, 0)), line((5, 0), (0, 0))], [1.0, 0.9])
    found = scheduled(fleet, 5)
    assert isinstance(found, Deadlock)
    assert {found.loser, *found.winners} == {0, 1}
    assert stuck_pairs(fleet.junctions) == [(0, 1)]
    assert blocking_pairs(fleet.junctions, found) == [(0, 1)]


@pytest.mark.parametrize("count", [4, 9])
@pytest.mark.parametrize("faster", [1, -1])
def test_a_chain_of_goals_in_the_way_is_untangled(count, faster):
    """Each robot's goal lies on the next one's way, also with too many to try all orders."""
    curves = [line((2.0 * k, -2.0), (2.0 * k, 2.0), (2.0 * k + 2.0, 0.5)) for k in range(count)]
    fleet = fleet_on(curves, [0.4 + 0.05 * k for k in range(count)][::faster])
    assert not stuck_pairs(fleet.junctions)
    assert fleet.slack(scheduled(fleet, 1), step=0.05) >= -2e-3


def test_a_ring_of_goals_on_each_others_ways_is_a_deadlock():
    """Whoever arrives first stands for ever where the one before it has yet to pass."""
    corners = [(0, 0), (4, 0), (4, 4), (0, 4)]
    halves = [(2, 0), (4, 2), (2, 4), (0, 2)]
    curves = [line(halves[k], corners[(k + 1) % 4], halves[(k + 1) % 4]) for k in range(4)]
    found = scheduled(fleet_on(curves, 0.5), 2)
    assert isinstance(found, Deadlock) == (best_order(fleet_on(curves, 0.5)) == math.inf)


@pytest.mark.parametrize("priorities", [[0] * 4, [1, 0, 0, 1, 0], [0] * 9])
def test_the_same_input_gives_the_same_bytes(priorities):
    count = len(priorities)
    fleet = tangled_fleet(4, count, size=1.0 + count)
    first = scheduled(fleet, 4, priorities)
    for again in (fleet, fleet.anew(), tangled_fleet(4, count, size=1.0 + count)):
        assert facts(scheduled(again, 4, priorities)) == facts(first)


def test_what_was_searched_before_changes_nothing():
    """Junctions remember what zones forbid: other motions in between must not show."""
    fleet = tangled_fleet(6, 5)
    first = scheduled(fleet, 3)
    for order in ((4, 3, 2, 1, 0), (2, 0, 4, 1, 3)):
        in_order(fleet, order)
    assert facts(scheduled(fleet, 3)) == facts(first)


@pytest.mark.parametrize("priorities", [[1, 0, 0, 1, 0], [2, 1, 0, 0, 1]])
def test_nobody_waits_for_a_lower_priority_when_an_order_keeps_them(priorities):
    improved = 0
    for seed in range(16):
        fleet = tangled_fleet(seed, 5)
        order = first_order(fleet.junctions, priorities)
        ranks = [priorities[index] for index in order]
        first = in_order(fleet, order)
        if first is None or ranks != sorted(ranks, reverse=True):
            continue
        found = scheduled(fleet, 12, priorities)
        improved += total(fleet, found) < total(fleet, first) - 1e-6
        for index, motion in enumerate(found):
            owners = [wait.owner for wait in motion.waits if wait.owner >= 0]
            assert all(priorities[owner] >= priorities[index] for owner in owners)
    assert improved > 0
