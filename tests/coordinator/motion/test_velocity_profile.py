"""Speed along a path: limits kept, as fast as dense integration, times in order."""

import math
import random

import numpy as np
import pytest

from coordinator.curves.interpolation_kernels import times_at
from coordinator.curves.nurbs import nurbs
from coordinator.motion.profile_simplification_kernels import reachable
from coordinator.motion.velocity_profile import Motion, SpeedLimits, Wait, limits_on
from protocol.timeline import Timeline
from tests.coordinator.motion.legs import speed_knots
from tests.sweeps import seeds


def random_boxes(seed):
    """Length, top v^2, acceleration, and stretches (s0, s1, v^2) that are slower."""
    dice = random.Random(seed)
    length, top = dice.uniform(1.0, 15.0), dice.uniform(0.1, 2.0) ** 2
    borders = sorted(dice.uniform(0.0, length) for _ in range(2 * dice.randint(0, 4)))
    bends = zip(borders[::2], borders[1::2], strict=True)
    boxes = [(s0, s1, top * dice.uniform(0.05, 0.9)) for s0, s1 in bends]
    return length, top, dice.choice([0.2, 0.7, 3.0]), boxes


def random_limits(seed):
    length, top, accel, boxes = random_boxes(seed)
    if not boxes:
        return SpeedLimits(length, top, accel, ())
    steps = [(0.0, top)]
    for s0, s1, w in boxes:
        steps += [(s0, top), (s0, w), (s1, w), (s1, top)]
    s, w = np.array([*steps, (length, top)]).T.copy()
    s, w = reachable(s, w, 2.0 * accel, True)
    keep = np.append(np.diff(s) > 0.0, True)
    return SpeedLimits(length, top, accel, tuple(zip(s[keep], w[keep], strict=True)))


def dense_time(seed, begin, end, count=20000):
    """The fastest time by a forward and a backward pass on a grid."""
    _, top, accel, boxes = random_boxes(seed)
    s = np.linspace(begin, end, count + 1)
    w = np.full(count + 1, top)
    for s0, s1, slow in boxes:
        w[(s >= s0) & (s <= s1)] = slow
    w[0] = w[-1] = 0.0
    gain = 2.0 * accel * (end - begin) / count
    for i in range(1, count + 1):
        w[i] = min(w[i], w[i - 1] + gain)
    for i in range(count - 1, -1, -1):
        w[i] = min(w[i], w[i + 1] + gain)
    v = np.sqrt(w)
    return float(np.sum(2.0 * np.diff(s) / (v[:-1] + v[1:])))


@pytest.mark.parametrize("seed", seeds(30))
def test_the_motion_is_as_fast_as_dense_integration(seed):
    limits = random_limits(seed)
    for begin, end in ((0.0, limits.length), (0.3 * limits.length, 0.8 * limits.length)):
        s, w = speed_knots(limits, begin, end)
        took = times_at(s, w, s)[-1]
        assert took == pytest.approx(dense_time(seed, begin, end), rel=0.002)


@pytest.mark.parametrize("seed", seeds(30))
def test_all_limits_are_kept_on_every_leg(seed):
    length, top, accel, boxes = random_boxes(seed)
    limits, dice = random_limits(seed), random.Random(seed)
    legs = [(0.0, length)] + [sorted(dice.uniform(0.0, length) for _ in "ab") for _ in range(20)]
    for begin, end in legs:
        s, w = speed_knots(limits, begin, end)
        assert np.all(np.diff(s) > 0.0)
        assert (s[0], w[0], s[-1], w[-1]) == (begin, 0.0, end, 0.0)
        assert np.all(np.abs(np.diff(w)) <= 2.0 * accel * np.diff(s) * (1 + 1e-6) + 1e-9)
        dense = np.linspace(begin, end, 2001)
        speed = np.interp(dense, s, w)
        assert speed.max() <= top * (1 + 1e-9)
        for s0, s1, slow in boxes:
            assert np.all(speed[(dense > s0) & (dense < s1)] <= slow + 1e-6)


@pytest.mark.parametrize("seed", seeds(10))
def test_times_increase_along_the_path_and_agree_with_small_steps(seed):
    limits = random_limits(seed)
    s, w = speed_knots(limits, 0.0, limits.length)
    dense = np.linspace(0.0, limits.length, 40001)
    times = times_at(s, w, dense)
    assert np.all(np.diff(times) > 0.0)
    v = np.sqrt(np.interp(dense, s, w))
    stepped = np.sum(2.0 * np.diff(dense) / np.maximum(v[:-1] + v[1:], 1e-9))
    assert times[-1] == pytest.approx(stepped, rel=1e-3)


def test_a_robot_without_a_limit_on_acceleration_has_its_speed_at_once():
    s, w = speed_knots(SpeedLimits(6.0, 0.25, math.inf, ()), 0.0, 6.0)
    assert times_at(s, w, np.array([3.0, 6.0])).tolist() == pytest.approx([6.0, 12.0])


def a_bend():
    half = math.sqrt(0.5)
    return nurbs(2, [0, 0, 0, 1, 1, 1], [[2, 0], [2, 2], [0, 2]], [1.0, half, 1.0])


def test_a_bend_is_taken_at_the_lateral_limit():
    limits = limits_on(a_bend(), 5.0, 100.0, 0.5)
    s, w = np.array(limits.bends).T
    inside = np.linspace(0.01, math.pi - 0.01, 500)
    assert np.interp(inside, s, w) == pytest.approx(1.0, rel=0.01)
    assert np.interp(inside, s, w).max() <= 1.0
    assert (s[0], w[0], w[-1]) == (0.0, 0.0, 0.0)
    assert s[-1] == pytest.approx(math.pi)


