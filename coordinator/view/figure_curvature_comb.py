"""Draws curvature combs: teeth across a curve whose lengths are proportional to its curvature.

A tooth is on the outer side of a bend, so a comb changes sides where the bend does.  The tips of
the teeth are joined.  Decides: the places of the teeth and their common scale.  Must not know:
robots or the floor.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from coordinator.curves.nurbs import Array, Nurbs

_SAMPLES: Final = 48
"""Number of samples in each span of a curve."""
_LONGEST: Final = 0.06
"""The longest tooth, as a share of the floor's longer side."""
_SPACING: Final = 0.004
"""Teeth are at least this share of that side apart, at the curve or at their tips."""
_SHORTEST: Final = 0.01
"""Teeth shorter than this share of the longest are left out."""
_STRAIGHT: Final = 1e-3
"""A curve that turns less [rad] over the floor's side has no comb."""


@dataclass(frozen=True, eq=False)
class Bends:
    """Samples of a curve's curvature.

    places (n, 2) [m]; outward (n, 2): the curvature [1/m] as a vector to the outside of the bend.
    """

    places: Array
    outward: Array

    @staticmethod
    def of(curve: Nurbs) -> Bends:
        """Return dense samples of a curve in each span, ends included."""
        u = parameters(curve, _SAMPLES)
        places, first = curve.derivatives(u, 1)
        speed = np.maximum(np.hypot(first[:, 0], first[:, 1]), 1e-12)
        right = np.column_stack((first[:, 1], -first[:, 0])) / speed[:, None]
        return Bends(places, curve.curvature(u)[:, None] * right)

    @property
    def sharpest(self) -> float:
        """The greatest curvature [1/m]."""
        return float(np.hypot(self.outward[:, 0], self.outward[:, 1]).max())


def parameters(curve: Nurbs, samples: int) -> Array:
    """Return parameters (n,) of a curve, `samples` of them in each span, and its end."""
    borders = np.unique(curve.knots)
    share = np.arange(samples) / samples
    inner = borders[:-1, None] + share * np.diff(borders)[:, None]
    return np.append(inner.ravel(), borders[-1])


def sharpest_bend(bends: list[Bends], side: float) -> float | None:
    """Return the greatest curvature [1/m] of curves; None if all are straight.

    side: the longer side of the floor [m].
    """
    sharpest = max((each.sharpest for each in bends), default=0.0)
    return sharpest if sharpest * side > _STRAIGHT else None


def draw_comb(axes: Axes, bends: Bends, colour: str, side: float, sharpest: float) -> None:
    """Draw one comb; a tooth of curvature `sharpest` [1/m] is 6 % of the floor's side [m] long."""
    longest = _LONGEST * side
    tips = bends.places + longest / sharpest * bends.outward
    chosen = _teeth(bends.places, tips, side)
    if not chosen:
        return
    teeth = np.stack((bends.places[chosen], tips[chosen]), axis=1)
    style: dict[str, Any] = {"colors": colour, "zorder": 4, "gid": "comb"}
    axes.add_collection(LineCollection(list(teeth), linewidths=0.45, alpha=0.55, **style))
    axes.plot(*tips.T, color=colour, lw=0.7, alpha=0.8, zorder=4)


def _teeth(places: Array, tips: Array, side: float) -> list[int]:
    """Choose which teeth to draw: those that are long enough and not too near the tooth before."""
    both = np.hstack((places, tips))
    long = np.hypot(*(tips - places).T)
    chosen: list[int] = []
    for index in np.flatnonzero(long > _SHORTEST * _LONGEST * side).tolist():
        if not chosen or abs(both[index] - both[chosen[-1]]).max() > _SPACING * side:
            chosen.append(index)
    return chosen
