"""One robot among known motions: against brute force over departures, and against sampling."""

import itertools
import math

import numpy as np
import pytest

from coordinator.motion import Motion, SpeedLimits, Wait, limits_on
from coordinator.nurbs import nurbs
from coordinator.schedule import Junctions
from coordinator.waiting import Track, collect_bans, earliest_motion
from coordinator.zones import cut

NEED = 0.5


def line(*corners):
    corners = np.array(corners, dtype=float)
    arc = np.append(0.0, np.cumsum(np.hypot(*np.diff(corners, axis=0).T)))
    return nurbs(1, np.concatenate(([0.0], arc, arc[-1:])), corners)


def a_track(curve, speed=1.0, accel=1.0):
    return Track(SpeedLimits(curve.length, speed**2, accel, ()), cut(curve))


def place(curve, motion, time):
    """c(t) of a motion, by inverting its table of times."""
    s = np.linspace(0.0, curve.length, 4001)
    reached, left = motion.reached(s), motion.left(s)
    first = np.concatenate(([-1e9], reached[1:], [1e9]))
    both = np.sort(np.concatenate((first[:-1], left[:-1], [1e9])))
    at = np.interp(time, both, np.sort(np.concatenate((s, s))))
    return curve.at_arc(at)


def least_gap(curves, motions, tau, step=0.05):
    end = max(motion.finish for motion in motions) + tau
    time = np.arange(0.0, end, step)
    gaps = []
    for shift in np.append(np.arange(-tau, tau, step), tau):
        apart = place(curves[0], motions[0], time) - place(curves[1], motions[1], time + shift)
        gaps.append(np.hypot(*apart.T).min())
    return min(gaps)


def plan_second(curves, first, tau, speed=1.0, accel=1.0):
    tracks = [a_track(curve, speed, accel) for curve in curves]
    junctions = Junctions(tracks, [[NEED] * 2] * 2, tau)
    runs = junctions.runs(1, 0)
    bans = collect_bans([(0, runs, tracks[0].cells, first(tracks[0].limits))], tau)
    return tracks[1], bans, earliest_motion(tracks[1], bans, tracks[1].harmless)


CROSSING = [line((0, 2), (6, 2)), line((3, 0), (3, 6))]
TWICE = [line((0, 2), (12, 2)), line((3, 0), (3, 4), (9, 4), (9, 0))]
FOLLOWING = [line((0, 0), (3, 3), (8, 3), (11, 0)), line((0, 6), (3, 3.2), (8, 3.2), (8, 8))]


@pytest.mark.parametrize("curves", [CROSSING, TWICE, FOLLOWING])
@pytest.mark.parametrize("tau", [0.0, 0.7])
@pytest.mark.parametrize("accel", [0.8, math.inf])
@pytest.mark.parametrize("begin", [0.0, 3.0])
def test_the_motion_found_is_safe_and_as_early_as_any_among_many_waits(curves, tau, accel, begin):
    def first(limits):
        return Motion(limits, [Wait(0.0, begin, -1)])

    track, bans, found = plan_second(curves, first, tau, accel=accel)
    known = first(track.limits if curves is CROSSING else a_track(curves[0], 1.0, accel).limits)
    assert least_gap(curves, (known, found), tau) >= NEED - 1e-3
    best = math.inf
    for waits in _many_waits(track):
        trial = Motion(track.limits, waits)
        if trial.finish < best and _keeps_off(track, bans, trial):
            best = trial.finish
    assert found.finish <= best + 1e-6
    assert found.finish >= best - 0.25


def _many_waits(track):
    """No wait, or one or two waits on a grid of departures."""
    grid = np.arange(0.0, 16.0, 0.1)
    for depart in grid:
        yield [Wait(0.0, depart, -1)]
    for s, depart in itertools.product(track.harmless, grid):
        yield [Wait(s, depart, -1)]
        yield [Wait(0.0, 0.5 * depart, -1), Wait(s, depart, -1)]


def _keeps_off(track, bans, motion):
    """Tell whether the motion is in no banned cell at a banned time."""
    borders = track.cells.borders
    entered = motion.reached(borders[bans.cell])
    left = motion.left(borders[bans.cell + 1])
    return bool(np.all((left <= bans.begin + 1e-9) | (entered >= bans.end - 1e-9)))


def test_a_free_robot_does_not_wait():
    track = a_track(CROSSING[0])
    motion = earliest_motion(track, collect_bans([], 1.0), [])
    assert motion.waits == []
    assert motion.finish == pytest.approx(Motion(track.limits, []).finish)


def test_a_robot_whose_goal_is_crossed_later_waits_until_it_is_free_for_ever():
    curves = [line((0, 3), (6, 3)), line((3, 0), (3, 3))]
    _, _, motion = plan_second(curves, lambda limits: Motion(limits, [Wait(0.0, 5.0, -1)]), 0.5)
    assert motion.finish > 5.0 + 3.0 + NEED + 0.5


def test_a_robot_whose_goal_is_taken_for_ever_finds_no_motion():
    curves = [line((0, 3), (3, 3)), line((3, 0), (3, 3))]
    assert plan_second(curves, lambda limits: Motion(limits, []), 0.5)[2] is None


def test_a_robot_in_whose_start_another_begins_finds_no_motion():
    curves = [line((3, 0), (3, 6)), line((3.2, 0), (6, 0))]
    assert plan_second(curves, lambda limits: Motion(limits, []), 0.5)[2] is None


def test_a_longer_tau_never_makes_the_robot_earlier():
    finishes = []
    for tau in (0.0, 0.2, 0.5, 1.0, 2.0, 4.0):
        _, _, motion = plan_second(TWICE, lambda limits: Motion(limits, []), tau)
        finishes.append(motion.finish)
    assert finishes == sorted(finishes)


def test_the_wait_names_the_robot_that_is_waited_for():
    _, _, motion = plan_second(CROSSING, lambda limits: Motion(limits, []), 1.0)
    assert [wait.owner for wait in motion.waits if wait.owner >= 0] == [0]


def test_a_slow_bend_is_counted_in_every_move():
    half = math.sqrt(0.5)
    bend = nurbs(2, [0, 0, 0, 1, 1, 1], [[1, 0], [1, 1], [0, 1]], [1.0, half, 1.0])
    track = Track(limits_on(bend, 2.0, 1.0, 0.3), cut(bend))
    piece = track.piece(0.0, bend.length)
    assert piece.duration == pytest.approx(Motion(track.limits, []).finish)
    assert np.all(piece.left[:-1] == piece.entered[1:])
