"""A cubic along a polygon: hats of second derivative at corners, straight lines between them."""

import math

import numpy as np
import pytest

from coordinator.paths.spline_fit import fit, fit_at
from coordinator.paths.spline_fit_kernels import lengths_along
from tests.oracles import naive_point


def flags(count, *chosen):
    found = np.zeros(count, dtype=np.bool_)
    found[[0, -1, *chosen]] = True
    return found


def fitted(polygon, widths, exact=()):
    polygon = np.array(polygon, float)
    return fit(polygon, flags(len(polygon), *exact), np.array(widths, float))


def turned(theta, leg=3.0):
    return [(0, 0), (leg, 0), (leg + leg * math.cos(theta), leg * math.sin(theta))]


def nearest(curve, place):
    u = np.linspace(0.0, curve.knots[-1], 4001)
    for _ in range(3):
        gaps = np.hypot(*(curve.evaluate(u) - place).T)
        k = int(gaps.argmin())
        u = np.linspace(u[max(k - 1, 0)], u[min(k + 1, len(u) - 1)], 1001)
    return float(gaps.min())


@pytest.mark.parametrize("degrees", [3, 45, 90, 140, -60])
def test_a_corner_is_cut_and_bent_as_the_closed_forms_say(degrees):
    theta, width = math.radians(degrees), 1.2
    curve = fitted(turned(theta), [0, width, 0]).curve
    half = abs(theta) / 2
    assert nearest(curve, (3.0, 0.0)) == pytest.approx(width / 3 * math.sin(half), abs=1e-6)
    bend = np.abs(curve.curvature(np.linspace(0, curve.knots[-1], 4001))).max()
    wanted = 2 * math.sin(half) / (width * math.cos(half) ** 2)
    if abs(degrees) <= 100:
        assert bend == pytest.approx(wanted, rel=2e-3)


def test_the_second_derivative_is_a_hat_over_the_corner_and_zero_elsewhere():
    theta, width = math.radians(70), 0.8
    found = fitted(turned(theta), [0, width, 0])
    u = np.linspace(0.0, 6.0, 1201)
    second = found.curve.derivatives(u, 2)[2]
    jump = np.array([math.cos(theta) - 1.0, math.sin(theta)])
    hat = np.maximum(1.0 - np.abs(u - 3.0) / width, 0.0) / width
    np.testing.assert_allclose(second, hat[:, None] * jump, atol=1e-4)


def test_legs_between_corners_are_straight():
    curve = fitted([(0, 0), (6, 0), (6, 6)], [0, 1.0, 0]).curve
    assert np.abs(curve.evaluate(np.linspace(0, 5, 50))[:, 1]).max() < 1e-6
    assert np.abs(curve.evaluate(np.linspace(7, 12, 50))[:, 0] - 6).max() < 1e-6


@pytest.mark.parametrize("width", [0.01, 0.3, 2.9])
@pytest.mark.parametrize("degrees", [1, 60, 100, 170, -90])
def test_exact_vertices_are_passed_whatever_their_width(degrees, width):
    curve = fitted(turned(math.radians(degrees)), [0, width, 0], exact=[1]).curve
    assert nearest(curve, (3.0, 0.0)) < 2e-6


def test_several_exact_vertices_close_together_are_passed():
    polygon = [(0, 0), (1, 0), (1.3, 0.4), (1, 0.9), (1.6, 1.2), (3, 3)]
    curve = fitted(polygon, [0, 0.4, 0.25, 0.25, 0.3, 0], exact=[1, 2, 3, 4]).curve
    for place in polygon:
        assert nearest(curve, place) < 1e-5


def test_the_curve_begins_and_ends_at_the_ends():
    curve = fitted([(0.1, 0.2), (3, 1), (4.4, 5.5)], [0, 1, 0]).curve
    for u, place in ((0.0, (0.1, 0.2)), (curve.knots[-1], (4.4, 5.5))):
        assert math.dist(naive_point(3, curve.knots, curve.points, curve.weights, u), place) < 1e-6


