"""Curves against the naive recursion, scipy, geomdl, exact circles and the robot's twin."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import BSpline

from coordinator.curves.nurbs import nurbs
from protocol.curve import Curve
from tests.coordinator.curves.random_curves import (
    a_smooth_path,
    full_circle,
    quarter_circle,
    random_curve,
)
from tests.oracles import naive_point


@pytest.mark.parametrize("degree", [1, 2, 3, 5, 7, 9])
@pytest.mark.parametrize("seed", range(3))
def test_points_are_those_of_the_naive_recursion(degree, seed):
    curve = random_curve(seed, degree, count=degree + 4, doubled=degree > 1)
    u = np.append(np.linspace(0.0, 10.0, 23), curve.knots)
    naive = [naive_point(degree, curve.knots, curve.points, curve.weights, x) for x in u]
    np.testing.assert_allclose(curve.evaluate(u), naive, atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_derivatives_are_those_of_scipy_in_homogeneous_coordinates(seed):
    curve = random_curve(seed)
    lifted = np.column_stack((curve.points * curve.weights[:, None], curve.weights))
    spline = BSpline(curve.knots, lifted, 3)
    u = np.linspace(0.0, 10.0, 57)
    zeroth, first, second = (spline(u, order) for order in range(3))
    w, dw, ddw = (part[:, 2:] for part in (zeroth, first, second))
    place = zeroth[:, :2] / w
    speed = (first[:, :2] - dw * place) / w
    bend = (second[:, :2] - 2 * dw * speed - ddw * place) / w
    for ours, theirs in zip(curve.derivatives(u, 2), (place, speed, bend), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-9)


def test_derivatives_agree_with_finite_differences():
    curve, step = random_curve(5), 1e-5
    u = np.linspace(0.1, 9.9, 41)
    _, first, second = curve.derivatives(u, 2)
    ahead, here, behind = (curve.evaluate(u + shift) for shift in (step, 0.0, -step))
    np.testing.assert_allclose(first, (ahead - behind) / (2 * step), atol=1e-6)
    np.testing.assert_allclose(second, (ahead - 2 * here + behind) / step**2, atol=1e-3)


def test_a_quarter_circle_is_exact():
    circle = quarter_circle()
    u = np.linspace(0.0, 1.0, 41)
    np.testing.assert_allclose(np.hypot(*circle.evaluate(u).T), 1.0, atol=1e-14)
    np.testing.assert_allclose(circle.curvature(u), 1.0, atol=1e-12)
    assert circle.length == pytest.approx(math.pi / 2, abs=1e-9)
    np.testing.assert_allclose(
        circle.at_arc([math.pi / 6]), [[math.cos(math.pi / 6), 0.5]], atol=1e-6
    )


@pytest.mark.parametrize("degree", range(1, 10))
def test_derivatives_of_any_order_are_those_of_scipy(degree):
    curve = random_curve(degree, degree, count=degree + 5, weighted=False)
    spline, u = BSpline(curve.knots, curve.points, degree), np.linspace(0.0, 10.0, 57)
    for order, ours in enumerate(curve.derivatives(u, degree)):
        theirs = spline(u, order)
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-11 * np.abs(theirs).max())
    np.testing.assert_array_equal(curve.derivatives(u, degree + 2)[degree + 1 :], 0.0)


@pytest.mark.parametrize("degree", range(1, 10))
def test_evaluation_agrees_with_geomdl_weights_and_doubled_knots_included(degree):
    from geomdl import NURBS

    curve = random_curve(degree, degree, count=degree + 5, doubled=degree > 1)
    theirs = NURBS.Curve(normalize_kv=False)
    theirs.degree = degree
    homogeneous = np.column_stack((curve.points * curve.weights[:, None], curve.weights))
    theirs.ctrlptsw = homogeneous.tolist()
    theirs.knotvector = curve.knots.tolist()
    u = np.linspace(0.0, 9.99, 23)
    np.testing.assert_allclose(curve.evaluate(u), theirs.evaluate_list(u.tolist()), atol=1e-12)
    theirs = [theirs.derivatives(at, order=2) for at in u.tolist()]
    for order, ours in enumerate(curve.derivatives(u, 2)):
        np.testing.assert_allclose(ours, [found[order] for found in theirs], rtol=1e-9, atol=1e-9)


def test_derivatives_of_a_rational_circle_are_exact_to_the_sixth():
    """x + i y = (1 + i u)^2 / (1 + u^2) = -1 + 2 / (1 - i u)."""
    circle = nurbs(2, [0, 0, 0, 1, 1, 1], [[1, 0], [1, 1], [0, 1]], [1.0, 1.0, 2.0])
    u = np.linspace(0.0, 1.0, 11)
    np.testing.assert_allclose(circle.evaluate(u) @ [1.0, 1j], -1.0 + 2.0 / (1.0 - 1j * u))
    for order, ours in enumerate(circle.derivatives(u, 6)[1:], start=1):
        wanted = 2.0 * math.factorial(order) * 1j**order / (1.0 - 1j * u) ** (order + 1)
        np.testing.assert_allclose(ours @ [1.0, 1j], wanted, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("weighted", [False, True])
def test_many_points_in_any_order_are_what_each_is_alone(weighted):
    curve = random_curve(6, weighted=weighted, doubled=True)
    u = np.random.default_rng(0).uniform(-1.0, 11.0, 333)
    alone = [[float(x) for x in curve.evaluate(at)[0]] for at in u]
    np.testing.assert_array_equal(curve.evaluate(u), alone)
    np.testing.assert_array_equal(curve.evaluate(np.repeat(u, 2)[::2]), alone)
    s = u * curve.length / 10.0
    np.testing.assert_array_equal(curve.at_arc(s), np.concatenate([curve.at_arc(at) for at in s]))
    np.testing.assert_array_equal(curve.arc_at(u), np.concatenate([curve.arc_at(at) for at in u]))


def test_a_frozen_array_of_parameters_is_as_good_as_any():
    curve, u = random_curve(6), np.linspace(0.0, 10.0, 9)
    frozen = u.copy()
    frozen.flags.writeable = False
    np.testing.assert_array_equal(curve.evaluate(frozen), curve.evaluate(u.tolist()))


def test_no_parameters_give_no_points_and_what_is_no_number_stays_none():
    curve = random_curve(6)
    assert curve.evaluate([]).shape == (0, 2)
    assert curve.arc_at([]).shape == curve.parameter_at([]).shape == (0,)
    assert np.isnan(curve.evaluate([math.nan])).all()
    assert np.isnan(curve.parameter_at(math.nan)).all()


def test_a_full_circle_has_length_two_pi_and_curvature_one():
    circle = full_circle()
    u = np.linspace(0.0, 4.0, 101)
    np.testing.assert_allclose(np.hypot(*circle.evaluate(u).T), 1.0, atol=1e-14)
    np.testing.assert_allclose(circle.curvature(u), 1.0, atol=1e-12)
    assert circle.length == pytest.approx(2.0 * math.pi, abs=1e-12)
    assert circle.arc_at(3.0)[0] == pytest.approx(1.5 * math.pi, abs=1e-12)


def test_a_curve_of_degree_zero_is_its_points_and_stands():
    steps = nurbs(0, [0.0, 1.0, 3.0], [[1.0, 2.0], [5.0, 6.0]])
    np.testing.assert_array_equal(steps.evaluate([0.0, 0.9, 1.0, 3.0])[:, 0], [1, 1, 5, 5])
    np.testing.assert_array_equal(steps.derivatives([0.0, 2.0], 2)[1:], 0.0)


@pytest.mark.parametrize("length", [0.002, 0.01, 0.3, 1.0, 7.0, 19.0, 150.0])
def test_a_straight_line_has_its_exact_length(length):
    assert nurbs(1, [0, 0, length, length], [[0, 0], [length, 0]]).length == length


def test_a_curve_that_never_moves_has_no_length_and_one_place():
    curve = nurbs(3, [0, 0, 0, 0, 1, 2, 2, 2, 2], [[3.0, 4.0]] * 5)
    assert curve.length == 0.0
    np.testing.assert_array_equal(curve.at_arc([-1.0, 0.0, 1.0]), [[3.0, 4.0]] * 3)
    np.testing.assert_array_equal(curve.arc_at([0.0, 0.7, 2.0]), 0.0)


@pytest.mark.parametrize("where", ["start", "middle", "end"])
def test_a_stretch_without_length_is_passed_over(where):
    at = {"start": 0, "middle": 2, "end": 4}[where]
    corners = np.array([[0, 0], [1, 0], [1, 1], [2, 1], [2, 3], [4, 3]], dtype=float)
    corners[at + 1 :] -= corners[at + 1] - corners[at]
    curve = nurbs(1, [0, 0, 1, 2, 3, 4, 5, 5], corners)
    sizes = np.hypot(*np.diff(corners, axis=0).T)
    borders = np.append(0.0, np.cumsum(sizes))
    np.testing.assert_allclose(curve.arc_at(np.arange(6.0)), borders, atol=1e-12)
    np.testing.assert_allclose(curve.arc_at(at + 0.5), borders[at], atol=1e-12)
    np.testing.assert_allclose(curve.at_arc(borders), corners, atol=1e-12)


@pytest.mark.parametrize(
    ("degree", "knots", "points", "weights"),
    [
        (3, [0, 0, 0, 0, 1, 1, 1, 1], [[0, 0]] * 3, [1] * 3),
        (3, [0, 0, 0, 1, 1, 1, 1], [[0, 0]] * 4, [1] * 4),
        (1, [0, 0, 1, 1], [[0, 0]] * 2, [1] * 3),
        (1, [0, 0, 1, 1], [[0, 0, 0]] * 2, [1] * 2),
        (-1, [0, 1], [[0, 0]] * 2, [1] * 2),
    ],
)
def test_shapes_that_do_not_fit_are_refused(degree, knots, points, weights):
    with pytest.raises(ValueError, match="control points"):
        nurbs(degree, knots, points, weights)


def test_a_turn_to_the_right_has_negative_curvature():
    mirrored = quarter_circle().points * [1.0, -1.0]
    curve = nurbs(2, [0, 0, 0, 1, 1, 1], mirrored, quarter_circle().weights)
    assert np.all(curve.curvature([0.2, 0.8]) < 0.0)


@pytest.mark.parametrize("weighted", [False, True])
def test_arc_length_is_that_of_scipy_quadrature(weighted):
    curve = random_curve(3, weighted=weighted)

    def speed(u):
        return float(np.hypot(*curve.derivatives(u, 1)[1][0]))

    for u in (2.5, 7.0, 10.0):
        wanted = quad(speed, 0.0, u, points=sorted(set(curve.knots[4:-4])), limit=400)[0]
        assert curve.arc_at(u)[0] == pytest.approx(wanted, abs=1e-9)
    assert curve.length == pytest.approx(curve.arc_at(10.0)[0], abs=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_the_parameter_at_an_arc_length_has_that_arc_length(seed):
    curve = random_curve(seed, weighted=False)
    s = np.linspace(0.0, curve.length, 301)
    np.testing.assert_allclose(curve.arc_at(curve.parameter_at(s)), s, rtol=0, atol=3e-4)
    assert np.all(np.diff(curve.parameter_at(s)) > 0.0)


def test_on_a_smooth_path_arc_lengths_are_inverted_to_a_hundredth_of_a_millimetre():
    curve = a_smooth_path()
    s = np.linspace(0.0, curve.length, 2001)
    np.testing.assert_allclose(curve.arc_at(curve.parameter_at(s)), s, rtol=0, atol=1e-5)


def test_places_beyond_the_ends_are_the_ends():
    curve = random_curve(1)
    np.testing.assert_array_equal(curve.at_arc([-1.0, 1e9]), curve.evaluate([0.0, 10.0]))
    np.testing.assert_array_equal(curve.evaluate([-3.0, 11.0]), curve.evaluate([0.0, 10.0]))


def test_moving_a_curve_moves_its_points_and_keeps_its_length():
    curve = random_curve(2)
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    moved = nurbs(3, curve.knots, curve.points @ turn.T + [3.0, -1.0], curve.weights)
    u = np.linspace(0.0, 10.0, 31)
    np.testing.assert_allclose(moved.evaluate(u), curve.evaluate(u) @ turn.T + [3.0, -1.0])
    assert moved.length == pytest.approx(curve.length, abs=1e-12)


@pytest.mark.parametrize("curve", [a_smooth_path(), random_curve(8, weighted=False)])
def test_the_robot_finds_the_same_places_as_the_coordinator(curve):
    robot = Curve(
        curve.degree,
        curve.knots.tolist(),
        curve.points[:, 0].tolist(),
        curve.points[:, 1].tolist(),
        curve.weights.tolist(),
    )
    for u in np.linspace(0.0, curve.knots[-1], 101).tolist():
        robot.evaluate(u)
        np.testing.assert_allclose([robot.x, robot.y], curve.evaluate(u)[0], atol=1e-12)
        np.testing.assert_allclose([robot.dx, robot.dy], curve.derivatives(u, 1)[1][0], atol=1e-10)


def test_the_robot_stands_where_the_coordinator_thinks_along_a_smooth_path():
    curve = a_smooth_path()
    xs, ys = curve.points.T.tolist()
    robot = Curve(3, curve.knots.tolist(), xs, ys, curve.weights.tolist())
    assert robot.length == pytest.approx(curve.length, abs=1e-6)
    for s in np.linspace(0.0, curve.length, 701).tolist():
        robot.place(s)
        place = curve.at_arc(s)[0]
        assert math.hypot(robot.x - place[0], robot.y - place[1]) < 1e-5
