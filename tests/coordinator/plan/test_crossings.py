"""Crossing points: all of them, where shapely finds them, on both curves."""

import math

import numpy as np
import pytest
import shapely

from coordinator.curves.nurbs import nurbs
from coordinator.plan.crossings import find_all_crossings, find_crossings
from tests.sweeps import seeds


def random_path(seed, count=8):
    random = np.random.default_rng(seed)
    knots = np.concatenate((np.zeros(4), np.arange(1.0, count - 3), np.full(4, count - 3.0)))
    return nurbs(3, knots, random.uniform(0.0, 6.0, (count, 2)))


def straight(start, end):
    return nurbs(1, [0, 0, 1, 1], [start, end])


def by_shapely(a, b):
    lines = [
        shapely.LineString(c.at_arc(np.linspace(0.0, c.length, 6000))) for c in (a, b)
    ]  # chords of about 5 mm
    return shapely.get_coordinates(shapely.intersection(*lines))


@pytest.mark.parametrize("seed", seeds(25))
def test_all_crossings_are_found_and_nothing_else(seed):
    a, b = random_path(seed), random_path(seed + 1000)
    found = find_crossings(a, b)
    wanted = by_shapely(a, b)
    assert len(found) == len(wanted)
    for x, y in wanted:
        assert min(math.hypot(x - m.x, y - m.y) for m in found) < 1e-3


@pytest.mark.parametrize("seed", range(8))
def test_a_crossing_lies_on_both_curves_at_the_arc_lengths_given(seed):
    a, b = random_path(seed), random_path(seed + 1000)
    for meeting in find_crossings(a, b):
        for curve, s in ((a, meeting.s_a), (b, meeting.s_b)):
            assert np.hypot(*(curve.at_arc(s)[0] - (meeting.x, meeting.y))) < 1e-3


@pytest.mark.parametrize("seed", range(8))
def test_crossings_seen_from_the_other_curve_are_the_same(seed):
    a, b = random_path(seed), random_path(seed + 1000)
    one = sorted((m.s_a, m.s_b) for m in find_crossings(a, b))
    other = sorted((m.s_b, m.s_a) for m in find_crossings(b, a))
    np.testing.assert_allclose(one, other, atol=1e-6)


def test_crossings_come_in_order_along_the_first_curve():
    arcs = [m.s_a for m in find_crossings(random_path(1), random_path(1001))]
    assert arcs == sorted(arcs)


def test_two_straight_lines_cross_where_they_must():
    (meeting,) = find_crossings(straight((0, 0), (4, 4)), straight((0, 2), (4, 2)))
    assert (meeting.x, meeting.y) == pytest.approx((2.0, 2.0))
    assert (meeting.s_a, meeting.s_b) == pytest.approx((math.sqrt(8.0), 2.0))


def test_lines_that_only_come_near_do_not_cross():
    assert find_crossings(straight((0, 0), (4, 0)), straight((2, 1e-4), (2, 3))) == []
    assert find_crossings(straight((0, 0), (4, 0)), straight((0, 1), (4, 1))) == []


def test_lines_on_top_of_each_other_have_no_crossing_points():
    assert find_crossings(straight((0, 0), (4, 0)), straight((1, 0), (5, 0))) == []
    assert find_crossings(straight((0, 0), (4, 0)), straight((4, 0), (0, 0))) == []


def test_a_goal_on_anothers_way_is_a_crossing():
    (meeting,) = find_crossings(straight((0, 0), (4, 0)), straight((2, 3), (2, 0)))
    assert (meeting.s_a, meeting.s_b) == pytest.approx((2.0, 3.0))


def test_a_circle_is_crossed_twice_by_a_line():
    w = math.sqrt(0.5)
    corners = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0)]
    half = nurbs(2, [0, 0, 0, 1, 1, 2, 2, 2], corners, [1, w, 1, w, 1])
    found = find_crossings(half, straight((-2, 0.5), (2, 0.5)))
    xs = sorted(m.x for m in found)
    assert xs == pytest.approx([-math.sqrt(0.75), math.sqrt(0.75)])


def test_all_pairs_at_once_give_what_each_pair_gives():
    curves = [random_path(seed) for seed in range(4)]
    pairs = [(0, 1), (2, 3), (3, 2), (1, 3)]
    for (i, j), found in zip(pairs, find_all_crossings(curves, pairs), strict=True):
        alone = find_crossings(curves[i], curves[j])
        rows = [[(m.x, m.y, m.s_a, m.s_b) for m in its] for its in (found, alone)]
        np.testing.assert_allclose(rows[0], rows[1], atol=1e-9)
    assert find_all_crossings(curves, []) == []


def test_a_path_that_touches_another_meets_it_there():
    bend = nurbs(2, [0, 0, 0, 1, 1, 1], [(-1, 1), (0, -1), (1, 1)])
    (meeting,) = find_crossings(bend, straight((-2, 0), (2, 0)))
    assert (meeting.x, meeting.y) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert (meeting.s_a, meeting.s_b) == pytest.approx((0.5 * bend.length, 2.0))
