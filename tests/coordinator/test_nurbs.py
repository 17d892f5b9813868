"""Curves against the naive recursion, scipy, an exact circle and the robot's scalar twin."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import BSpline

from coordinator.nurbs import nurbs
from protocol.curve import Curve
from tests.oracles import naive_point


def random_curve(seed, degree=3, count=9, weighted=True, doubled=False):
    random = np.random.default_rng(seed)
    inner = np.sort(random.uniform(0.5, 9.5, count - degree - 1))
    if doubled and len(inner) > 1:
        inner[1] = inner[0]
    knots = np.concatenate((np.zeros(degree + 1), inner, np.full(degree + 1, 10.0)))
    points = np.column_stack((np.linspace(0.0, 8.0, count), random.uniform(0.0, 4.0, count)))
    weights = random.uniform(0.4, 2.5, count) if weighted else np.ones(count)
    return nurbs(degree, knots, points, weights)


def quarter_circle():
    half = math.sqrt(0.5)
    return nurbs(2, [0, 0, 0, 1, 1, 1], [[1, 0], [1, 1], [0, 1]], [1.0, half, 1.0])


@pytest.mark.parametrize("degree", [1, 2, 3, 5])
@pytest.mark.parametrize("seed", range(3))
def test_points_are_those_of_the_naive_recursion(degree, seed):
    curve = random_curve(seed, degree, doubled=degree > 1)
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
        assert curve.arc_at(u)[0] == pytest.approx(wanted, abs=1e-6)
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


def a_smooth_path():
    """A spline as smoothing makes them: knots by arc length, corners of unlike widths."""
    knots = [0, 0, 0, 0, 1.2, 1.5, 1.8, 4.0, 4.002, 4.004, 7, 7, 7, 7]
    greville = [sum(knots[i + 1 : i + 4]) / 3 for i in range(len(knots) - 4)]
    arc, corners = [0.0, 1.5, 4.002, 7.0], [[0, 0], [1.5, 0], [1.5, 2.502], [4.3, 1.431]]
    points = [[np.interp(g, arc, [c[axis] for c in corners]) for axis in (0, 1)] for g in greville]
    return nurbs(3, knots, points)


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
