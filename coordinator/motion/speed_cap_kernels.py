"""Compiled: upper bounds on the curvature of a curve between samples.

Between two samples in a knot span the curvature is bounded by the chord of the samples plus an arc,
whose height follows from the second differences.  The speed cap is a polyline of 1 / curvature.
Between curvatures k0 and k1 that polyline lies above 1 / chord, at most by the factor
(k0 + k1)^2 / (4 k0 k1), by which it is lowered.  Where a bound is not precise enough, or where the
tangent turns by more than the samples explain, the curve has to be sampled more finely.

Decides: how fine the samples have to be.  Must not know: speeds.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import compiled
from coordinator.curves.nurbs import Array

Flags = npt.NDArray[np.bool_]

_CELLS_PER_SPAN: Final = 24

_PIECES: Final = 4
"""Number of parts that a cell which is too rough is cut into."""

_ARC: Final = 0.25
"""Height of the arc between two samples, as a share of the second difference: twice that of a
parabola."""

_ROUGH: Final = 0.01
"""Greatest share of a bound that may be due to the arc or to the lowering of the polyline."""

_TURN: Final = 1e-3
"""The tangent may turn by this much [rad] more between two samples than they explain."""


@compiled
def cells(borders: Array) -> tuple[Array, Flags]:
    """Return parameters (n,) of samples, and for each cell (n - 1,) whether it is in a knot span.

    The last sample of a span lies just before the knot, since the second derivative may jump there;
    the tiny cell from it to the knot counts as outside.
    """
    row = _CELLS_PER_SPAN + 1
    u = np.empty(row * (len(borders) - 1))
    inside = np.ones(len(u) - 1, dtype=np.bool_)
    for i in range(len(u)):
        span, cell = divmod(i, row)
        low, high = borders[span], borders[span + 1]
        u[i] = low + (high - low) * cell / _CELLS_PER_SPAN
        if cell == _CELLS_PER_SPAN:
            u[i] = min(high - 1e-9 * (high - low), np.nextafter(high, 0.0))
            if i < len(inside):
                inside[i] = False
    return u, inside


@compiled
def finer(u: Array, inside: Flags, rough: Flags) -> tuple[Array, Flags]:
    """Return what `cells` returns, with the rough cells (n - 1,) cut into pieces."""
    size = len(u) + (_PIECES - 1) * np.count_nonzero(rough)
    fine, within = np.empty(size), np.empty(size - 1, dtype=np.bool_)
    count = 0
    for i in range(len(rough)):
        pieces = _PIECES if rough[i] else 1
        for piece in range(pieces):
            fine[count] = u[i] + (u[i + 1] - u[i]) * piece / pieces
            within[count] = inside[i]
            count += 1
    fine[count] = u[-1]
    return fine, within


@compiled
def bends(first: Array, second: Array) -> tuple[Array, Array]:
    """Return the signed curvature (n,) [1/m] where a curve has these derivatives (n, 2).

    Also returns by how much the tangent turns from each sample to the next (n - 1,) [rad].
    """
    bend, turned = np.empty(len(first)), np.empty(len(first) - 1)
    for i in range(len(first)):
        x, y = first[i]
        bend[i] = (x * second[i, 1] - y * second[i, 0]) / max(math.hypot(x, y), 1e-12) ** 3
        if i > 0:
            a, b = first[i - 1]
            turned[i - 1] = math.atan2(a * y - b * x, a * x + b * y)
    return bend, turned


@compiled
def highest_bends(
    s: Array, bend: Array, turned: Array, inside: Flags, least: float
) -> tuple[Array, Flags]:
    """Return curvatures (n,) of `least` [1/m] or more, and which cells (n - 1,) are too rough.

    Between samples the polyline of their reciprocals is nowhere above 1 / curvature of the curve.
    """
    highest = np.maximum(np.abs(bend), least)
    rough = np.zeros(len(inside), dtype=np.bool_)
    for i in range(len(inside)):
        step = s[i + 1] - s[i]
        if not inside[i] or step <= 0.0:
            continue
        slope = (bend[i + 1] - bend[i]) / step
        second = 0.0
        for j in (i - 1, i + 1):
            if 0 <= j < len(inside) and inside[j] and s[j + 1] > s[j]:
                size = s[j + 1] - s[j]
                change = abs((bend[j + 1] - bend[j]) / size - slope)
                second = max(second, change / (size + step))
        arc = 2.0 * _ARC * second * step * step
        k0 = max(abs(bend[i]) + arc, least)
        k1 = max(abs(bend[i + 1]) + arc, least)
        lower = 4.0 * k0 * k1 / (k0 + k1) ** 2
        unexplained = abs(turned[i] - 0.5 * step * (bend[i] + bend[i + 1]))
        rough[i] = unexplained > step * arc + _TURN
        if max(k0, k1) > least:
            rough[i] |= arc > _ROUGH * max(k0, k1) or lower < 1.0 - _ROUGH
        highest[i] = max(highest[i], k0 / lower)
        highest[i + 1] = max(highest[i + 1], k1 / lower)
    return highest, rough
