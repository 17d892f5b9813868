"""A rational cubic with 12 control points, evaluated by this project, SciPy and geomdl."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.interpolate import BSpline

from benchmarks.table import Row
from benchmarks.timing import median_of
from coordinator.curves.nurbs import Nurbs, nurbs
from protocol.curve import Curve

_POINTS = 10_000
_GEOMDL_POINTS = 500
_RUNS = 31


def curves() -> list[Row]:
    """Measure all evaluators in one run; `geomdl / this` compares geomdl's time with the row's."""
    random = np.random.default_rng(1)
    points, weights = random.uniform(0.0, 10.0, (12, 2)), random.uniform(0.5, 2.0, 12)
    knots = np.concatenate((np.zeros(4), np.arange(1.0, 9.0), np.full(4, 9.0)))
    curve = nurbs(3, knots, points, weights)
    u = np.linspace(0.0, 9.0, _POINTS)
    shuffled = random.permutation(u)
    robot, u_list = Curve(3, knots.tolist(), *points.T.tolist(), weights.tolist()), u.tolist()

    def robot_evaluate() -> None:
        for value in u_list:
            robot.evaluate(value)

    scipy_place, scipy_bend = _scipy(curve)
    geomdl_place, geomdl_bend = _geomdl(curve)
    few = np.linspace(0.0, 9.0, _GEOMDL_POINTS)
    place, bend = median_of(lambda: scipy_place(u), _RUNS), median_of(lambda: scipy_bend(u), _RUNS)
    slow = median_of(lambda: geomdl_place(few), 3) * _POINTS / _GEOMDL_POINTS
    slower = median_of(lambda: geomdl_bend(few), 3) * _POINTS / _GEOMDL_POINTS
    return [
        _row("points: SciPy BSpline, homogeneous", place, place, slow),
        _row("points: geomdl", slow, place, slow),
        _row("points", median_of(lambda: curve.evaluate(u), _RUNS), place, slow),
        _row("points, shuffled", median_of(lambda: curve.evaluate(shuffled), _RUNS), place, slow),
        _row("points: the robot (pure Python)", median_of(robot_evaluate), place, slow),
        _row("two derivatives: SciPy BSpline, homogeneous", bend, bend, slower),
        _row("two derivatives: geomdl", slower, bend, slower),
        _row("two derivatives", median_of(lambda: curve.derivatives(u, 2), _RUNS), bend, slower),
    ]


def _row(what: str, spent: float, scipy: float, geomdl: float) -> Row:
    return {
        "what": what,
        "us per point": 1e6 * spent / _POINTS,
        "times SciPy": spent / scipy,
        "geomdl / this": geomdl / spent,
    }


def _scipy(curve: Nurbs) -> tuple[Callable[[np.ndarray], object], Callable[[np.ndarray], object]]:
    """Return SciPy's evaluation of points, and of points with both derivatives."""
    spline = BSpline(curve.knots, curve.lifted[2], 3)

    def place(u: np.ndarray) -> object:
        lifted = spline(u)
        return lifted[:, :2] / lifted[:, 2:]

    def bend(u: np.ndarray) -> object:
        lifted, first, second = (spline(u, order) for order in range(3))
        w = lifted[:, 2:]
        at = lifted[:, :2] / w
        speed = (first[:, :2] - first[:, 2:] * at) / w
        return at, speed, (second[:, :2] - 2 * first[:, 2:] * speed - second[:, 2:] * at) / w

    return place, bend


def _geomdl(curve: Nurbs) -> tuple[Callable[[np.ndarray], object], Callable[[np.ndarray], object]]:
    """Return geomdl's evaluation of points, and of points with both derivatives."""
    from geomdl import NURBS

    theirs = NURBS.Curve(normalize_kv=False)
    theirs.degree = curve.degree
    theirs.ctrlptsw = curve.lifted[2].tolist()
    theirs.knotvector = curve.knots.tolist()

    def bend(u: np.ndarray) -> object:
        return [theirs.derivatives(at, order=2) for at in u.tolist()]

    return lambda u: theirs.evaluate_list(u.tolist()), bend
