"""The robot's curve against the naive recursion and SciPy's quadrature."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from protocol.curve import Curve, clamped_knots
from tests.oracles import naive_point

coordinates = st.floats(-5.0, 5.0)


@st.composite
def curves(draw) -> tuple:
    """Draw the arguments of Curve: clamped, inner knots also double, weights 0.5 to 2."""
    degree = draw(st.integers(1, 4))
    count = draw(st.integers(degree + 1, degree + 6))
    gaps = draw(
        st.lists(
            st.sampled_from([0.3, 0.5, 1.0, 2.0]), min_size=count - degree, max_size=count - degree
        )
    )
    inner = list(np.cumsum(gaps))
    if degree > 1 and len(inner) > 2 and draw(st.booleans()):
        inner[1] = inner[0]
    ys = draw(st.lists(coordinates, min_size=count, max_size=count))
    bends = draw(st.lists(st.floats(0.2, 1.5), min_size=count, max_size=count))
    weights = draw(st.lists(st.floats(0.5, 2.0), min_size=count, max_size=count))
    return degree, clamped_knots(degree, inner), list(np.cumsum(bends)), ys, weights


@settings(derandomize=True, max_examples=40, deadline=None)
@given(curves(), st.lists(st.floats(0.0, 1.0), min_size=3, max_size=6))
def test_places_agree_with_the_naive_recursion_in_any_order_of_parameters(curve, parts):
    degree, knots, xs, ys, weights = curve
    tested = Curve(*curve)
    points = list(zip(xs, ys, strict=True))
    for part in (*parts, 0.0, 1.0):
        u = part * knots[-1]
        tested.evaluate(u)
        expected = naive_point(degree, knots, points, weights, u)
        assert (tested.x, tested.y) == pytest.approx(tuple(expected), abs=1e-9)


def test_spans_of_very_unequal_length_are_as_exact_as_even_ones():
    knots = clamped_knots(3, [1e-4, 2e-4, 50.0, 50.001, 90.0])
    xs, ys = [0.0, 0.4, 1.0, 1.6, 2.0, 2.0, 2.3, 3.0], [0.0, 0.1, -0.2, 0.3, 0.9, 1.6, 2.0, 2.1]
    weights = [1.0, 2.0, 0.5, 1.0, 1.5, 0.7, 1.0, 1.0]
    tested = Curve(3, knots, xs, ys, weights)
    points = list(zip(xs, ys, strict=True))
    for u in (0.0, 5e-5, 49.9999, 1.5e-4, 90.0, 50.0005, 2e-4, 70.0, 50.001):
        tested.evaluate(u)
        expected = naive_point(3, knots, points, weights, u)
        assert (tested.x, tested.y) == pytest.approx(tuple(expected), abs=1e-12)


@settings(derandomize=True, max_examples=40, deadline=None)
@given(curves(), st.floats(0.01, 0.99))
def test_derivatives_agree_with_finite_differences(curve, part):
    degree, knots, xs, ys, weights = curve
    u, h = part * knots[-1], 1e-6
    if min(abs(u - knot) for knot in knots) < 1e-3:
        return
    points = list(zip(xs, ys, strict=True))
    after = naive_point(degree, knots, points, weights, u + h)
    before = naive_point(degree, knots, points, weights, u - h)
    tested = Curve(*curve)
    tested.evaluate(u)
    assert (tested.dx, tested.dy) == pytest.approx(tuple((after - before) / (2 * h)), abs=1e-5)


def smooth_curve() -> tuple:
    xs = [0.0, 0.4, 1.0, 1.6, 2.0, 2.0, 2.3, 3.0]
    ys = [0.0, 0.1, -0.2, 0.3, 0.9, 1.6, 2.0, 2.1]
    return 3, clamped_knots(3, [1.0, 2.0, 3.0, 4.0, 5.0]), xs, ys, [1.0] * 8


def arc_length(curve: tuple, u: float) -> float:
    """Return the arc length from 0 to u by SciPy's adaptive quadrature of the naive curve."""
    degree, knots, xs, ys, weights = curve
    points, h = list(zip(xs, ys, strict=True)), 1e-5

    def speed(v: float) -> float:
        a, b = max(v - h, 0.0), min(v + h, knots[-1])
        step = naive_point(degree, knots, points, weights, b) - naive_point(
            degree, knots, points, weights, a
        )
        return math.hypot(*step) / (b - a)

    spans = [knot for knot in sorted(set(knots)) if knot < u] + [u]
    return sum(quad(speed, a, b, epsabs=1e-9)[0] for a, b in itertools.pairwise(spans))


