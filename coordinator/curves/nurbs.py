"""Planar NURBS curves on arrays: evaluation, derivatives, arc length and its inverse.

Decides: the interface to the numerics of Eq. (5)-(14) of the paper, which nurbs_kernels.py
computes.  knots.py changes the control points of a curve, bounds.py proves where it runs.  Must not
know: robots, floors or wire formats.  protocol/curve.py computes the same, one point at a time, on
the robot; tests compare the two.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from coordinator.curves import nurbs_kernels as kernels

Array = npt.NDArray[np.float64]


class Homogeneous(NamedTuple):
    """A curve in homogeneous coordinates: degree, knots and control points (n, 3).

    Rows of `control` are (w x, w y, w).
    """

    degree: int
    knots: Array
    control: Array


@dataclass(frozen=True, eq=False)
class Nurbs:
    """A NURBS curve C(u) = sum_j R_j(u) q_j, Eq. (5) and (7), with n control points.

    degree k; knots (n + k + 1,), a clamped knot vector that starts at 0; points (n, 2) [m];
    weights (n,), positive.  Raises ValueError when the shapes do not fit.  The arrays must not be
    changed afterwards.
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
                f"{count} control points of degree {self.degree} need two coordinates each, "
                f"{count} weights and {count + self.degree + 1} knots; the shapes are: points "
                f"{self.points.shape}, weights {self.weights.shape}, knots {self.knots.shape}"
            )

    @cached_property
    def lifted(self) -> Homogeneous:
        """The curve in homogeneous coordinates, in the form that kernels take."""
        control = np.column_stack((self.points * self.weights[:, None], self.weights))
        return Homogeneous(self.degree, _numbers(self.knots), control)

    def derivatives(self, u: npt.ArrayLike, order: int) -> list[Array]:
        """Return C and its derivatives up to any `order` at parameters u (m,), each (m, 2).

        Computed by the quotient rule on A = w C, Eq. (9)-(12).  Parameters are clamped to the
        domain.  At a knot where a derivative jumps, its right limit is returned.
        """
        return list(kernels.derivatives(*self.lifted, _numbers(u), order))

    def evaluate(self, u: npt.ArrayLike) -> Array:
        """Return C(u), (m, 2) [m], for parameters u (m,)."""
        return self.derivatives(u, 0)[0]

    def curvature(self, u: npt.ArrayLike) -> Array:
        """Return the signed curvature (m,) [1/m] at parameters u (m,); left turns are positive."""
        _, first, second = self.derivatives(u, 2)
        cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        speed = np.maximum(np.hypot(first[:, 0], first[:, 1]), 1e-12)
        return np.asarray(cross / (speed * speed * speed))

    @cached_property
    def _series(self) -> kernels.Series:
        return kernels.series(*self.lifted)

    @cached_property
    def _table(self) -> kernels.ArcTable:
        return kernels.arc_table(*self._series)

    @cached_property
    def length(self) -> float:
        """Arc length of the whole curve [m]."""
        return float(self._table.s[-1])

    def parameter_at(self, s: npt.ArrayLike) -> Array:
        """Return the parameters (m,) at arc lengths s (m,) [m], clamped to [0, length].

        Accurate to micrometres on smooth paths; robots interpolate in the same way.  Use
        bounds.parameter_of where that is not accurate enough.
        """
        return kernels.parameters_at(*self._table, _numbers(s))

    def arc_at(self, u: npt.ArrayLike) -> Array:
        """Return the arc lengths (m,) [m] from the start to parameters u (m,)."""
        table = self._table
        return kernels.arcs_at(*self._series, table.u, table.s, _numbers(u))

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
    """Return a new, contiguous, writable array (m,): kernels are compiled for this layout only."""
    return np.array(values, dtype=np.float64, ndmin=1, order="C")
