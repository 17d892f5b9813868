"""Chords against the curves that they stand for, arc length by arc length."""

import numpy as np
import pytest
from hypothesis import given, settings

from coordinator.curves.bounds import parameter_of
from coordinator.curves.chords import chords_of
from coordinator.curves.nurbs import nurbs
from tests.coordinator.curves.random_curves import (
    a_smooth_path,
    any_curves,
    full_circle,
    random_curve,
)


def worst(curve, chords, count=4001):
    """The greatest distance of the curve from its chords at the same arc length, sampled."""
    s = np.linspace(0.0, curve.length, count)
    place = curve.evaluate(parameter_of(curve, s))
    there = np.column_stack([np.interp(s, chords.s, chords.points[:, axis]) for axis in (0, 1)])
    return np.hypot(*(place - there).T).max()


def check_shape(curve, chords):
    assert chords.s.shape == (len(chords.points),)
    assert chords.s[0] == 0.0
    assert chords.s[-1] == curve.length
    assert np.all(np.diff(chords.s) > 0.0)


@settings(max_examples=60, derandomize=True, deadline=None, database=None)
@given(any_curves())
def test_no_point_of_any_curve_is_farther_from_its_chords_than_they_say(curve):
    chords = chords_of(curve, 0.01)
    check_shape(curve, chords)
    assert worst(curve, chords) <= chords.error + 1e-8
    s = np.linspace(0.0, curve.length, 500)
    there = np.column_stack([np.interp(s, chords.s, chords.points[:, axis]) for axis in (0, 1)])
    driven = np.hypot(*(curve.at_arc(s) - there).T)
    assert driven.max() <= chords.error + 1e-8


@pytest.mark.parametrize("tolerance", [1e-2, 5e-4, 1e-5])
@pytest.mark.parametrize("make", [a_smooth_path, full_circle])
def test_the_error_of_smooth_paths_is_within_the_tolerance_and_not_far_below(make, tolerance):
    curve = make()
    chords = chords_of(curve, tolerance)
    check_shape(curve, chords)
    assert worst(curve, chords) <= chords.error <= tolerance
    assert worst(curve, chords) > 0.5 * tolerance


def test_a_circle_takes_hardly_more_chords_than_its_sagitta_asks_for():
    curve = full_circle()
    fewest = 2.0 * np.pi / np.sqrt(8.0 * 5e-4)
    assert fewest <= len(chords_of(curve).s) - 1 <= 1.05 * fewest + 4


def test_a_straight_line_is_one_chord_however_many_knots_it_has():
    knots = [0.0, 0, 0, 0, 1, 2, 3, 7, 8, 8, 8, 8]
    greville = [sum(knots[i + 1 : i + 4]) / 3 for i in range(len(knots) - 4)]
    curve = nurbs(3, knots, np.array([90.0, 70.0]) + np.outer(greville, [4.0, 3.0]))
    chords = chords_of(curve)
    np.testing.assert_allclose(chords.s, [0.0, 40.0], atol=1e-12)
    assert chords.error < 1e-5


def test_corners_of_a_polyline_are_kept():
    curve = nurbs(1, [0.0, 0, 1, 2, 3, 3], [[0, 0], [4, 0], [4, 3], [8, 3]])
    chords = chords_of(curve)
    np.testing.assert_array_equal(chords.s, [0.0, 4.0, 7.0, 11.0])
    np.testing.assert_array_equal(chords.points, curve.points)


@pytest.mark.parametrize("length", [0.0, 1e-12, 1e-6])
def test_a_path_of_nearly_no_length_is_one_chord(length):
    curve = nurbs(3, [0.0, 0, 0, 0, 1, 1, 1, 1], np.linspace([2, 2], [2 + length, 2], 4))
    chords = chords_of(curve)
    assert chords.s.tolist() == [0.0, curve.length]
    assert chords.points.shape == (2, 2)


def test_arc_length_and_not_the_parameter_is_what_chords_follow():
    # Far from even in its parameter: the same line, slowly at first.
    curve = nurbs(2, [0.0, 0, 0, 1, 1, 1], [[0, 0], [2.5, 0], [8, 0]])
    chords = chords_of(curve)
    assert len(chords.s) == 2
    assert worst(curve, chords) <= chords.error <= 6e-4


@pytest.mark.parametrize("seed", range(5))
def test_finer_tolerances_take_chords_by_the_square_root(seed):
    curve = random_curve(seed)
    few, many = len(chords_of(curve, 1e-2).s), len(chords_of(curve, 1e-4).s)
    assert 5 * few < many < 14 * few


def test_what_cannot_be_proven_is_refused():
    with pytest.raises(ValueError, match="not above what rounding takes"):
        chords_of(a_smooth_path(), 1e-13)
    with pytest.raises(ValueError, match="not both positive"):
        chords_of(nurbs(1, [0.0, 0, 1, 1], [[0, 0], [1, 1]], [1.0, -1.0]))