def test_the_length_agrees_with_adaptive_quadrature():
    assert Curve(*smooth_curve()).length == pytest.approx(arc_length(smooth_curve(), 5.0), abs=1e-6)


@pytest.mark.parametrize("part", [0.137, 0.325, 0.5, 0.81, 0.975])
def test_a_place_is_where_its_arc_length_says_to_a_hundred_thousandth_of_the_path(part):
    curve = smooth_curve()
    tested = Curve(*curve)
    s = part * tested.length
    assert arc_length(curve, tested.parameter_at(s)) == pytest.approx(s, abs=1e-5 * tested.length)


def test_the_rational_quarter_circle_is_a_circle_of_the_right_length():
    circle = Curve(
        2, clamped_knots(2, [1.0]), [1.0, 1.0, 0.0], [0.0, 1.0, 1.0], [1.0, math.sqrt(0.5), 1.0]
    )
    assert circle.length == pytest.approx(math.pi / 2, abs=1e-6)
    for s in np.linspace(0.0, math.pi / 2, 50):
        circle.place(s)
        assert (circle.x, circle.y) == pytest.approx((math.cos(s), math.sin(s)), abs=1e-5)
        size = math.hypot(circle.dx, circle.dy)
        assert (circle.dx / size, circle.dy / size) == pytest.approx(
            (-math.sin(s), math.cos(s)), abs=1e-5
        )


def test_arc_length_is_clamped_and_never_runs_backwards():
    curve = Curve(*smooth_curve())
    parameters = [curve.parameter_at(s) for s in np.linspace(-1.0, curve.length + 1.0, 2_000)]
    assert parameters[0] == 0.0
    assert parameters[-1] == pytest.approx(5.0)
    assert min(np.diff(parameters)) >= 0.0


def test_a_straight_line_of_degree_one_is_measured_exactly():
    line = Curve(1, clamped_knots(1, [1.0]), [0.0, 3.0], [0.0, 4.0], [1.0, 1.0])
    assert line.length == pytest.approx(5.0, abs=1e-12)
    line.place(2.5)
    assert (line.x, line.y) == pytest.approx((1.5, 2.0))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({0: 8}, "too few"),
        ({1: [0.0] * 4 + [1.0] * 4}, "need 8 weights and 12 knots"),
        ({1: [1.0] * 4 + [1.5, 2.0, 3.0, 4.0] + [5.0] * 4}, "not from 0 upwards"),
        ({1: [0.0] * 4 + [3.0, 2.0, 1.0, 4.0] + [5.0] * 4}, "decrease"),
        ({1: [0.0] * 4 + [1.0, math.nan, 3.0, 4.0] + [5.0] * 4}, "decrease"),
        ({4: [1.0] * 7 + [0.0]}, "not positive"),
        ({2: [0.0] * 8, 3: [0.0] * 8}, "not a path"),
        ({2: [0.0, 1e7] * 4}, "not a path"),
    ],
)
def test_numbers_that_make_no_curve_are_refused_with_a_reason(changes, message):
    arguments = list(smooth_curve())
    for position, value in changes.items():
        arguments[position] = value
    with pytest.raises(ValueError, match=message):
        Curve(*arguments)


@settings(derandomize=True, max_examples=40, deadline=None)
@given(curves(), st.lists(st.floats(0.0, 1.0), min_size=3, max_size=8))
def test_a_cubic_without_weights_is_placed_as_it_is_evaluated(curve, parts):
    _, _, xs, ys, weights = curve
    assume(len(xs) > 3)
    knots = clamped_knots(3, [0.5 + 0.1 * k for k in range(len(xs) - 3)])
    placed, evaluated = (Curve(3, knots, xs, ys, [1.0] * len(weights)) for _ in range(2))
    for part in (*parts, *sorted(parts), 0.0, 1.0):
        s = part * placed.length
        placed.place(s)
        evaluated.evaluate(evaluated.parameter_at(s))
        assert (placed.x, placed.y) == (evaluated.x, evaluated.y)
        assert (placed.dx, placed.dy) == (evaluated.dx, evaluated.dy)


def test_a_last_span_whose_length_is_lost_beside_that_of_the_others_divides_by_nothing():
    tested = Curve(1, clamped_knots(1, [1.0, 2.0]), [0.0, 1e3, 1e3], [0.0, 0.0, 1e-14], [1.0] * 3)
    tested.place(tested.length)
    assert (tested.x, tested.y) == pytest.approx((1e3, 0.0))
