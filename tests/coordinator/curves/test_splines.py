"""Curves put together from pieces: what was cut is whole again, what is raised stays itself."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from coordinator.curves.knots import piece
from coordinator.curves.nurbs import nurbs
from coordinator.curves.splines import elevated, joined
from coordinator.paths.corners import corners, rounded
from tests.coordinator.curves.random_curves import (
    a_smooth_path,
    any_curves,
    quarter_circle,
    random_curve,
)
from tests.oracles import naive_point


def along(curve, count=200):
    """Points by the curve's own share of arc length: the parameter does not matter."""
    return curve.at_arc(np.linspace(0.0, curve.length, count))


@settings(max_examples=60, derandomize=True, deadline=None)
@given(any_curves(), st.integers(0, 3))
def test_a_bezier_piece_of_a_higher_degree_is_the_same_curve(curve, more):
    first = piece(curve, 0.0, float(np.unique(curve.knots)[1]))
    lifted = elevated(first.lifted[2], first.degree + more)
    degree, end = first.degree + more, first.knots[-1]
    knots = [0.0] * (degree + 1) + [end] * (degree + 1)
    for u in np.linspace(0.0, end, 7)[:-1]:
        raised = naive_point(degree, knots, lifted[:, :2] / lifted[:, 2:], lifted[:, 2], u)
        np.testing.assert_allclose(raised, first.evaluate([u])[0], atol=1e-9)


@settings(max_examples=60, derandomize=True, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 6), st.booleans(), st.data())
def test_a_curve_that_was_cut_is_whole_again_with_its_own_knots(seed, degree, weighted, data):
    curve = random_curve(seed, degree, degree + 5, weighted=weighted)
    cuts = sorted(data.draw(st.sets(st.floats(0.3, 9.7), max_size=3)))
    ends = [0.0, *cuts, 10.0]
    parts = [piece(curve, a, b) for a, b in pairwise(ends) if b - a > 1e-3]
    if sum(part.knots[-1] for part in parts) < 10.0 - 1e-9:
        return
    whole = joined(parts)
    again = whole.evaluate(np.linspace(0.0, whole.knots[-1], 99))
    np.testing.assert_allclose(again, curve.evaluate(np.linspace(0.0, 10.0, 99)), atol=1e-6)


def test_a_smooth_path_cut_anywhere_gets_its_control_points_back():
    path = a_smooth_path()
    parts = [piece(path, a, b) for a, b in ((0.0, 0.7), (0.7, 1.4), (1.4, 5.0), (5.0, 7.0))]
    whole = joined(parts)
    assert len(whole.points) == len(path.points)
    np.testing.assert_allclose(whole.points, path.points, atol=1e-10)
    np.testing.assert_allclose(whole.knots / whole.knots[-1], path.knots / 7.0, atol=1e-12)


def test_knots_a_hair_apart_stay_as_they_are():
    knots = [0, 0, 0, 0, 1.2779185, 1.2779303, 1.2779421, 5.0, 7.0, 7.0, 7.0, 7.0]
    points = [(0, 0), (1, 0.4), (2, 0.801), (3, 1.2), (4, 1.6), (5, 2.5), (6, 2.0), (7, 2.0)]
    path = nurbs(3, knots, points)
    for parts in ([path], [piece(path, 0.0, 3.0), piece(path, 3.0, 7.0)]):
        whole = joined(parts)
        assert len(whole.points) == len(points)
        np.testing.assert_allclose(whole.points, points, atol=1e-9)
        assert (whole.weights == 1.0).all()


def test_pieces_of_unlike_degrees_make_one_curve():
    line = nurbs(1, [0, 0, 1, 1], [[1.0, -3.0], [1.0, 0.0]])
    arc = quarter_circle()
    onward = nurbs(3, [0, 0, 0, 0, 2, 2, 2, 2], [[0, 1], [-1, 1], [-2, 1], [-3, 2]])
    whole = joined([line, arc, onward])
    assert whole.degree == 3
    assert corners(whole) == []
    assert whole.length == pytest.approx(3.0 + np.pi / 2 + onward.length, abs=1e-6)
    turned = whole.at_arc(3.0 + np.linspace(0.0, np.pi / 2, 30))
    np.testing.assert_allclose(np.hypot(*turned.T), 1.0, atol=1e-6)


def test_a_joint_keeps_a_corner():
    legs = [nurbs(1, [0, 0, 1, 1], ends) for ends in ([[0, 0], [4, 0]], [[4, 0], [4, 3]])]
    whole = joined(legs)
    (corner,) = corners(whole)
    assert corner.place == (4.0, 0.0)
    assert corner.turn == pytest.approx(np.pi / 2)
    assert whole.knots.tolist() == [0.0, 0.0, 4.0, 7.0, 7.0]


def test_a_spline_is_what_scipy_says():
    curve = random_curve(4, 3, 9, weighted=False)
    whole = joined([piece(curve, 0.0, 2.5), piece(curve, 2.5, 10.0)])
    u = np.linspace(0.0, whole.knots[-1], 50)
    np.testing.assert_allclose(
        BSpline(whole.knots, whole.points, 3)(u), curve.evaluate(u * 10.0 / u[-1]), atol=1e-8
    )


def test_corners_between_lines_are_rounded_and_bends_stay():
    line = nurbs(1, [0, 0, 0.5, 1, 1], [[-2.0, -3.0], [1.0, -3.0], [1.0, 0.0]])
    curve = joined([line, quarter_circle()])
    smooth = rounded(curve, 0.05)
    assert len(corners(curve)) == 1
    assert corners(smooth) == []
    end = smooth.at_arc(smooth.length - np.linspace(0.0, np.pi / 2, 30))
    np.testing.assert_allclose(np.hypot(*end.T), 1.0, atol=1e-6)


def test_a_corner_beside_a_bend_is_not_rounded():
    line = nurbs(1, [0, 0, 1, 1], [[-2.0, 0.0], [1.0, 0.0]])
    assert len(corners(rounded(joined([line, quarter_circle()]), 0.05))) == 1