def test_widths_that_do_not_fit_are_shared_out():
    found = fitted([(0, 0), (2, 0), (2, 1), (5, 1)], [0, 2.5, 2.0, 0])
    assert (found.widths[:-1] + found.widths[1:] <= np.diff(found.at) + 1e-12).all()
    knots = found.curve.knots
    assert (np.diff(knots[3:-3]) > 0.0).all()


def test_inner_knots_are_single_so_that_the_curve_is_c2():
    dice = np.random.default_rng(1)
    for _ in range(100):
        polygon = np.cumsum(dice.normal(0.0, 1.0, (8, 2)), axis=0)
        found = fitted(polygon, [0, *dice.uniform(0.002, 1.5, 6), 0], exact=[2, 5])
        inner = found.curve.knots[3:-3]
        assert (np.diff(inner) > 0.0).all()
        # C'' is linear between knots: continued from both sides it must meet.
        size = np.diff(inner)
        ends = []
        for side in (0, 1):
            a, b = (
                found.curve.derivatives(inner[:-1] + size * part, 2)[2] for part in (0.25, 0.75)
            )
            ends.append(1.5 * b - 0.5 * a if side else 1.5 * a - 0.5 * b)
        scale = 1.0 + np.abs(ends[1][:-1])
        assert np.abs((ends[1][:-1] - ends[0][1:]) / scale).max() < 2e-2


def test_all_numbers_are_those_of_the_wire():
    curve = fitted([(0.1, 0.2), (3, 1), (4.4, 5.5)], [0, 0.7, 0]).curve
    for numbers in (curve.knots, curve.points):
        np.testing.assert_array_equal(numbers, numbers.astype(np.float32))
    np.testing.assert_array_equal(curve.weights, 1.0)


def test_a_straight_polygon_needs_four_control_points():
    curve = fitted([(0, 0), (2, 1), (8, 4)], [0, 0.5, 0]).curve
    assert len(curve.points) == 4
    assert curve.length == pytest.approx(math.hypot(8, 4), abs=1e-5)


def test_a_vertex_moved_at_the_same_parameters_changes_the_curve_nearby_only():
    polygon = np.array([(0, 0), (4, 0), (6, 3), (10, 3), (12, 0), (16, 0)], float)
    wide, at = np.array([0, 0.5, 0.5, 0.5, 0.5, 0]), lengths_along(polygon)
    moved = polygon.copy()
    moved[4] += (0.1, -0.4)
    one, other = (fit_at(each, each, flags(6), at, wide).curve for each in (polygon, moved))
    np.testing.assert_array_equal(one.knots, other.knots)
    kept = one.knots[4 : 4 + len(one.points)] < at[3] - 0.5
    np.testing.assert_array_equal(one.points[kept], other.points[kept])
    u = np.linspace(0.0, at[3] - 0.5, 200)
    np.testing.assert_array_equal(one.evaluate(u), other.evaluate(u))


def test_lengths_along_are_those_of_the_legs():
    found = lengths_along(np.array([(0, 0), (3, 4), (3, 5)], float))
    np.testing.assert_allclose(found, [0, 5, 6], rtol=1e-15)


@pytest.mark.parametrize("far", [100.0, 1000.0, 2000.0, 4000.0, 7900.0])
def test_float32_keeps_the_direction_at_both_ends_however_far_from_the_origin(far):
    dice = np.random.default_rng(1)
    for heading in dice.uniform(-math.pi, math.pi, 50):
        along = np.array([math.cos(heading), math.sin(heading)])
        across = np.array([-along[1], along[0]])
        start = dice.uniform(far, far + 10.0, 2)
        polygon = [start, start + 0.129 * along, start + 0.129 * along + 2.0 * across]
        polygon.append(polygon[-1] + 0.129 * along)
        found = fitted(polygon, [0.0, 0.116, 0.116, 0.0])
        for way in np.diff(found.curve.points[[0, 1, -2, -1]], axis=0)[::2]:
            assert math.acos(min(way @ along / np.hypot(*way), 1.0)) < 0.008
