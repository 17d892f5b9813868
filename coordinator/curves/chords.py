"""Approximating a curve by few chords that are parametrized by its arc length.

Decides: how far the curve may be from its chords.  Must not know: robots, or what chords are for.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from coordinator.curves.chord_kernels import (
    START,
    START_X,
    START_Y,
    cut_evenly,
    inverse_error,
    join_straight,
)
from coordinator.curves.knots import bezier_pieces
from coordinator.curves.nurbs import Array, Nurbs

_ROUNDING: Final = 1e-12
"""Allowance for rounding in the error, as a share of the largest coordinate."""

_CLOSER: Final = 1e-4
"""If the estimated error of `Nurbs.parameter_at` exceeds this [m], it is sampled instead."""
_SAMPLES: Final = 16
"""Number of equal parts into which the samples divide a cell."""


@dataclass(frozen=True, eq=False)
class Chords:
    """A path as n chords: s (n + 1,) [m], points (n + 1, 2) [m] and error [m].

    s are arc lengths that increase from 0, or from where a part of the path begins, to the length
    of the path; a path without length is one chord with s = (0, 0).  At every arc length the
    curve's point is at most `error` away from `points`, interpolated linearly in s.
    """

    s: Array
    points: Array
    error: float

    @cached_property
    def middles(self) -> Array:
        """The middles of chords and half their lengths, (n + 1, 3) [m]; the last row is none."""
        steps = 0.5 * np.diff(self.points, axis=0, append=self.points[-1:])
        return np.column_stack((self.points + steps, np.hypot(steps[:, 0], steps[:, 1])))

    def part(self, first: int, last: int) -> Chords:
        """Return the chords from one vertex to another."""
        which = slice(first, last + 1)
        found = Chords(self.s[which], self.points[which], self.error)
        found.__dict__["middles"] = self.middles[which]
        return found


def chords_of(curve: Nurbs, tolerance: float = 5e-4) -> Chords:
    """Return a curve as chords whose error, across and along the curve, is at most `tolerance` [m].

    The error is proven for exact arc lengths.  An estimate of the error of `Nurbs.parameter_at` is
    added: it is below a micrometre on smooth paths and may exceed the tolerance where |C'| is
    almost 0.  Raises ValueError for a tolerance below the rounding error, weights that are not
    positive, and curves of degree 0.
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
    missed = inverse_error(curve._series, curve._table)
    if missed > _CLOSER:
        missed = _sampled_error(curve)
    allowed = max(tolerance - spare - missed, 0.5 * tolerance)
    borders = curve._series.borders
    parts = cut_evenly(borders, bezier_pieces(*curve.lifted)[1], allowed)
    u = np.append(parts[:, START], borders[-1])
    ends = np.concatenate((parts[:, (START_X, START_Y)], curve.points[-1:]))
    s = curve.arc_at(u)
    keep, error = join_straight(parts, ends, s, allowed, scale)
    return Chords(s[keep], ends[keep], error + spare + missed)


def _sampled_error(curve: Nurbs) -> float:
    """Return the error [m] of `Nurbs.parameter_at`, as an arc length, from samples in all cells."""
    ends = curve._table.s
    share = np.arange(1, _SAMPLES) / _SAMPLES
    s = (ends[:-1, None] + np.diff(ends)[:, None] * share).ravel()
    return 1.25 * float(np.abs(curve.arc_at(curve.parameter_at(s)) - s).max())
