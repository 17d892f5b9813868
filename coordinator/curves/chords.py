"""Approximating a curve by few chords that are parametrized by its arc length.

Decides: how far the curve may be from its chords.  Must not know: robots, or what chords are for.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from coordinator.curves.chord_kernels import cut_evenly, inverse_error, join_straight
from coordinator.curves.knots import bezier_pieces
from coordinator.curves.nurbs import Array, Nurbs

_ROUNDING: Final = 1e-12
"""Allowance for rounding in the error, as a share of the largest coordinate."""

_CLOSER: Final = 1e-4
"""What the inverse of the arc length may miss [m] before it is looked at closely."""
_SAMPLES: Final = 16


@dataclass(frozen=True, eq=False)
class Chords:
    """A path as n chords: s (n + 1,) [m], points (n + 1, 2) [m] and error [m].

    s are arc lengths that increase from 0 to the length of the path (a path without length is one
    chord with s = (0, 0)).  For every arc length the curve's point differs from the linear
    interpolation in s of `points` by at most `error`.
    """

    s: Array
    points: Array
    error: float


def chords_of(curve: Nurbs, tolerance: float = 5e-4) -> Chords:
    """Return a curve as chords whose error is at most `tolerance` [m], along the curve included.

    The error is proven for the arc length as it is.  What the curve's own inverse of it misses is
    added as estimated: it is below a micrometre on smooth paths and may exceed the tolerance where
    a curve almost stands still in its parameter.  Raises ValueError for a tolerance that rounding
    takes, weights that are not positive, and curves of degree 0.
    """
    scale = float(np.abs(curve.points).max())
    spare = _ROUNDING * scale
    if not tolerance > 2.0 * spare:
        raise ValueError(f"tolerance {tolerance} m is not above what rounding takes, {spare} m")
    if curve.degree == 0 or not curve.weights.min() > 0.0:
        raise ValueError(
            f"degree {curve.degree} and least weight {curve.weights.min()} are not both positive"
        )
    if curve.length == 0.0:
        spread = float(np.hypot(*(curve.points - curve.points[0]).T).max())
        return Chords(np.zeros(2), curve.points[[0, 0]], spread + spare)
    borders, powers = curve._series
    table = curve._table
    missed = inverse_error(borders, powers, *table)
    if missed > _CLOSER:
        missed = _sampled_error(curve)
    allowed = max(tolerance - spare - missed, 0.5 * tolerance)
    parts = cut_evenly(borders, bezier_pieces(*curve.lifted)[1], allowed)
    u = np.append(parts[:, 0], borders[-1])
    ends = np.concatenate((parts[:, 1:3], curve.points[-1:]))
    s = curve.arc_at(u)
    keep, error = join_straight(parts, ends, s, allowed, scale)
    return Chords(s[keep], ends[keep], error + spare + missed)


def _sampled_error(curve: Nurbs) -> float:
    """Return how far [m] the curve's own inverse misses arc lengths, from samples in all cells."""
    table = curve._table[1]
    share = np.arange(1, _SAMPLES) / _SAMPLES
    s = (table[:-1, None] + np.diff(table)[:, None] * share).ravel()
    return 1.25 * float(np.abs(curve.arc_at(curve.parameter_at(s)) - s).max())
