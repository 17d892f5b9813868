"""Planar NURBS curves on arrays: evaluation, derivatives, arc length and its inverse.

Decides: the numerics of Eq. (5)-(14); nurbs_kernels.py holds the loops, knots.py changes the
control points of a curve, bounds.py proves where it runs.  Must not know: robots, floors or wire
formats.  protocol/curve.py is the robot's scalar twin; tests hold the two together.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from coordinator.curves import nurbs_kernels as kernels

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Nurbs:
    """C(u) = sum_j R_j(u) q_j, Eq. (5) and (7).

    degree k; knots (n + k + 1,), clamped, from 0; points (n, 2) [m]; weights (n,) positive.
    Raises ValueError when the shapes do not fit.  The arrays must not change afterwards.
    """

    degree: int
    knots: Array
    points: Array
    weights: Array

    def __post_init__(self) -> None:
        count = len(self.points)
        if not 0 <= self.degree < count:
            raise ValueError(f"{count} control points do not fit degree {self.degree}")
        if (
            self.points.shape != (count, 2)
            or self.weights.shape != (count,)
            or self.knots.shape != (count + self.degree + 1,)
        ):
            raise ValueError(
                f"{count} control points of degree {self.degree} need {count} weights and "
                f"{count + self.degree + 1} knots, all on the plane: points are "
                f"{self.points.shape}, weights {self.weights.shape}, knots {self.knots.shape}"
            )

    @cached_property
    def lifted(self) -> tuple[int, Array, Array]:
        """Degree, knots and homogeneous control points (n, 3), (w x, w y, w), for kernels."""
        control = np.column_stack((self.points * self.weights[:, None], self.weights))
        return self.degree, _numbers(self.knots), control

    def derivatives(self, u: npt.ArrayLike, order: int) -> list[Array]:
        """Return C and its derivatives up to `order` (any) at parameters u (m,).

        Each is (m, 2).  Quotient rule on A = w C, Eq. (9)-(12); outside the domain u is clamped.
        At a knot where a derivative jumps it is the one to the right.
        """
        return list(kernels.derivatives(*self.lifted, _numbers(u), order))

    def evaluate(self, u: npt.ArrayLike) -> Array:
        """Return C(u), (m, 2) [m], for parameters u (m,)."""
        return self.derivatives(u, 0)[0]

    def curvature(self, u: npt.ArrayLike) -> Array:
        """Return the signed curvature [1/m], (m,), left turns positive."""
        _, first, second = self.derivatives(u, 2)
        cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        speed = np.maximum(np.hypot(first[:, 0], first[:, 1]), 1e-12)
        return np.asarray(cross / (speed * speed * speed))

    @cached_property
    def _series(self) -> tuple[Array, Array]:
        """Borders of spans, and the curve on each as a polynomial."""
        return kernels.series(*self.lifted)

    @cached_property
    def _table(self) -> tuple[Array, Array, Array]:
        """Cell borders u, arc lengths s there, and du/ds there."""
        return kernels.arc_table(*self._series)

    @cached_property
    def length(self) -> float:
        """Arc length of the whole curve [m]."""
        return float(self._table[1][-1])

    def parameter_at(self, s: npt.ArrayLike) -> Array:
        """Return the parameters (m,) at arc lengths s (m,) [m], clamped to [0, length].

        Good to micrometres on smooth paths, and the robots do the same; bounds.parameter_of is
        the exact one.
        """
        return kernels.parameters_at(*self._table, _numbers(s))

    def arc_at(self, u: npt.ArrayLike) -> Array:
        """Return the arc lengths (m,) [m] from the start to parameters u (m,)."""
        return kernels.arcs_at(*self._series, *self._table[:2], _numbers(u))

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


def _numbers(values: npt.ArrayLike) -> Array:
    """Return a fresh, contiguous, writable array (m,): the one layout kernels are compiled for."""
    return np.array(values, dtype=np.float64, ndmin=1, order="C")
