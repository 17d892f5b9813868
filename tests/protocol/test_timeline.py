"""The motion along a path against stepping through it by brute force."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.timeline import Timeline


@st.composite
def motions(draw) -> tuple:
    """Draw the arguments of Timeline; stops lie on knots and between them, some at s = 0."""
    count = draw(st.integers(2, 6))
    gaps = draw(st.lists(st.floats(0.2, 2.0), min_size=count - 1, max_size=count - 1))
    speeds = draw(st.lists(st.sampled_from([0.0, 0.3, 0.5, 1.0]), min_size=count, max_size=count))
    for i in range(1, count):
        if speeds[i] == speeds[i - 1] == 0.0:
            speeds[i] = 0.4
    s = [0.0, *np.cumsum(gaps)]
    places = draw(
        st.lists(st.sampled_from([*s[:-1], 0.5 * s[-1], 0.9 * s[-1]]), unique=True, max_size=3)
    )
    departures = draw(st.lists(st.floats(-1.0, 12.0), min_size=3, max_size=3))
    begin = draw(st.sampled_from([0.0, -2.5, 7.0]))
    return s, speeds, sorted(places), departures[: len(places)], begin


def stepped(motion: tuple, step: float = 1e-4) -> tuple[np.ndarray, np.ndarray]:
    """Return (times, arc lengths) by stepping along s: dt = ds / v, waiting at each stop."""
    knots_s, knots_v, stop_s, stop_depart, begin = motion
    s = np.unique(np.concatenate((np.arange(0.0, knots_s[-1], step), knots_s, stop_s)))
    v = np.sqrt(np.interp(s, knots_s, np.square(knots_v)))
    took = 2.0 * np.diff(s) / (v[1:] + v[:-1])
    times, places, time = [begin], [0.0], begin
    waits = dict(zip(stop_s, stop_depart, strict=True))
    for i in range(len(s)):
        if s[i] in waits:
            time = max(time, waits[s[i]])
            times.append(time)
            places.append(s[i])
        if i < len(took):
            time += took[i]
            times.append(time)
            places.append(s[i + 1])
    return np.array(times), np.array(places)


@settings(derandomize=True, max_examples=30, deadline=None)
@given(motions())
def test_the_motion_agrees_with_stepping_through_it(motion):
    timeline = Timeline(*motion)
    times, places = stepped(motion)
    assert timeline.finish == pytest.approx(times[-1], abs=1e-3)
    for time in np.linspace(times[0] - 1.0, times[-1] + 1.0, 60):
        assert timeline.s_at(time) == pytest.approx(np.interp(time, times, places), abs=1e-3)


@settings(derandomize=True, max_examples=30, deadline=None)
@given(motions(), st.lists(st.floats(-4.0, 40.0), min_size=2, max_size=20))
def test_arc_length_never_runs_backwards_and_is_as_continuous_as_the_speed(motion, times):
    fresh = [Timeline(*motion).s_at(time) for time in times]
    timeline = Timeline(*motion)
    assert [timeline.s_at(time) for time in times] == fresh
    fastest = max(motion[1])
    order = sorted(zip(times, fresh, strict=True))
    for (t0, s0), (t1, s1) in itertools.pairwise(order):
        assert -1e-9 <= s1 - s0 <= fastest * (t1 - t0) + 1e-9
    assert all(0.0 <= s <= timeline.length for s in fresh)


@settings(derandomize=True, max_examples=30, deadline=None)
@given(motions(), st.floats(0.0, 1.0))
def test_speed_is_the_slope_of_arc_length(motion, part):
    timeline, h = Timeline(*motion), 1e-5
    time = motion[4] + part * (timeline.finish - motion[4])
    if any(abs(time - edge) < 2 * h for edge in (*timeline.t0, *timeline.t1)):
        return
    slope = (timeline.s_at(time + h) - timeline.s_at(time - h)) / (2 * h)
    assert timeline.v_at(time) == pytest.approx(slope, abs=1e-3)


def test_a_trapezoid_by_hand():
    timeline = Timeline([0.0, 0.25, 1.75, 2.0], [0.0, 0.5, 0.5, 0.0], [], [])
    assert timeline.finish == pytest.approx(5.0)
    assert timeline.s_at(0.5) == pytest.approx(0.0625)
    assert timeline.s_at(1.0) == pytest.approx(0.25)
    assert (timeline.v_at(2.5), timeline.v_at(-1.0), timeline.v_at(6.0)) == (0.5, 0.0, 0.0)
    assert (timeline.s_at(-3.0), timeline.s_at(99.0)) == (0.0, 2.0)


def test_a_late_start_and_a_wait_are_kept_and_a_departure_gone_by_is_no_stop():
    timeline = Timeline([0.0, 4.0], [1.0, 1.0], [0.0, 1.0, 2.0], [3.0, 6.0, 1.0])
    assert timeline.arrivals == [0.0, 4.0, 7.0]
    assert timeline.finish == 9.0
    assert [timeline.s_at(t) for t in (2.9, 3.5, 5.0, 7.0)] == [0.0, 0.5, 1.0, 2.0]
    assert timeline.next_stop(0.0) == (0.0, 3.0)
    assert timeline.next_stop(3.5) == (1.0, 6.0)
    assert timeline.next_stop(5.0) == (1.0, 6.0)
    assert timeline.next_stop(6.5) is None


def test_a_motion_that_begins_later_is_the_same_motion_later():
    profile = [0.0, 0.25, 1.75, 2.0], [0.0, 0.5, 0.5, 0.0]
    at_once = Timeline(*profile, [0.25], [4.0])
    later = Timeline(*profile, [0.25], [10.0], 6.0)
    assert later.arrivals == [7.0]
    assert later.finish == at_once.finish + 6.0
    for time in np.linspace(-1.0, 10.0, 45):
        assert later.s_at(time + 6.0) == pytest.approx(at_once.s_at(time))
        assert later.v_at(time + 6.0) == pytest.approx(at_once.v_at(time))
    assert later.time_at(0.25) == 7.0
    assert (later.s_at(5.9), later.v_at(5.9)) == (0.0, 0.0)


def test_a_departure_before_the_motion_begins_does_not_make_it_begin_earlier():
    timeline = Timeline([0.0, 4.0], [1.0, 1.0], [0.0], [3.0], 5.0)
    assert (timeline.arrivals, timeline.finish) == ([5.0], 9.0)


def test_a_rest_ends_at_its_departure_and_a_robot_that_drives_does_not_rest():
    timeline = Timeline([0.0, 4.0], [1.0, 1.0], [0.0, 1.0], [3.0, 6.0], 2.0)
    assert [timeline.rest_until(t) for t in (0.0, 2.0, 2.9)] == [3.0, 3.0, 3.0]
    assert [timeline.rest_until(t) for t in (3.0, 3.5)] == [3.0, 3.5]
    assert [timeline.rest_until(t) for t in (4.0, 5.9)] == [6.0, 6.0]
    assert [timeline.rest_until(t) for t in (6.0, 8.5, 9.0, 12.0)] == [6.0, 8.5, 9.0, 12.0]


@pytest.mark.parametrize(
    ("motion", "message"),
    [
        (([0.0], [0.0], [], []), "at least two knots"),
        (([0.0, 1.0], [0.5], [], []), "at least two knots"),
        (([0.1, 1.0], [0.5, 0.5], [], []), "begins at s = 0"),
        (([0.0, 1.0], [0.5, -0.1], [], []), "not a speed"),
        (([0.0, 1.0], [0.5, math.nan], [], []), "not a speed"),
        (([0.0, 0.0], [0.5, 0.5], [], []), "do not increase"),
        (([0.0, 1.0], [0.0, 0.0], [], []), "stand for ever"),
        (([0.0, 1.0], [0.5, 0.5], [1.0], [2.0]), "off the path"),
        (([0.0, 1.0], [0.5, 0.5], [0.5, 0.5], [2.0, 3.0]), "out of order"),
        (([0.0, 1.0], [0.5, 0.5], [0.5], [math.nan]), "not a plan time"),
    ],
)
def test_numbers_that_make_no_motion_are_refused_with_a_reason(motion, message):
    with pytest.raises(ValueError, match=message):
        Timeline(*motion)


def test_the_time_at_a_place_where_a_robot_rests_is_when_it_first_comes_there():
    line = Timeline([0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 1.0, 0.0, 1.0, 0.0], [2.0], [9.0], 0.5)
    assert line.time_at(0.0) == line.t0[0] == 0.5
    assert line.time_at(2.0) == line.t1[1] < line.t0[2] == 9.0
    assert line.time_at(4.0) == line.finish
    for s in (0.3, 1.0, 1.7, 2.2, 3.9):
        assert line.s_at(line.time_at(s)) == pytest.approx(s)
