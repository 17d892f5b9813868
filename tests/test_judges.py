"""The judges of plans against each other, and against what can be worked out by hand."""

import itertools
import random

import numpy as np
import pytest

from tests.optimum import least_delay
from tests.oracle_dense import closest
from tests.oracle_exhaustive import earliest_times, find_times
from tests.oracle_zones import Course, find_zones
from tests.oracles import Track, least_slack, naive_point, naive_points
from tests.sweeps import seeds

HORIZON = 1000.0


def straight(name, start, goal, leaves=0.0, speed=1.0, radius=0.2):
    """A robot of a plan document that drives straight on at one speed."""
    length = ((goal[0] - start[0]) ** 2 + (goal[1] - start[1]) ** 2) ** 0.5
    path = {"degree": 1, "knots": [0, 0, 1, 1], "control_points": [start, goal], "weights": [1, 1]}
    profile = [[0.0, speed], [length, speed]]
    about = {"id": name, "radius": radius, "start_time": leaves, "stops": []}
    return Track({**about, "path": path, "profile": profile})


@pytest.mark.parametrize("degree", [1, 2, 3, 5])
def test_points_span_by_span_are_those_of_all_basis_functions(degree):
    dice = np.random.default_rng(degree)
    inner = np.sort(dice.random(6)).round(1) if degree > 1 else np.linspace(0.1, 0.9, 6)
    knots = [*[0.0] * (degree + 1), *inner.tolist(), *[1.0] * (degree + 1)]
    points, weights = dice.random((degree + 7, 2)), dice.random(degree + 7) + 0.2
    u = np.unique([*knots, *dice.random(40).tolist()])
    found = naive_points(degree, knots, points, weights, u)
    for at, place in zip(u[:-1].tolist(), found, strict=False):
        assert place == pytest.approx(naive_point(degree, knots, points, weights, at), abs=1e-12)
    assert found[-1] == pytest.approx(points[-1])


def test_the_dense_sampler_finds_the_moment_of_a_crossing():
    """They cross at (2, 0), one at 2 s, the other at 3.5 s: 1 s of the 1.5 s is bridged."""
    fleet = [
        straight("A", (0, 0), (9, 0)),
        straight("B", (2, -2), (2, 7), leaves=1.5),
    ]
    found = closest(fleet, tau=1.0, margin=0.1, look=9.0)
    # 0.5 s apart on a right angle: at best (0.25, 0.25) m off the corner
    assert found.slack == pytest.approx(0.125**0.5 - 0.5, abs=1e-3)
    assert found.who == ("A", "B")
    assert abs(found.when[1] - found.when[0]) == pytest.approx(1.0)
    assert closest(fleet, tau=0.0, margin=0.1, look=9.0).slack == pytest.approx(
        1.125**0.5 - 0.5, abs=1e-3
    )


@pytest.mark.parametrize("tau", [0.0, 0.3, 0.77, 2.0])
def test_the_dense_sampler_agrees_with_the_plain_one(tau):
    ends = [(0, 0), (5, 4), (0, 4), (6, 1), (3, 6), (3, -3)]
    fleet = [
        straight(f"R{i}", start, goal, leaves=0.4 * i, speed=0.5 + 0.1 * i, radius=0.1 + 0.05 * i)
        for i, (start, goal) in enumerate(itertools.pairwise(ends))
    ]
    plain, _ = least_slack(fleet, tau, 0.05)
    assert closest(fleet, tau, 0.05, look=9.0).slack == pytest.approx(plain, abs=1e-12)


def fleet_of(ways, speeds=None, radius=0.2):
    """Courses of robots that drive straight on, and their zones with a margin of 0.1 m."""
    speeds = speeds or [1.0] * len(ways)
    courses = [
        Course.of(straight(f"R{i}", *way, radius=radius), speed)
        for i, (way, speed) in enumerate(zip(ways, speeds, strict=True))
    ]
    return courses, find_zones(courses, 0.1)


