"""A cubic spline along a polygon, and the parameters from which it is made.

The curve is the variation-diminishing spline (Schoenberg) of the polygon, taken as a piecewise
linear function of the parameter: control points are the polygon at the Greville abscissae.  With
the knots a - d, a, a + d around a vertex at parameter a, the second derivative is a hat over that
stretch and zero elsewhere: straight where the polygon is straight, C2 everywhere.  Vertices on a
circle of radius r, one leg apart, turning by t each, may share their knots: their hats add up, and
the curve bends evenly, with a radius of r cos(t / 2)^2 or more.

Decides: knots and control points.  Must not know: what is clear, and how widths are chosen.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from coordinator.curves.nurbs import Array, Nurbs, nurbs
from coordinator.ground.corner_kernels import STRAIGHT
from coordinator.paths.spline_fit_kernels import Flags, apart, bent_out, jumps, lengths_along

_APART: Final = 1e-5
"""Knots are farther apart than this, and than _STEPS_APART float32 steps of the control points:
nearer control points could coincide, and the derivative of the curve would vanish."""
_STEPS_APART: Final = 4.0

_OFF: Final = 0.004
"""Greatest angle [rad] by which float32 may turn the direction at an end.  If it turns more, the
control point next to the end is moved along its leg, by at most _MOST_STEPS steps."""
_MOST_STEPS: Final = 400
_ROUNDS: Final = 40


@dataclass(frozen=True, eq=False)
class Fit:
    """A curve with its polygon: vertices (n, 2) [m], their parameters and half-widths (n,).

    The ends have no width.  exact (n,): whether the curve has to pass the vertex itself.  bent
    (n, 2) [m]: the vertices, those that are exact moved outwards; the control points lie on the
    polygon through these.
    """

    vertices: Array
    bent: Array
    exact: Flags
    at: Array
    widths: Array
    curve: Nurbs


def fit(vertices: Array, exact: Flags, widths: Array, shared: Flags | None = None) -> Fit:
    """Return the curve along a polygon (n, 2) [m]; its parameter is the polygon's arc length.

    shared (n - 1,): legs along a circle, whose ends share their knots; no leg by default.
    """
    rounds = _ROUNDS if exact[1:-1].any() else 0
    bent = bent_out(vertices, exact, widths, rounds)
    return fit_at(vertices, bent, exact, lengths_along(bent), widths, shared)


def fit_at(
    vertices: Array,
    bent: Array,
    exact: Flags,
    at: Array,
    widths: Array,
    shared: Flags | None = None,
) -> Fit:
    """Return the curve along a polygon `bent` (n, 2) whose vertices have given parameters (n,)."""
    shared = np.zeros(len(at) - 1, np.bool_) if shared is None else shared
    widths = apart(at, widths, shared)
    turns = np.hypot(*jumps(bent, at).T) > STRAIGHT
    joins = shared & turns[:-1] & turns[1:]
    begins, ends = turns & ~np.append(False, joins), turns & ~np.append(joins, False)
    inner = np.sort(np.concatenate(((at - widths)[begins], at[turns], (at + widths)[ends])))
    step = float(np.spacing(np.float32(np.abs(bent).max())))
    inner = _spread(inner, at, max(_APART, _STEPS_APART * step))
    knots = np.concatenate((np.full(4, at[0]), inner, np.full(4, at[-1])))
    greville = (knots[1:-3] + knots[2:-2] + knots[3:-1]) / 3.0
    points = np.column_stack([np.interp(greville, at, bent[:, axis]) for axis in (0, 1)])
    points[0], points[-1] = vertices[0], vertices[-1]
    points[1] = _aimed(points[:3], bent[1] - bent[0], step)
    points[-2] = _aimed(points[:-4:-1], bent[-2] - bent[-1], step)
    curve = nurbs(3, knots.astype(np.float32), points.astype(np.float32))
    return Fit(vertices, bent, exact, at, widths, curve)


def _spread(inner: Array, at: Array, apart: float) -> Array:
    """Return inner knots without those nearer than `apart` to one before or 3 `apart` to an end."""
    inside = (inner > at[0] + 3.0 * apart) & (inner < at[-1] - 3.0 * apart)
    inner = inner[inside]
    if np.all(np.diff(inner) > apart):
        return inner
    kept: list[float] = []
    for knot in inner.tolist():
        if not kept or knot > kept[-1] + apart:
            kept.append(knot)
    return np.array(kept)


def _aimed(points: Array, leg: Array, step: float) -> Array:
    """Return the second of an end's control points (3, 2), moved to suit the leg's direction.

    `step` [m]: how far float32 numbers are apart there.
    """
    along = leg / max(float(np.hypot(*leg)), 1e-12)
    near, far = ((points[1:] - points[0]) @ along).tolist()
    if near * _OFF > 1.5 * step:
        return np.asarray(points[1])
    sizes = np.append(near, np.arange(near, min(far, near + _MOST_STEPS * step), step))
    tried = points[0] + sizes[:, None] * along
    ways = tried.astype(np.float32).astype(np.float64) - points[0].astype(np.float32)
    turned = np.abs(np.arctan2(along[0] * ways[:, 1] - along[1] * ways[:, 0], ways @ along))
    good = turned <= _OFF
    return np.asarray(tried[int(good.argmax() if good.any() else turned.argmin())])
