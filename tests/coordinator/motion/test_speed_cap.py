"""Speed in bends: never above the limits, at most 1 % slower than the exact profile, few knots."""

import math
import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.curves.interpolation_kernels import times_at
from coordinator.curves.nurbs import nurbs
from coordinator.motion.profile_simplification_kernels import merged, reachable
from coordinator.motion.velocity_profile import FASTEST_TURN, Motion, Wait, limits_on
from tests.coordinator.motion.legs import speed_knots
from tests.sweeps import seeds

LIMITS = ((0.475, 0.5, 0.5), (1.9, 2.0, 1.0), (0.5, math.inf, 0.5), (2.0, 1.0, 0.2))
"""Speed, acceleration, lateral acceleration."""

TURNING = ((0.475, 0.5, 0.5, 2.0), (1.9, 2.0, 1.0, 1.5), (0.5, 1.0, math.inf, 0.8))
"""The same, and the turn rate."""

SAMPLES = 500
"""Per knot span: 20 times as many as the code under test looks at to begin with."""

KNOT, SPEED = 5, 4
"""Bytes on the wire."""


def a_wild_curve(seed):
    """3 to 20 random control points, random knots, every other one rational; no cusps."""
    while True:
        dice = np.random.default_rng(seed)
        count = int(dice.integers(3, 21))
        degree = min(count - 1, int(dice.integers(2, 4)))
        inner = np.sort(dice.uniform(0.0, 10.0, count - degree - 1))
        weights = dice.uniform(0.3, 3.0, count) if seed % 2 else None
        knots = np.concatenate((np.zeros(degree + 1), inner, np.full(degree + 1, 10.0)))
        curve = nurbs(degree, knots, dice.uniform(0.0, 10.0, (count, 2)), weights)
        if samples(curve)[1].max() < 300.0:
            return curve
        seed += 1000


def a_rounded_polygon(polygon, width):
    """The cubic spline of a polygon whose curvature is a hat of half-width `width` per corner."""
    polygon = np.array(polygon, dtype=float)
    arc = np.append(0.0, np.cumsum(np.hypot(*np.diff(polygon, axis=0).T)))
    inner = np.concatenate((arc[1:-1] - width, arc[1:-1], arc[1:-1] + width))
    knots = np.concatenate((np.zeros(4), np.sort(inner), np.full(4, arc[-1])))
    greville = (knots[1:-3] + knots[2:-2] + knots[3:-1]) / 3.0
    return nurbs(3, knots, np.column_stack([np.interp(greville, arc, part) for part in polygon.T]))


def samples(curve):
    """Places [m] and curvatures [1/m]; twice where knot spans meet."""
    borders = np.unique(curve.knots)
    parts = np.linspace(1e-9, 1.0 - 1e-9, SAMPLES)
    u = (borders[:-1, None] + np.diff(borders)[:, None] * parts).ravel()
    return np.maximum.accumulate(curve.arc_at(u)), np.abs(curve.curvature(u))


def exact_time(s, bend, speed, accel, lateral, turning=math.inf):
    """The fastest time from rest to rest by a forward and a backward pass over samples."""
    bend = np.maximum(bend, 1e-12)
    w = np.minimum(np.minimum(speed**2, lateral / bend), np.square(turning / bend))
    gain = speed**2 / 0.01 if math.isinf(accel) else 2.0 * accel
    w[[0, -1]] = w[[0, -1]] if math.isinf(accel) else 0.0
    w, size = w.tolist(), np.diff(s).tolist()
    for i in range(1, len(w)):
        w[i] = min(w[i], w[i - 1] + gain * size[i - 1])
    for i in range(len(w) - 2, -1, -1):
        w[i] = min(w[i], w[i + 1] + gain * size[i])
    v = np.sqrt(w)
    moving = np.diff(s) > 0.0
    return float(np.sum(2.0 * np.diff(s)[moving] / (v[:-1] + v[1:])[moving]))


