"""Planar NURBS curves on arrays: evaluation, derivatives, arc length and its inverse.

Decides: the numerics of Eq. (5)-(14).  Must not know: robots, floors or wire formats.
protocol/curve.py is the scalar twin that runs on the robot; tests hold the two together.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_CELLS_PER_SPAN: Final = 16


@dataclass(frozen=True, eq=False)
class Nurbs:
    """C(u) = sum_j R_j(u) q_j, Eq. (5) and (7).

    degree k; knots (n + k + 1,), clamped, from 0; points (n, 2) [m]; weights (n,) positive.
    """

    degree: int
    knots: Array
    points: Array
    weights: Array

    @cached_property
    def _homogeneous(self) -> Array:
        return np.column_stack((self.points * self.weights[:, None], self.weights))

    def derivatives(self, u: npt.ArrayLike, order: int) -> list[Array]:
        """Return C and its derivatives up to `order` (at most 2) at parameters u (m,).

        Each is (m, 2).  Quotient rule on A = w C, Eq. (9)-(12); outside the domain u is clamped.
        """
        at = np.clip(np.atleast_1d(np.asarray(u, dtype=np.float64)), 0.0, self.knots[-1])
        knots, control, degree = self.knots, self._homogeneous, self.degree
        lifted = []
        for _ in range(order + 1):
            lifted.append(_de_boor(degree, knots, control, at))
            if degree == 0:
                control = np.zeros_like(control)
                continue
            width = knots[degree + 1 : -1] - knots[1 : -degree - 1]
            scale = degree / np.where(width > 0.0, width, np.inf)
            control = scale[:, None] * np.diff(control, axis=0)
            knots, degree = knots[1:-1], degree - 1
        w = [part[:, 2:] for part in lifted]
        result = [lifted[0][:, :2] / w[0]]
        if order >= 1:
            result.append((lifted[1][:, :2] - w[1] * result[0]) / w[0])
        if order >= 2:
            second = lifted[2][:, :2] - 2.0 * w[1] * result[1] - w[2] * result[0]
            result.append(second / w[0])
        return result

    def evaluate(self, u: npt.ArrayLike) -> Array:
        """Return C(u), (m, 2) [m], for parameters u (m,)."""
        return self.derivatives(u, 0)[0]

    def curvature(self, u: npt.ArrayLike) -> Array:
        """Return the signed curvature [1/m], (m,), left turns positive."""
        _, first, second = self.derivatives(u, 2)
        cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        speed = np.maximum(np.hypot(first[:, 0], first[:, 1]), 1e-12)
        return np.asarray(cross / speed**3)

    @cached_property
    def _table(self) -> tuple[Array, Array, Array]:
        """Cell borders u, arc lengths s there, and du/ds there."""
        spans = np.unique(self.knots)
        parts = np.linspace(0.0, 1.0, _CELLS_PER_SPAN, endpoint=False)
        u = np.append((spans[:-1, None] + np.diff(spans)[:, None] * parts).ravel(), spans[-1])
        half = 0.5 * np.diff(u)
        nodes = (u[:-1] + half)[:, None] + half[:, None] * _NODES
        sizes = half * (self._speed(nodes.ravel()).reshape(nodes.shape) @ _WEIGHTS)
        keep = np.append(True, sizes > 0.0)
        s = np.append(0.0, np.cumsum(sizes))[keep]
        return u[keep], s, 1.0 / np.maximum(self._speed(u[keep]), 1e-9)

    def _speed(self, u: Array) -> Array:
        first = self.derivatives(u, 1)[1]
        return np.asarray(np.hypot(first[:, 0], first[:, 1]))

    @cached_property
    def length(self) -> float:
        """Arc length of the whole curve [m]."""
        return float(self._table[1][-1])

    def parameter_at(self, s: npt.ArrayLike) -> Array:
        """Return the parameters (m,) at arc lengths s (m,) [m], clamped to [0, length]."""
        table_u, table_s, slope = self._table
        at = np.clip(np.atleast_1d(np.asarray(s, dtype=np.float64)), 0.0, table_s[-1])
        cell = np.clip(np.searchsorted(table_s, at, side="right") - 1, 0, len(table_s) - 2)
        size = table_s[cell + 1] - table_s[cell]
        part = (at - table_s[cell]) / size
        rest = 1.0 - part
        left = rest * rest * ((1.0 + 2.0 * part) * table_u[cell] + part * slope[cell] * size)
        right = (3.0 - 2.0 * part) * table_u[cell + 1] - rest * slope[cell + 1] * size
        return np.asarray(left + part * part * right)

    def arc_at(self, u: npt.ArrayLike) -> Array:
        """Return the arc lengths (m,) [m] from the start to parameters u (m,)."""
        table_u, table_s, _ = self._table
        at = np.clip(np.atleast_1d(np.asarray(u, dtype=np.float64)), 0.0, table_u[-1])
        cell = np.clip(np.searchsorted(table_u, at, side="right") - 1, 0, len(table_u) - 2)
        half = 0.5 * (at - table_u[cell])
        nodes = (table_u[cell] + half)[:, None] + half[:, None] * _NODES
        rest = half * (self._speed(nodes.ravel()).reshape(nodes.shape) @ _WEIGHTS)
        return np.asarray(table_s[cell] + rest)

    def at_arc(self, s: npt.ArrayLike) -> Array:
        """Return the points (m, 2) [m] at arc lengths s (m,) [m]."""
        return self.evaluate(self.parameter_at(s))


def nurbs(
    degree: int,
    knots: npt.ArrayLike,
    points: npt.ArrayLike,
    weights: npt.ArrayLike | None = None,
) -> Nurbs:
    """Build a curve from anything array-like; weights default to 1."""
    control = np.asarray(points, dtype=np.float64)
    given = np.ones(len(control)) if weights is None else np.asarray(weights, dtype=np.float64)
    return Nurbs(degree, np.asarray(knots, dtype=np.float64), control, given)


def _de_boor(degree: int, knots: Array, control: Array, u: Array) -> Array:
    """Evaluate a B-spline with control points (n, d) at u (m,) by de Boor's algorithm."""
    span = np.clip(np.searchsorted(knots, u, side="right") - 1, degree, len(control) - 1)
    points = [control[span - degree + i] for i in range(degree + 1)]
    for level in range(1, degree + 1):
        for i in range(degree, level - 1, -1):
            low = knots[span - degree + i]
            part = ((u - low) / (knots[span + 1 + i - level] - low))[:, None]
            points[i] = (1.0 - part) * points[i - 1] + part * points[i]
    return points[degree]