def test_of_two_that_meet_at_a_right_angle_one_waits_as_long_as_geometry_says():
    """(s_b - s_a) is at most sqrt(2) need in the zone: the later one has to be so much behind."""
    courses, zones = fleet_of([((0, 0), (8, 0)), ((4, -4), (4, 4))])
    assert len(zones) == 1
    found = least_delay(courses, zones, tau=0.5)
    assert found.proven
    assert found.delay == pytest.approx(0.5 + 2**0.5 * 0.5, abs=0.021)
    assert found.delay <= 0.5 + 2**0.5 * 0.5


def test_robots_on_one_line_follow_each_other_all_the_way():
    """The one behind is faster and would run into the other: it arrives tau after it passed."""
    ways = [((2, 0), (10, 0)), ((0, 0.3), (9, 0.3))]
    courses, zones = fleet_of(ways, [0.5, 1.0])
    found = least_delay(courses, zones, tau=1.0)
    # their lines are 0.3 m apart, so the first has to be 0.4 m past the goal of the second
    assert found.delay == pytest.approx(7.4 / 0.5 + 1.0 - 9.0, abs=0.05)


def test_two_that_want_to_swap_on_one_line_have_no_schedule():
    courses, zones = fleet_of([((0, 0), (5, 0)), ((5, 0.1), (0, 0.1))])
    assert least_delay(courses, zones, tau=0.5) is None
    assert find_times(courses, zones, 0.5, HORIZON) is None


def test_three_whose_ways_each_cross_the_start_of_the_next_all_leave_at_once():
    ways = [((0, 0), (6, 0)), ((4, 0.2), (4, 6)), ((4.2, 4), (-1, -1))]
    courses, zones = fleet_of(ways)
    forced = [zone for zone in zones if len(zone.orders) == 1]
    assert len(forced) == 3
    times = find_times(courses, zones, 0.5, HORIZON)
    assert [one[0] for one in times] == [0.0, 0.0, 0.0]
    # a start on one's own way has to be left first, whatever the other then does
    for zone in forced:
        assert zone.orders[0].lacks(times, 0.5).max() <= 1e-9


def test_a_robot_between_start_and_goal_of_another_that_is_bound_for_its_place_is_in_the_way():
    """B starts on A's way and its goal is A's start: neither can ever be the first."""
    courses, zones = fleet_of([((0, 0), (6, 0)), ((3, 0.1), (0.3, 0.1))])
    assert [zone.orders for zone in zones] == [[]]
    assert find_times(courses, zones, 0.5, HORIZON) is None
    assert least_delay(courses, zones, 0.5) is None


def every_order(courses, zones, tau):
    """The least sum of delays over all orders in all zones, one after another; None if none is."""
    alone = sum(course.alone for course in courses)
    sums = []
    for orders in itertools.product(*(zone.orders for zone in zones)):
        times = earliest_times(courses, orders, tau, HORIZON)
        if times is not None:
            sums.append(sum(float(one[-1]) for one in times) - alone)
    return min(sums, default=None)


@pytest.mark.parametrize("seed", seeds(12))
def test_the_optimum_is_that_of_trying_every_order(seed):
    dice = random.Random(seed)
    places = [(dice.uniform(0, 5), dice.uniform(0, 5)) for _ in range(2 * dice.choice((3, 4)))]
    ways = list(zip(places[::2], places[1::2], strict=True))
    courses, zones = fleet_of(ways, [dice.choice((0.5, 0.8, 1.0)) for _ in ways], radius=0.1)
    tau = dice.choice((0.0, 0.3, 1.0))
    wanted, found = every_order(courses, zones, tau), least_delay(courses, zones, tau)
    assert (find_times(courses, zones, tau, HORIZON) is None) == (wanted is None)
    if wanted is None:
        assert found is None
    else:
        assert found.proven
        assert found.delay <= wanted + 1e-4
        assert found.reached == pytest.approx(wanted, abs=1e-3 * max(1.0, wanted) + 1e-4)