def check(curve, speed, accel, lateral, turning=math.inf, loss=0.01):
    """Hold a motion against the limits and the exact time; return its number of knots."""
    turning = min(turning, FASTEST_TURN)
    s, bend = samples(curve)
    knots_s, knots_w = np.array(
        speed_knots(limits_on(curve, speed, accel, lateral, turning), 0.0, curve.length)
    )
    w = np.interp(s, knots_s, knots_w)
    assert np.max(w * bend) <= lateral * (1.0 + 1e-9)
    assert np.max(np.sqrt(w) * bend) <= turning * (1.0 + 1e-9)
    assert np.max(w) <= speed**2 * (1.0 + 1e-9)
    if math.isfinite(accel):
        assert (knots_w[0], knots_w[-1]) == (0.0, 0.0)
        assert np.max(np.abs(np.diff(knots_w)) / np.diff(knots_s)) <= 2.0 * accel * (1.0 + 1e-6)
    took = times_at(knots_s, knots_w, knots_s)[-1]
    exact = exact_time(s, bend, speed, accel, lateral, turning)
    assert exact * (1.0 - 1e-4) <= took <= exact * (1.0 + loss)
    return len(knots_s)


@pytest.mark.parametrize("seed", seeds(32))
def test_wild_curves_are_driven_within_the_limits_and_within_1_percent_of_the_fastest(seed):
    curve = a_wild_curve(seed)
    spans = len(np.unique(curve.knots)) - 1
    # Where bends limit the speed all along, each extreme of curvature is worth a handful of knots.
    assert check(curve, *LIMITS[seed % len(LIMITS)]) <= 10 + 12 * spans


@pytest.mark.parametrize("seed", seeds(24))
def test_turn_rates_hold_on_wild_curves_too(seed):
    # v^2 falls with the square of the curvature: a message has no room for all of its knots.
    check(a_wild_curve(seed), *TURNING[seed % len(TURNING)], loss=0.06)


ZIGZAG = ((0, 0), (3, 0), (4, 3), (7, 2), (10, 6))


@pytest.mark.parametrize("width", [0.05, 0.1, 0.2, 0.3, 0.5, 0.8, 1.2])
def test_corners_take_few_knots(width):
    curve = a_rounded_polygon(ZIGZAG, width)
    assert check(curve, *LIMITS[0]) <= 4 + 3 * 3
    assert check(curve, *LIMITS[1]) <= 4 + 3 * 5
    assert check(curve, *LIMITS[2]) <= 2 + 3 * 5
    assert check(curve, *TURNING[0], loss=0.012) <= 4 + 3 * 5
    assert check(curve, *TURNING[1], loss=0.012) <= 4 + 3 * 9


@pytest.mark.parametrize("width", [0.05, 0.1, 0.2, 0.3, 0.5, 0.8, 1.2])
@pytest.mark.parametrize("seed", range(4))
def test_three_corners_and_three_stops_take_no_more_bytes_than_the_budget_of_350_has(width, seed):
    dice = random.Random(seed)
    curve = a_rounded_polygon(ZIGZAG, width)
    places = sorted(dice.uniform(0.05, 0.95) * curve.length for _ in range(3))
    motion = Motion(limits_on(curve, *LIMITS[0]), [Wait(s, 0.0, -1) for s in places])
    rests = np.isin(motion.knots_s, places)
    speeds = np.unique(np.sqrt(motion.knots_w[~rests]).astype(np.float32))
    assert KNOT * np.count_nonzero(~rests) + SPEED * len(speeds) <= KNOT * 22 + SPEED * 7


def test_a_bend_that_acceleration_keeps_the_robot_slow_in_costs_no_knot():
    curve = a_rounded_polygon(((0, 0), (0.4, 0), (0.4, 6)), 0.2)
    assert samples(curve)[1].max() * 0.5**2 > 2.0
    assert check(curve, 0.5, 0.1, 2.0) == 4


def test_a_sharp_spike_of_curvature_between_samples_is_found():
    # A hairpin drawn by one cubic span: all of the turn happens in a thousandth of the span.
    curve = nurbs(3, [0, 0, 0, 0, 1, 1, 1, 1], [[0, 0], [10, 0.02], [0, 0.03], [10, 0.05]])
    assert check(curve, 1.0, 0.5, 0.3) <= 12


