"""A path for the search: times against whole motions and against quadrature, ramps against both."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.curves.interpolation_kernels import times_at
from coordinator.motion.velocity_profile import Motion, Wait
from coordinator.schedule.track import CELL
from coordinator.schedule.waiting_kernels import (
    AT_HIGH,
    AT_LOW,
    HIGH,
    LOW,
    PLACE,
    passing_time,
    times_left,
)
from tests.coordinator.curves.random_curves import random_curve
from tests.coordinator.motion.legs import speed_knots
from tests.coordinator.schedule.fleets import line
from tests.coordinator.schedule.fleets_on_lines import bent_track, limits_of_many_kinds, track_on

TRACKS = list(limits_of_many_kinds())


def by_quadrature(track, s):
    """The time to s [s] of a robot at its greatest speed throughout: the integral of ds / v.

    Over x with s = length (1 - cos x) / 2, as the speed may be 0 at both ends.
    """
    places, heights = track.limits.ceiling[:2]
    x = np.linspace(0.0, np.pi, 100_001)
    middles = 0.5 * (x[1:] + x[:-1])
    half = 0.5 * track.limits.length
    speed = np.sqrt(np.interp(half * (1.0 - np.cos(middles)), places, heights))
    spent = half * np.sin(middles) * np.diff(x) / speed
    return np.interp(s, half * (1.0 - np.cos(x)), np.append(0.0, np.cumsum(spent)))


@pytest.mark.parametrize("track", TRACKS)
def test_the_time_alone_is_that_of_a_motion_without_waits(track):
    assert track.alone == pytest.approx(Motion(track.limits, []).finish, abs=1e-9)


@pytest.mark.parametrize("track", TRACKS)
def test_borders_of_cells_are_passed_when_the_integral_says(track):
    length = track.limits.length
    borders = np.minimum(CELL * np.arange(len(track.elapsed)), length)
    assert borders[-1] == length
    assert borders[-2] <= length
    assert np.all(np.diff(track.elapsed) >= 0.0)
    assert track.elapsed == pytest.approx(by_quadrature(track, borders), abs=1e-5)


@pytest.mark.parametrize("track", TRACKS)
def test_a_place_lies_in_the_cell_between_its_borders(track):
    for s in np.random.default_rng(1).uniform(0.0, track.limits.length, 50):
        k = track.cell_at(s)
        assert k * CELL <= s < (k + 1) * CELL
        assert k + 1 < len(track.elapsed)


@pytest.mark.parametrize("track", TRACKS)
def test_the_time_left_is_that_of_the_motion_from_a_rest_there(track):
    length = track.limits.length
    places = [0.0, 0.004, 0.3 * length, 0.77 * length, length - 0.004, length]
    for s, left in zip(places, times_left(track.ride(places)), strict=True):
        motion = Motion(track.limits, [Wait(s, 50.0, -1)] if s < length else [])
        assert left == pytest.approx(motion.finish - 50.0 if s < length else 0.0, abs=1e-9)


@pytest.mark.parametrize("track", TRACKS)
def test_ramps_meet_the_greatest_speed_at_the_stations_ends(track):
    """From rest v^2 = 2 a s: seen on a grid, this is where it exceeds the ceiling first."""
    places = [0.25 * track.limits.length, 0.6 * track.limits.length]
    s = np.linspace(0.0, track.limits.length, 20_001)
    ceiling = np.interp(s, track.ceiling[:, 0], track.ceiling[:, 1])
    for station in track.ride(places).stations:
        fast = 2.0 * track.limits.ramp * np.abs(s - station[PLACE]) >= ceiling * (1.0 + 1e-6)
        if math.isinf(track.limits.accel):
            assert station[LOW] == station[HIGH] == station[PLACE]
            continue
        ahead, behind = fast & (s > station[PLACE]), fast & (s < station[PLACE])
        low = s[np.argmax(ahead)] if ahead.any() else track.limits.length
        high = s[::-1][np.argmax(behind[::-1])] if behind.any() else 0.0
        assert station[LOW] == pytest.approx(low, abs=2e-3)
        assert station[HIGH] == pytest.approx(high, abs=2e-3)
        ends = by_quadrature(track, np.array([low, high]))
        assert station[[AT_LOW, AT_HIGH]] == pytest.approx(ends, abs=2e-2)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(
    track=st.sampled_from(TRACKS),
    shares=st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0)).filter(
        lambda both: abs(both[0] - both[1]) > 1e-3
    ),
)
def test_a_move_between_rests_passes_every_place_when_the_fastest_motion_does(track, shares):
    begin, end = (share * track.limits.length for share in sorted(shares))
    ride = track.ride([begin, end])
    knots = speed_knots(track.limits, begin, end)
    s = np.linspace(begin, end, 41)
    wanted = times_at(*knots, s)
    elapsed = times_at(track.ceiling[:, 0], track.ceiling[:, 1], s)
    for k in range(len(s)):
        assert passing_time(ride, 0, 1, s[k], elapsed[k]) == pytest.approx(wanted[k], abs=1e-6)


@pytest.mark.parametrize("track", TRACKS)
def test_a_motion_with_rests_arrives_after_the_moves_between_them(track):
    places = [0.0, *(share * track.limits.length for share in (0.2, 0.21, 0.8)), None]
    places[-1] = track.limits.length
    ride, now = track.ride(places), 0.0
    for k in range(4):
        now += passing_time(ride, k, k + 1, places[k + 1], track.elapsed[-1])
    motion = Motion(track.limits, [Wait(s, 0.0, -1) for s in places[1:-1]])
    assert motion.finish == pytest.approx(now, abs=1e-6)


def test_lower_limits_never_make_a_path_quicker():
    curve = random_curve(7)
    kinds = [(1.0, math.inf, math.inf), (1.0, 2.0, math.inf), (1.0, 2.0, 0.4), (0.5, 2.0, 0.4)]
    spent = [bent_track(curve, *kind).alone for kind in kinds]
    assert spent == sorted(spent)


def test_a_path_shorter_than_a_cell_takes_its_two_ramps():
    track = track_on(line((0, 0), (0.004, 0)), accel=1.0)
    assert track.alone == pytest.approx(2.0 * math.sqrt(0.004), rel=1e-6)
    assert len(track.elapsed) == 2
