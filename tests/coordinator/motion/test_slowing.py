"""Lower speeds on stretches of a path."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coordinator.motion.slowing import Slow, slowed
from coordinator.motion.velocity_profile import Motion, SpeedLimits

FREE = SpeedLimits(12.0, 0.64, 0.5, ())

stretches = st.lists(
    st.tuples(st.floats(0.0, 12.0), st.floats(0.1, 4.0), st.floats(0.05, 0.9)), max_size=4
)


@given(stretches)
def test_speeds_stay_below_all_limits_and_accelerations_within_theirs(found):
    slow = [Slow(begin, begin + lasts, speed) for begin, lasts, speed in found]
    motion = Motion(slowed(FREE, slow), [])
    s, w = motion.knots_s, motion.knots_w
    assert w.max() <= FREE.top + 1e-9
    assert np.abs(np.diff(w)[np.diff(s) > 1e-9] / np.diff(s)[np.diff(s) > 1e-9]).max() <= 1.0 + 1e-6
    for begin, end, speed in slow:
        inside = np.linspace(begin + 0.004, min(end, 12.0) - 0.004, 9)
        inside = inside[(inside > begin) & (inside < min(end, 12.0))]
        assert (np.interp(inside, s, w) <= speed * speed + 2e-3).all()


def test_a_stretch_at_half_speed_takes_twice_as_long_and_a_little_more():
    alone, late = (Motion(limits, []) for limits in (FREE, slowed(FREE, [Slow(4.0, 8.0, 0.4)])))
    assert late.finish - alone.finish == pytest.approx(4.0 / 0.4 - 4.0 / 0.8 + 0.4, abs=0.02)


def test_without_stretches_the_limits_stay_the_same():
    assert slowed(FREE, []) is FREE
    assert slowed(FREE, [Slow(3.0, 3.001, 0.1)]) is FREE


def test_robots_without_a_limit_on_acceleration_slow_down_at_once():
    limits = SpeedLimits(12.0, 0.64, math.inf, ())
    motion = Motion(slowed(limits, [Slow(4.0, 8.0, 0.4)]), [])
    assert motion.finish == pytest.approx(8.0 / 0.8 + 4.0 / 0.4, abs=0.02)


def test_a_robot_that_is_slow_from_its_start_to_its_end_speeds_up_as_fast_as_it_can():
    motion = Motion(slowed(FREE, [Slow(0.0, 12.0, 0.4)]), [])
    assert motion.finish == pytest.approx(12.0 / 0.4 + 0.4 / FREE.accel, abs=0.02)


def test_a_sharp_bend_beside_a_slow_stretch_is_taken_no_faster():
    bends = ((0.0, 1.0), (3.9990, 1.0), (3.9995, 1e-7), (4.0, 1e-9), (4.0005, 1e-7), (9.0, 1.0))
    limits = SpeedLimits(9.0, 1.0, math.inf, bends)
    places, heights = slowed(limits, [Slow(1.0, 3.9, 0.5)]).ceiling[:2]
    s, most = np.array(bends).T
    assert np.all(np.interp(s, places, heights) <= most * (1.0 + 1e-6))