@pytest.mark.parametrize("seed", seeds(16))
def test_what_is_lost_on_a_leg_is_never_more_than_on_the_whole_path(seed):
    curve, (speed, accel, lateral) = a_wild_curve(seed), LIMITS[seed % 2]
    limits = limits_on(curve, speed, accel, lateral)
    s, bend = samples(curve)
    whole = exact_time(s, bend, speed, accel, lateral)
    dice = random.Random(seed)
    for _ in range(2):
        first, last = sorted(dice.sample(range(len(s)), 2))
        part = slice(first, last + 1)
        leg = speed_knots(limits, s[first], s[last])
        assert np.max(np.interp(s[part], *leg) * bend[part]) <= lateral * (1.0 + 1e-9)
        assert np.max(np.abs(np.diff(leg[1])) / np.diff(leg[0])) <= 2.0 * accel * (1.0 + 1e-6)
        exact = exact_time(s[part], bend[part], speed, accel, lateral)
        assert exact * 0.999 <= times_at(*leg, leg[0])[-1] <= exact + 0.01 * whole


STEPS = st.lists(
    st.tuples(st.floats(0.001, 2.0), st.floats(0.01, 4.0)), min_size=2, max_size=30
).map(lambda steps: (np.cumsum([size for size, _ in steps]), np.array([w for _, w in steps])))


def time_along(s, w):
    return float(np.sum(2.0 * np.diff(s) / (np.sqrt(w[:-1]) + np.sqrt(w[1:]))))


@settings(max_examples=60, derandomize=True, deadline=None)
@given(STEPS, st.floats(0.1, 10.0), st.booleans())
def test_what_can_be_reached_is_the_highest_below_the_cap_that_is_not_steeper(cap, rate, rests):
    s, w = reachable(*cap, rate, rests)
    places = np.linspace(cap[0][0], cap[0][-1], 301)
    at = np.union1d(places, cap[0])
    height = np.interp(at, *cap)
    if rests:
        height[[0, -1]] = 0.0
    highest = (height + rate * np.abs(places[:, None] - at)).min(axis=1)
    grid = rate * (places[1] - places[0])
    found = np.interp(places, s, w)
    assert np.all(found <= highest + 1e-9)
    assert np.all(found >= highest - 2.0 * grid)
    assert np.all(np.abs(np.diff(w)) <= rate * np.diff(s) + 1e-9)


@settings(max_examples=60, derandomize=True, deadline=None)
@given(STEPS, st.floats(0.1, 10.0), st.sampled_from([0.0, 0.005, 0.05, 0.5]))
def test_merging_stays_below_keeps_the_ends_and_the_slopes_and_loses_no_more_than_allowed(
    cap, rate, share
):
    s, w = reachable(*cap, rate, True)
    few_s, few_w = merged(s, w, share)
    assert len(few_s) <= len(s)
    assert np.all(np.diff(few_s) > 0.0)
    assert (few_s[0], few_w[0], few_s[-1], few_w[-1]) == (s[0], 0.0, s[-1], 0.0)
    at = np.union1d(s, few_s)
    assert np.all(np.interp(at, few_s, few_w) <= np.interp(at, s, w) * (1.0 + 1e-6) + 1e-12)
    assert np.all(np.abs(np.diff(few_w)) <= rate * np.diff(few_s) * (1.0 + 1e-6) + 1e-12)
    keep = np.append(True, np.diff(s) > 0.0)
    whole = time_along(s[keep], w[keep])
    assert time_along(few_s, few_w) <= whole * (1.0 + share) * (1.0 + 1e-9)


def test_more_time_allowed_means_fewer_knots():
    s = np.linspace(0.0, 10.0, 400)
    w = 1.0 + 0.5 * np.sin(3.0 * s) + 0.1 * np.sin(17.0 * s)
    counts = [len(merged(s, w, share)[0]) for share in (0.0, 1e-4, 1e-3, 1e-2, 1e-1, 10.0)]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] == 400
    assert counts[-1] <= 4
