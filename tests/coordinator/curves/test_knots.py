"""Knot insertion and what stands on it: the curve stays what it is, SciPy and geomdl agree."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from coordinator.curves.knots import (
    bezier_form,
    beziers,
    insert_knot,
    piece,
    refine,
)
from coordinator.curves.nurbs import nurbs
from tests.coordinator.curves.random_curves import any_curves, full_circle, random_curve
from tests.oracles import naive_point
from tests.sweeps import seeds

U = np.linspace(0.0, 10.0, 201)
shares = st.floats(0.01, 0.99)


@settings(max_examples=40, derandomize=True, deadline=None)
@given(any_curves(), shares, st.integers(1, 9))
def test_inserting_a_knot_leaves_the_curve_unchanged(curve, share, times):
    times = min(times, curve.degree)
    finer = insert_knot(curve, 10.0 * share, times)
    assert len(finer.points) == len(curve.points) + times
    assert np.count_nonzero(finer.knots == 10.0 * share) == times
    np.testing.assert_allclose(finer.evaluate(U), curve.evaluate(U), atol=1e-11)
    assert finer.weights.min() > 0.0


@pytest.mark.parametrize("degree", [1, 2, 3, 5])
def test_control_points_are_those_of_scipy(degree):
    curve = random_curve(degree, degree, weighted=False)
    spline = BSpline(curve.knots, curve.points, degree)
    for u in (0.2, 3.3, float(curve.knots[degree + 1]), 9.9):
        if np.count_nonzero(curve.knots == u) < degree:
            theirs, ours = spline.insert_knot(u), insert_knot(curve, u)
            np.testing.assert_array_equal(ours.knots, theirs.t)
            np.testing.assert_allclose(ours.points, theirs.c, atol=1e-12)


def test_control_points_and_weights_are_those_of_geomdl():
    from geomdl import NURBS, operations

    curve = random_curve(4)
    theirs = NURBS.Curve(normalize_kv=False)
    theirs.degree = 3
    theirs.ctrlptsw = np.column_stack(
        (curve.points * curve.weights[:, None], curve.weights)
    ).tolist()
    theirs.knotvector = curve.knots.tolist()
    operations.insert_knot(theirs, [4.4], [2])
    ours = insert_knot(curve, 4.4, 2)
    np.testing.assert_allclose(ours.knots, theirs.knotvector, atol=1e-12)
    np.testing.assert_allclose(ours.points, theirs.ctrlpts, atol=1e-12)
    np.testing.assert_allclose(ours.weights, theirs.weights, atol=1e-12)


@settings(max_examples=40, derandomize=True, deadline=None)
@given(any_curves(), shares)
def test_control_points_outside_the_neighbourhood_are_the_same_bits(curve, share):
    u, degree = 10.0 * share, curve.degree
    finer = insert_knot(curve, u)
    span = int(np.searchsorted(curve.knots, u, side="right")) - 1
    for ours, old in ((finer.points, curve.points), (finer.weights, curve.weights)):
        np.testing.assert_array_equal(ours[: span - degree + 1], old[: span - degree + 1])
        np.testing.assert_array_equal(ours[span + 1 :], old[span:])


@pytest.mark.parametrize("seed", seeds(20))
def test_doubling_a_knot_keeps_the_bits_of_all_but_two_control_points(seed):
    curve = random_curve(seed, count=12)
    u = float(curve.knots[7])
    doubled = insert_knot(curve, u)
    np.testing.assert_array_equal(doubled.points[:5], curve.points[:5])
    np.testing.assert_array_equal(doubled.points[7:], curve.points[6:])


def test_a_curve_without_weights_stays_without():
    random = np.random.default_rng(3)
    curve = random_curve(3, 5, count=14, weighted=False)
    finer = refine(curve, random.uniform(0.01, 9.99, 200))
    np.testing.assert_array_equal(finer.weights, 1.0)
    np.testing.assert_allclose(finer.evaluate(U), curve.evaluate(U), atol=1e-12)


def test_the_order_in_which_knots_are_inserted_does_not_matter():
    curve = random_curve(2)
    at_once = refine(curve, [7.0, 1.0, 4.0, 1.0])
    one_by_one = insert_knot(insert_knot(insert_knot(curve, 4.0), 7.0), 1.0, 2)
    np.testing.assert_array_equal(at_once.knots, one_by_one.knots)
    np.testing.assert_allclose(at_once.points, one_by_one.points, atol=1e-13)
    assert refine(curve, []) is curve


def test_a_refined_control_polygon_closes_in_on_the_curve():
    curve = random_curve(5)
    dense = curve.evaluate(np.linspace(0.0, 10.0, 4001))
    gaps = []
    for count in (20, 40, 80):
        finer = refine(curve, np.linspace(0.05, 9.95, count))
        gap = np.linalg.norm(finer.points[:, None] - dense[None], axis=2).min(axis=1)
        gaps.append(gap.max())
    assert gaps[1] < 0.5 * gaps[0]
    assert gaps[2] < 0.5 * gaps[1]


@pytest.mark.parametrize("u", [-1.0, 0.0, 10.0, 11.0, math.nan])
def test_a_knot_that_is_not_inside_is_refused(u):
    with pytest.raises(ValueError, match=r"is not inside the domain from 0 to 10\.0"):
        insert_knot(random_curve(1), u)


def test_a_knot_more_often_than_the_degree_is_refused():
    curve = insert_knot(random_curve(1), 4.0, 2)
    insert_knot(curve, 4.0)
    with pytest.raises(ValueError, match=r"knot 4\.0 would have multiplicity above the degree, 3"):
        insert_knot(curve, 4.0, 2)
    with pytest.raises(ValueError, match="degree, 0"):
        insert_knot(nurbs(0, [0.0, 1.0], [[0.0, 0.0]]), 0.5)


@settings(max_examples=40, derandomize=True, deadline=None)
@given(any_curves(), shares)
def test_the_halves_of_a_cut_curve_meet_and_are_the_curve(curve, share):
    cut = 10.0 * share
    left, right = piece(curve, 0.0, cut), piece(curve, cut, 10.0)
    np.testing.assert_array_equal(left.points[-1], right.points[0])
    for half, size in ((left, cut), (right, 10.0 - cut)):
        ends = half.knots[: half.degree + 1], half.knots[-half.degree - 1 :]
        np.testing.assert_array_equal(ends[0], 0.0)
        np.testing.assert_array_equal(ends[1], size)
    u = np.linspace(0.0, cut, 50)
    np.testing.assert_allclose(left.evaluate(u), curve.evaluate(u), atol=1e-11)
    u = np.linspace(cut, 10.0, 50)[1:]
    np.testing.assert_allclose(right.evaluate(u - cut), curve.evaluate(u), atol=1e-9)
    assert left.length + right.length == pytest.approx(curve.length, rel=1e-3)


def test_a_curve_can_be_cut_at_any_of_its_knots():
    curve = random_curve(2, doubled=True)
    for cut in set(curve.knots[4:-4].tolist()):
        left, right = piece(curve, 0.0, cut), piece(curve, cut, 10.0)
        place = naive_point(3, curve.knots, curve.points, curve.weights, cut)
        np.testing.assert_allclose([left.points[-1], right.points[0]], [place, place], atol=1e-12)


@settings(max_examples=40, derandomize=True, deadline=None)
@given(any_curves(), st.tuples(shares, shares), st.booleans())
def test_a_piece_is_that_part_of_the_curve(curve, ends, whole):
    u0, u1 = (0.0, 10.0) if whole else (10.0 * min(ends), 10.0 * max(ends) + 0.01)
    part = piece(curve, u0, u1)
    u = np.linspace(u0, u1, 50)[1:-1]
    np.testing.assert_allclose(part.evaluate(u - u0), curve.evaluate(u), atol=1e-9)


@pytest.mark.parametrize(("u0", "u1"), [(-1, 2), (3, 3), (4, 3), (5, 11), (0, math.nan)])
def test_a_piece_that_does_not_exist_is_refused(u0, u1):
    with pytest.raises(ValueError, match="there is no piece"):
        piece(random_curve(1), u0, u1)


@settings(max_examples=30, derandomize=True, deadline=None)
@given(any_curves())
def test_bezier_pieces_are_the_curve(curve):
    borders = np.unique(curve.knots)
    pieces = beziers(curve)
    assert len(pieces) == len(borders) - 1
    for bezier, low, high in zip(pieces, borders[:-1], borders[1:], strict=True):
        assert len(bezier.points) == curve.degree + 1
        u = np.linspace(low, high, 9)[:-1]
        np.testing.assert_allclose(bezier.evaluate(u - low), curve.evaluate(u), atol=1e-10)
    for here, there in pairwise(pieces):
        np.testing.assert_array_equal(here.points[-1], there.points[0])


def test_a_circle_is_in_bezier_form_already():
    circle = full_circle()
    assert bezier_form(circle) is circle
    assert [bezier.length for bezier in beziers(circle)] == pytest.approx([math.pi / 2] * 4)
