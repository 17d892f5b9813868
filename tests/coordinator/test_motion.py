"""Speed along a path: limits kept, as fast as dense integration, times in order."""

import math
import random

import numpy as np
import pytest

from coordinator.motion import Box, Motion, SpeedLimits, Wait, limits_on, speed_knots, times_at
from coordinator.nurbs import nurbs
from protocol.timeline import Timeline


def random_limits(seed):
    dice = random.Random(seed)
    length, top = dice.uniform(1.0, 15.0), dice.uniform(0.1, 2.0) ** 2
    borders = sorted(dice.uniform(0.0, length) for _ in range(2 * dice.randint(0, 4)))
    bends = zip(borders[::2], borders[1::2], strict=True)
    boxes = tuple(Box(s0, s1, top * dice.uniform(0.05, 0.9)) for s0, s1 in bends)
    return SpeedLimits(length, top, dice.choice([0.2, 0.7, 3.0]), boxes)


def dense_time(limits, begin, end, count=20000):
    """The fastest time by a forward and a backward pass on a grid."""
    s = np.linspace(begin, end, count + 1)
    w = np.full(count + 1, limits.top)
    for box in limits.bends:
        w[(s >= box.s0) & (s <= box.s1)] = box.w
    w[0] = w[-1] = 0.0
    gain = 2.0 * limits.accel * (end - begin) / count
    for i in range(1, count + 1):
        w[i] = min(w[i], w[i - 1] + gain)
    for i in range(count - 1, -1, -1):
        w[i] = min(w[i], w[i + 1] + gain)
    v = np.sqrt(w)
    return float(np.sum(2.0 * np.diff(s) / (v[:-1] + v[1:])))


@pytest.mark.parametrize("seed", range(30))
def test_the_motion_is_as_fast_as_dense_integration(seed):
    limits = random_limits(seed)
    for begin, end in ((0.0, limits.length), (0.3 * limits.length, 0.8 * limits.length)):
        s, w = speed_knots(limits, begin, end)
        took = times_at(s, w, s)[-1]
        assert took == pytest.approx(dense_time(limits, begin, end), rel=0.01)


@pytest.mark.parametrize("seed", range(30))
def test_all_limits_are_kept(seed):
    limits = random_limits(seed)
    s, w = speed_knots(limits, 0.0, limits.length)
    assert np.all(np.diff(s) > 0.0)
    assert (w[0], w[-1]) == (0.0, 0.0)
    assert np.all(np.abs(np.diff(w)) <= 2.0 * limits.accel * np.diff(s) * (1 + 1e-6) + 1e-9)
    dense = np.linspace(0.0, limits.length, 5001)
    speed = np.interp(dense, s, w)
    assert speed.max() <= limits.top * (1 + 1e-9)
    for box in limits.bends:
        inside = (dense > box.s0) & (dense < box.s1)
        assert np.all(speed[inside] <= box.w + 1e-6)


@pytest.mark.parametrize("seed", range(10))
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
    assert all(0.95 <= box.w <= 1.0 for box in limits.bends)
    assert limits.bends[0].s0 == pytest.approx(0.0)
    assert limits.bends[-1].s1 == pytest.approx(math.pi)


def test_gentle_bends_and_robots_without_a_lateral_limit_slow_nobody():
    assert limits_on(a_bend(), 0.9, 1.0, 0.5).bends == ()
    assert limits_on(a_bend(), 50.0, 1.0, math.inf).bends == ()


@pytest.mark.parametrize("seed", range(12))
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


def test_a_robot_that_starts_in_a_slow_bend_arrives_too():
    s, w = speed_knots(SpeedLimits(5.0, 0.16, 1e4, (Box(0.0, 2.0, 1e-6),)), 0.0, 5.0)
    assert np.all(w[1:-1] > 0.0)
    assert times_at(s, w, s)[-1] == pytest.approx(2000.0 + 7.5, rel=0.01)
