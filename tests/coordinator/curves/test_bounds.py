"""What is said to be certain about a curve, against dense samples, quadrature and exact circles."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from coordinator.curves.bounds import bounds, flatten, parameter_of
from coordinator.curves.nurbs import nurbs
from tests.coordinator.curves.random_curves import (
    a_smooth_path,
    any_curves,
    full_circle,
    quarter_circle,
    random_curve,
)

tolerances = st.sampled_from([1.0, 0.1, 0.01, 0.001])


def samples(curve, chain, each):
    """The curve at `each` places of every piece, as (m, each, 2)."""
    parts = np.linspace(0.0, 1.0, each)
    u = chain.u[:-1, None] + np.diff(chain.u)[:, None] * parts
    return curve.evaluate(np.minimum(u, np.nextafter(chain.u[1:, None], 0.0)).ravel()).reshape(
        len(u), each, 2
    )


@settings(max_examples=30, derandomize=True, deadline=None)
@given(any_curves(), tolerances)
def test_a_flattened_curve_is_within_its_bound(curve, tolerance):
    chain = flatten(curve, tolerance)
    assert chain.bound <= tolerance
    chords = shapely.linestrings(np.stack((chain.points[:-1], chain.points[1:]), axis=1))
    places = samples(curve, chain, 21)
    off = shapely.distance(shapely.points(places), chords[:, None])
    assert np.all(off.max(axis=1) <= chain.deviation)
    dense = shapely.LineString(places.reshape(-1, 2))
    middles = 0.5 * (chain.points[:-1] + chain.points[1:])
    steps = np.linalg.norm(np.diff(places, axis=1), axis=2).max()
    assert np.all(shapely.distance(shapely.points(middles), dense) <= chain.deviation + steps)


@settings(max_examples=20, derandomize=True, deadline=None)
@given(any_curves(), tolerances)
def test_the_ends_of_pieces_lie_on_the_curve_where_their_parameters_say(curve, tolerance):
    chain = flatten(curve, tolerance)
    assert chain.u[0] == 0.0
    assert chain.u[-1] == 10.0
    assert np.all(np.diff(chain.u) > 0.0)
    np.testing.assert_allclose(chain.points, curve.evaluate(chain.u), atol=1e-10)


@settings(max_examples=30, derandomize=True, deadline=None)
@given(any_curves(), tolerances)
def test_boxes_hold_the_curve_and_are_no_wider_than_the_deviation(curve, tolerance):
    chain = flatten(curve, tolerance)
    places = samples(curve, chain, 500 // len(chain.deviation) + 5)
    low, high = places.min(axis=1), places.max(axis=1)
    assert np.all(chain.boxes[:, :2] <= low)
    assert np.all(chain.boxes[:, 2:] >= high)
    out = np.maximum(low - chain.boxes[:, :2], chain.boxes[:, 2:] - high)
    assert np.all(out.max(axis=1) <= chain.deviation + 1e-12)


@settings(max_examples=30, derandomize=True, deadline=None)
@given(any_curves())
def test_local_hulls_hold_their_spans(curve):
    chain = flatten(curve, math.inf)
    np.testing.assert_array_equal(chain.u, np.unique(curve.knots))
    places = samples(curve, chain, 60)
    for corners, held in zip(chain.corners, places, strict=True):
        hull = shapely.MultiPoint(corners).convex_hull
        assert shapely.distance(shapely.points(held), hull).max() < 1e-9


def test_local_hulls_are_inside_those_of_the_curves_own_control_points():
    curve = random_curve(3)
    for index, corners in enumerate(flatten(curve, math.inf).corners):
        own = shapely.MultiPoint(curve.points[index : index + 4]).convex_hull
        assert own.buffer(1e-9).covers(shapely.MultiPoint(corners).convex_hull)


def test_a_circles_box_is_exact():
    np.testing.assert_allclose(bounds(full_circle(), 1e-6), [-1.0, -1.0, 1.0, 1.0], atol=1e-6)
    box = bounds(random_curve(3), 1e-5)
    dense = random_curve(3).evaluate(np.linspace(0.0, 10.0, 100_001))
    np.testing.assert_allclose(box, np.append(dense.min(axis=0), dense.max(axis=0)), atol=1.1e-5)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4])
def test_flattening_takes_few_more_chords_than_a_circle_needs(tolerance):
    sagitta = math.acos(1.0 - tolerance)  # half the angle of a chord that is off by the tolerance
    assert len(flatten(quarter_circle(), tolerance).deviation) <= 4.0 * (math.pi / 4) / sagitta
    halved = flatten(quarter_circle(), 1e-3).bound / flatten(quarter_circle(), 1e-5).bound
    assert 16.0 < halved < 1024.0


def test_a_bound_is_nearly_what_the_curve_deviates():
    curve = a_smooth_path()
    chain = flatten(curve, 1e-4)
    chords = shapely.linestrings(np.stack((chain.points[:-1], chain.points[1:]), axis=1))
    off = shapely.distance(shapely.points(samples(curve, chain, 41)), chords[:, None])
    assert chain.bound < 1.1 * off.max()


def test_a_straight_line_is_one_chord():
    chain = flatten(nurbs(1, [0, 0, 1, 1], [[0, 0], [3, 4]]), 1e-6)
    np.testing.assert_array_equal(chain.points, [[0, 0], [3, 4]])
    assert chain.bound < 1e-11
    there_and_back = nurbs(2, [0, 0, 0, 1, 1, 1], [[0, 0], [4, 0], [0, 0]])
    assert flatten(there_and_back, 10.0).bound == pytest.approx(2.0)


def test_halving_stops_and_says_how_far_it_came():
    vast = nurbs(2, [0, 0, 0, 1, 1, 1], [[0, 0], [9e4, 9e4], [0, 1]])
    chain = flatten(vast, 1e-6)
    assert len(chain.deviation) <= 2**16
    assert 1e-6 < chain.bound < 1e-4


def test_a_tolerance_below_rounding_is_refused():
    with pytest.raises(ValueError, match="is not above what rounding takes"):
        flatten(nurbs(1, [0, 0, 1, 1], [[0, 0], [9e4, 0]]), 1e-9)


@pytest.mark.parametrize("tolerance", [0.0, -1.0, math.nan])
def test_a_tolerance_that_is_not_positive_is_refused(tolerance):
    with pytest.raises(ValueError, match="tolerance"):
        flatten(random_curve(1), tolerance)


def test_a_curve_without_hulls_is_refused():
    with pytest.raises(ValueError, match="not both positive"):
        flatten(nurbs(0, [0.0, 1.0], [[0.0, 0.0]]), 0.1)
    with pytest.raises(ValueError, match="not both positive"):
        flatten(nurbs(1, [0, 0, 1, 1], [[0, 0], [1, 0]], [1.0, 0.0]), 0.1)


@pytest.mark.parametrize("seed", range(4))
def test_the_parameter_of_an_arc_length_is_exact(seed):
    curve = random_curve(seed)
    s = np.linspace(-0.1, 1.1, 41) * curve.length
    u = parameter_of(curve, s)
    np.testing.assert_allclose(curve.arc_at(u), np.clip(s, 0.0, curve.length), rtol=0, atol=1e-10)
    assert np.all(np.diff(u) >= 0.0)

    def speed(at):
        return math.hypot(*curve.derivatives(at, 1)[1][0])

    length = quad(speed, 0.0, u[20], points=sorted(set(curve.knots[4:-4])), limit=400)[0]
    assert length == pytest.approx(s[20], abs=1e-8)


def test_the_parameter_of_an_arc_length_on_a_circle_is_that_of_its_angle():
    s = np.linspace(0.0, 2.0 * math.pi, 33)
    places = full_circle().evaluate(parameter_of(full_circle(), s))
    np.testing.assert_allclose(places, np.column_stack((np.cos(s), np.sin(s))), atol=1e-10)


def test_arc_lengths_are_inverted_where_a_curve_all_but_stands():
    cusp = nurbs(3, [0, 0, 0, 0, 1, 1, 1, 1], [[0, 0], [1, 1], [0, 1], [1, 0]])
    s = np.linspace(0.0, cusp.length, 57)
    np.testing.assert_allclose(cusp.arc_at(parameter_of(cusp, s)), s, rtol=0, atol=1e-9)
