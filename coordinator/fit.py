"""A cubic spline along a polygon, and the numbers it came from.

The curve is the variation-diminishing spline (Schoenberg) of the polygon, taken as a piecewise
linear function of the parameter: control points are the polygon at the Greville abscissae.  With
the knots a - d, a, a + d around a vertex at parameter a, the second derivative is a hat over that
stretch and zero elsewhere: straight where the polygon is straight, C2 everywhere.

Decides: knots and control points.  Must not know: what is clear, and how widths are chosen.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from coordinator.corner_kernels import STRAIGHT
from coordinator.nurbs import Array, Nurbs, nurbs

Flags = npt.NDArray[np.bool_]

_APART: Final = 1e-5
_ROUNDS: Final = 40


@dataclass(frozen=True, eq=False)
class Fit:
    """A curve with its polygon: vertices (n, 2) [m], their parameters and half-widths (n,).

    The ends have no width.  `exact` (n,): vertices that the curve passes; `bent` (n, 2) is the
    polygon with these moved out, which the control points lie on.
    """

    vertices: Array
    bent: Array
    exact: Flags
    at: Array
    widths: Array
    curve: Nurbs


def fit(vertices: Array, exact: Flags, widths: Array) -> Fit:
    """Return the curve along a polygon (n, 2) [m] by arc length; widths (n,) [m]."""
    bent, at = vertices, lengths_along(vertices)
    for _ in range(_ROUNDS if exact[1:-1].any() else 0):
        further = bent_out(vertices, bent, exact, at, widths)
        if np.array_equal(further, bent):
            break
        bent, at = further, lengths_along(further)
    return fit_at(vertices, bent, exact, at, widths)


def fit_at(vertices: Array, bent: Array, exact: Flags, at: Array, widths: Array) -> Fit:
    """Return the curve along a polygon `bent` (n, 2) whose vertices have given parameters (n,)."""
    widths = _apart(at, widths)
    turns = np.flatnonzero(np.hypot(*_jumps(bent, at).T) > STRAIGHT)
    center, width = at[turns], widths[turns]
    inner = np.sort(np.concatenate((center - width, center, center + width)))
    inner = inner[(inner > at[0] + _APART) & (inner < at[-1] - _APART)]
    inner = inner[np.append(True, np.diff(inner) > _APART)] if len(inner) else inner
    knots = np.concatenate((np.full(4, at[0]), inner, np.full(4, at[-1])))
    greville = (knots[1:-3] + knots[2:-2] + knots[3:-1]) / 3.0
    points = np.column_stack([np.interp(greville, at, bent[:, axis]) for axis in (0, 1)])
    points[0], points[-1] = vertices[0], vertices[-1]
    curve = nurbs(3, knots.astype(np.float32), points.astype(np.float32))
    return Fit(vertices, bent, exact, at, widths, curve)


def lengths_along(vertices: Array) -> Array:
    """Return the arc lengths (n,) [m] of a polygon's vertices (n, 2) [m]."""
    legs = np.diff(vertices, axis=0)
    return np.append(0.0, np.cumsum(np.hypot(legs[:, 0], legs[:, 1])))


def bent_out(vertices: Array, bent: Array, exact: Flags, at: Array, widths: Array) -> Array:
    """Move exact vertices out by the cut d / 6 * (t1 - t0), so that the curve passes them."""
    moved = vertices.copy()
    inner = np.flatnonzero(exact[1:-1]) + 1
    width = _apart(at, widths)[inner]
    moved[inner] -= _jumps(bent, at)[inner] * (width / 6.0)[:, None]
    return moved


def _jumps(vertices: Array, at: Array) -> Array:
    """Return the change of dC/du (n, 2) at each vertex of the polygon; zero at the ends."""
    slopes = np.diff(vertices, axis=0) / np.maximum(np.diff(at), 1e-12)[:, None]
    jumps = np.zeros_like(vertices)
    jumps[1:-1] = np.diff(slopes, axis=0)
    return jumps


def _apart(at: Array, widths: Array) -> Array:
    """Return widths that fit: neighbours share a leg, the first and last keep off the ends."""
    legs = np.diff(at)
    kept = widths.copy()
    both = kept[:-1] + kept[1:]
    share = np.minimum(legs / np.maximum(both, 1e-12), 1.0)
    kept[:-1] = np.minimum(kept[:-1], widths[:-1] * share)
    kept[1:] = np.minimum(kept[1:], widths[1:] * share)
    return kept