def test_gentle_bends_and_robots_without_a_lateral_limit_slow_nobody():
    assert limits_on(a_bend(), 0.9, 1.0, 0.5).bends == ()
    assert limits_on(a_bend(), 30.0, 1.0, math.inf).bends == ()


@pytest.mark.parametrize("seed", seeds(12))
@pytest.mark.parametrize("at_once", [False, True])
def test_the_robots_timeline_agrees_with_the_motion(seed, at_once):
    limits, dice = random_limits(seed), random.Random(seed)
    if at_once:
        limits = SpeedLimits(limits.length, limits.top, math.inf, ())
    waits = [Wait(0.0, dice.uniform(0.0, 4.0), -1)]
    waits += [Wait(part * limits.length, dice.uniform(0.0, 60.0), -1) for part in (0.3, 0.7)]
    motion = Motion(limits, waits)
    keep = np.append(True, np.diff(motion.knots_s) > 0.0)
    timeline = Timeline(
        motion.knots_s[keep].tolist(),
        np.sqrt(motion.knots_w[keep]).tolist(),
        [wait.s for wait in waits],
        [wait.depart for wait in waits],
    )
    assert timeline.finish == pytest.approx(motion.finish, abs=1e-9)
    assert motion.arrivals[1:] == pytest.approx(timeline.arrivals[1:])
    inner = np.linspace(0.01, 0.99, 197) * limits.length
    for s, reached, left in zip(inner, motion.reached(inner), motion.left(inner), strict=True):
        assert timeline.s_at(reached) == pytest.approx(s, abs=1e-7)
        assert timeline.s_at(left) == pytest.approx(s, abs=1e-7)
        assert left >= reached


def test_a_wait_keeps_the_robot_from_its_arrival_to_its_departure():
    limits = SpeedLimits(10.0, 1.0, 1.0, ())
    motion = Motion(limits, [Wait(0.0, 2.0, -1), Wait(4.0, 20.0, 3)])
    assert motion.start_time == 2.0
    assert motion.arrivals[1] == pytest.approx(2.0 + 5.0)
    assert motion.reached(np.array([4.0]))[0] == pytest.approx(7.0)
    assert motion.left(np.array([4.0]))[0] == pytest.approx(20.0)
    assert motion.finish == pytest.approx(27.0)


def test_the_start_is_always_reached_and_the_goal_is_never_left():
    motion = Motion(SpeedLimits(3.0, 1.0, 1.0, ()), [])
    assert motion.reached(np.array([0.0]))[0] == -math.inf
    assert motion.left(np.array([3.0]))[0] == math.inf


def test_a_wait_that_ends_before_the_arrival_costs_only_the_stop():
    limits = SpeedLimits(10.0, 1.0, 1.0, ())
    assert Motion(limits, [Wait(5.0, 0.0, -1)]).finish == pytest.approx(12.0)
    assert Motion(limits, []).finish == pytest.approx(11.0)


@pytest.mark.parametrize(("speed", "accel"), [(1e-6, 1.0), (0.001, 1.0), (0.4, 1e5), (900.0, 1e5)])
def test_slow_robots_and_strong_motors_arrive_too(speed, accel):
    s, w = speed_knots(SpeedLimits(5.0, speed**2, accel, ()), 0.0, 5.0)
    assert (s[0], w[0], s[-1], w[-1]) == (0.0, 0.0, 5.0, 0.0)
    assert np.all(w[1:-1] > 0.0)
    took = times_at(s, w, s)[-1]
    alone = 5.0 / speed + speed / accel if speed**2 < 5.0 * accel else 2.0 * math.sqrt(5.0 / accel)
    assert alone - 1e-9 <= took <= 1.01 * alone


def test_a_robot_that_starts_or_rests_in_a_slow_bend_arrives_too():
    bends = ((0.0, 1e-6), (2.0, 1e-6), (2.0001, 0.16), (5.0, 0.16))
    limits = SpeedLimits(5.0, 0.16, 1e4, bends)
    for begin, alone in ((0.0, 2000.0 + 7.5), (1.0, 1000.0 + 7.5)):
        s, w = speed_knots(limits, begin, 5.0)
        assert np.all(w[1:-1] > 0.0)
        assert times_at(s, w, s)[-1] == pytest.approx(alone, rel=0.01)


def test_a_leg_shorter_than_any_ramp_is_driven_too():
    limits = SpeedLimits(5.0, 0.16, 1e4, ((0.0, 1e-6), (2.0, 1e-6), (2.0001, 0.16), (5.0, 0.16)))
    for begin in (0.0, 1.0, 3.0):
        s, w = speed_knots(limits, begin, begin + 3e-5)
        assert (s[0], w[0], s[-1], w[-1]) == (begin, 0.0, begin + 3e-5, 0.0)
        assert 0.0 < w[1] <= (1e-6 if begin < 2.0 else 0.16)


def test_a_bend_that_is_hardly_passed_at_all_is_passed_no_faster():
    """Beside a top speed of 10 m/s, 0.1 and 0.3 mm/s are the same to a billionth of v^2."""
    dip = ((2.499, 1e-7), (2.5, 1.85e-8), (2.501, 1e-7))
    limits = SpeedLimits(5.0, 100.0, math.inf, ((0.0, 100.0), (2.0, 100.0), *dip, (5.0, 100.0)))
    s, w = speed_knots(limits, 0.0, 5.0)
    places, most = np.array(limits.bends).T
    assert np.all(np.interp(places, s, w) <= most * (1.0 + 1e-9))
