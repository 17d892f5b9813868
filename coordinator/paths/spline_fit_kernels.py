"""Compiled: the polygon on which the control points of a curve lie that passes its vertices.

Decides: how far exact vertices are moved outwards.  Must not know: knots, what is clear.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import compiled
from coordinator.curves.nurbs import Array

Flags = npt.NDArray[np.bool_]


@compiled
def lengths_along(vertices: Array) -> Array:
    """Return the arc lengths (n,) [m] of a polygon's vertices (n, 2) [m]."""
    along = np.zeros(len(vertices))
    for k in range(1, len(vertices)):
        x, y = vertices[k, 0] - vertices[k - 1, 0], vertices[k, 1] - vertices[k - 1, 1]
        along[k] = along[k - 1] + math.hypot(x, y)
    return along


@compiled
def jumps(vertices: Array, at: Array) -> Array:
    """Return the change of dC/du (n, 2) at each vertex of a polygon (n, 2); zero at the ends.

    at (n,): the vertices' parameters.
    """
    found = np.zeros((len(vertices), 2))
    for axis in range(2):
        before = 0.0
        for k in range(len(vertices) - 1):
            leg = max(at[k + 1] - at[k], 1e-12)
            slope = (vertices[k + 1, axis] - vertices[k, axis]) / leg
            if k:
                found[k, axis] = slope - before
            before = slope
    return found


@compiled
def apart(at: Array, widths: Array, shared: Flags) -> Array:
    """Return half-widths (n,) that fit: neighbours share a leg; the first, last keep off the ends.

    at (n,): the vertices' parameters; shared (n - 1,): legs of which both neighbours take all.
    """
    kept = widths.copy()
    for k in range(len(at) - 1):
        if not shared[k]:
            share = min((at[k + 1] - at[k]) / max(widths[k] + widths[k + 1], 1e-12), 1.0)
            kept[k] = min(kept[k], widths[k] * share)
            kept[k + 1] = min(kept[k + 1], widths[k + 1] * share)
    return kept


@compiled
def bent_out(vertices: Array, exact: Flags, widths: Array, rounds: int) -> Array:
    """Return a polygon (n, 2) [m] with its exact vertices (n,) moved so that the curve passes them.

    Each is moved out by the cut, d / 6 * (t1 - t0), where d (n,) is its half-width that fits and t
    are the slopes of the legs, which change as the vertices move; so that is repeated.
    """
    bent, nowhere = vertices, np.zeros(len(vertices) - 1, np.bool_)
    for _ in range(rounds):
        at = lengths_along(bent)
        width, turns = apart(at, widths, nowhere), jumps(bent, at)
        further, changed = vertices.copy(), False
        for k in range(1, len(vertices) - 1):
            if exact[k]:
                for axis in range(2):
                    further[k, axis] -= turns[k, axis] * (width[k] / 6.0)
                    changed |= further[k, axis] != bent[k, axis]
        if not changed:
            break
        bent = further
    return bent
