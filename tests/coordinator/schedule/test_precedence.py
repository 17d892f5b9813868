"""What paths alone demand: starts and goals on others' ways, chains and rings of them."""

import itertools

import numpy as np
import pytest

from coordinator.schedule.precedence import demands, first_order, stuck_pairs
from tests.coordinator.schedule.fleets import line
from tests.coordinator.schedule.fleets_on_lines import NEED, fleet_on, random_fleet, winding_fleet


def must_go_first(fleet):
    """Pairs (before, after) by sampling: a start or a goal that is nearer to a way than allowed."""
    sampled = [curve.at_arc(np.linspace(0.0, curve.length, 2001)) for curve in fleet.curves]
    found = set()
    for one, other in itertools.permutations(range(len(sampled)), 2):
        if np.hypot(*(sampled[other] - sampled[one][0]).T).min() < NEED:
            found.add((one, other))
        if np.hypot(*(sampled[one] - sampled[other][-1]).T).min() < NEED:
            found.add((one, other))
    return found


def told(fleet):
    """The same from the demands of zones."""
    zones = fleet.junctions.zones
    a_first, b_first = demands(fleet.junctions)
    pairs = list(zip(zones.a.tolist(), zones.b.tolist(), strict=True))
    forward = {pair for pair, asked in zip(pairs, a_first, strict=True) if asked}
    return forward | {pair[::-1] for pair, asked in zip(pairs, b_first, strict=True) if asked}


MAIN = line((0, 0), (6, 0))


@pytest.mark.parametrize(
    ("side", "wanted"),
    [
        (line((3, 3), (3, -3)), set()),
        (line((3, 0.1), (3, 3)), {(1, 0)}),
        (line((3, 3), (3, 0.1)), {(0, 1)}),
        (line((0, 3), (0.1, 0.1), (0.1, -3)), {(0, 1)}),
        (line((6, 3), (6, -3)), {(1, 0)}),
        (line((3, 0.1), (3, 3), (5, 3), (5, 0.1)), {(1, 0), (0, 1)}),
        (line((6, 0), (0, 0)), {(0, 1), (1, 0)}),
    ],
)
def test_a_start_on_the_way_goes_first_and_a_goal_on_the_way_last(side, wanted):
    fleet = fleet_on([MAIN, side])
    assert told(fleet) == wanted


def test_a_start_and_a_goal_far_apart_on_one_way_are_two_demands_not_a_stuck_pair():
    """One leaves its place on the way, the other passes, and the first one comes back to it."""
    fleet = fleet_on([MAIN, line((1.5, 0.1), (1.5, 3), (4.5, 3), (4.5, 0.1))])
    assert told(fleet) == {(0, 1), (1, 0)}
    assert stuck_pairs(fleet.junctions) == []


@pytest.mark.parametrize("seed", range(8))
def test_demands_are_those_that_sampling_finds(seed):
    fleet = winding_fleet(seed, 4) if seed % 2 else random_fleet(seed, 6)
    assert told(fleet) == must_go_first(fleet)


def test_pairs_that_swap_places_or_stand_on_both_ends_are_stuck():
    swap = [line((0, 0), (5, 0)), line((5, 0), (0, 0)), line((0, 3), (5, 3))]
    assert stuck_pairs(fleet_on(swap).junctions) == [(0, 1)]
    nested = [line((0, 0), (9, 0)), line((6, 0), (3, 0))]
    assert stuck_pairs(fleet_on(nested).junctions) == [(0, 1)]
    follower = [line((0, 0), (9, 0)), line((3, 0), (12, 0))]
    assert stuck_pairs(fleet_on(follower).junctions) == []


def test_a_fleet_without_zones_demands_nothing():
    fleet = fleet_on([line((0, y), (5, y)) for y in range(3)], [0.3, 0.9, 0.6])
    assert told(fleet) == set()
    assert first_order(fleet.junctions, [0, 0, 0]) == [1, 2, 0]
    assert first_order(fleet.junctions, [0, 0, 1]) == [2, 1, 0]


@pytest.mark.parametrize("speeds", [[0.4, 0.5, 0.6, 0.7, 0.8], [0.8, 0.7, 0.6, 0.5, 0.4]])
def test_a_chain_of_goals_on_ways_is_passed_from_its_free_end(speeds):
    """Whoever would be quicker, the one whose goal is on a way comes after who passes there."""
    curves = [line((2.0 * k, -2.0), (2.0 * k, 2.0), (2.0 * k + 2.0, 2.0)) for k in range(5)]
    fleet = fleet_on(curves, speeds)
    assert must_go_first(fleet) == {(k + 1, k) for k in range(4)}
    assert first_order(fleet.junctions, [0] * 5) == [4, 3, 2, 1, 0]
    assert first_order(fleet.junctions, [1, 0, 0, 0, 0]) == [4, 3, 2, 1, 0]


def test_a_ring_of_goals_on_ways_is_ordered_by_priority_and_time():
    corners = [(0, 0), (4, 0), (4, 4), (0, 4)]
    curves = [line(*(corners[(k + i) % 4] for i in range(2))) for k in range(4)]
    fleet = fleet_on(curves, [0.4, 0.9, 0.5, 0.6])
    assert must_go_first(fleet) == {(k, (k - 1) % 4) for k in range(4)}
    assert sorted(first_order(fleet.junctions, [0] * 4)) == [0, 1, 2, 3]
    assert first_order(fleet.junctions, [0] * 4)[0] == 1
    assert first_order(fleet.junctions, [0, 0, 5, 0])[0] == 2


@pytest.mark.parametrize("seed", range(6))
def test_an_order_keeps_all_that_is_demanded_unless_that_is_a_ring(seed):
    fleet = random_fleet(seed, 7, size=2.2)
    order = first_order(fleet.junctions, [0] * 7)
    assert sorted(order) == list(range(7))
    broken = [p for p in must_go_first(fleet) if order.index(p[0]) > order.index(p[1])]
    assert not broken or in_ring(must_go_first(fleet))


def in_ring(pairs):
    """Tell whether some follow each other in a ring: nobody is left whom none precedes."""
    left = {index for pair in pairs for index in pair}
    while left:
        free = {i for i in left if not any(b == i and a in left for a, b in pairs)}
        if not free:
            return True
        left -= free
    return False
