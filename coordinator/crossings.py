"""Where two paths meet: all points at which two curves cross.

Candidates come from chords of both curves, each is then refined by Newton's method on
C_a(u) = C_b(v); neighbouring answers are one crossing.  Crossings explain a plan; safety rests on
the zones.  Decides: the crossing points.  Must not know: widths or times.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely

from coordinator.nurbs import Array, Nurbs

_CHORD: Final = 0.05
_SAME: Final = 1e-3
_STEEP: Final = 1e-4
"""Sine of the least angle at which curves cross; flatter ones run on top of each other."""


@dataclass(frozen=True)
class Meeting:
    """One crossing point [m] and its arc length on both curves [m]."""

    x: float
    y: float
    s_a: float
    s_b: float


def find_crossings(a: Nurbs, b: Nurbs) -> list[Meeting]:
    """Return where two curves cross, in order along a.

    Stretches that run on top of each other have no crossing points; they are zones.
    """
    chords = [_chords(curve) for curve in (a, b)]
    lines = [shapely.linestrings(np.stack((p[:-1], p[1:]), axis=1)) for _, p in chords]
    first, second = shapely.STRtree(lines[1]).query(lines[0], predicate="dwithin", distance=1e-3)
    s, t = chords[0][0], chords[1][0]
    u = a.parameter_at(0.5 * (s[first] + s[first + 1]))
    v = b.parameter_at(0.5 * (t[second] + t[second + 1]))
    u, v, gap = _newton(a, b, u, v)
    good = gap < 1e-7
    points = a.evaluate(u[good])
    arcs = np.column_stack((a.arc_at(u[good]), b.arc_at(v[good])))
    return _distinct(points, arcs)


def _chords(curve: Nurbs) -> tuple[Array, Array]:
    """Return arc lengths and points of chords of about 5 cm."""
    s = np.linspace(0.0, curve.length, 2 + int(curve.length / _CHORD))
    return s, curve.at_arc(s)


def _newton(a: Nurbs, b: Nurbs, u: Array, v: Array) -> tuple[Array, Array, Array]:
    """Refine parameters of crossings; returns them and the distances left [m]."""
    gap = np.full(len(u), np.inf)
    for _ in range(12 if len(u) else 0):
        pa, da = a.derivatives(u, 1)
        pb, db = b.derivatives(v, 1)
        miss = pb - pa
        gap = np.hypot(miss[:, 0], miss[:, 1])
        det = da[:, 1] * db[:, 0] - da[:, 0] * db[:, 1]
        steep = np.abs(det) > _STEEP * np.hypot(*da.T) * np.hypot(*db.T)
        det = np.where(steep, det, np.inf)
        u = u + (db[:, 0] * miss[:, 1] - db[:, 1] * miss[:, 0]) / det
        v = v + (da[:, 0] * miss[:, 1] - da[:, 1] * miss[:, 0]) / det
        u, v = np.clip(u, 0.0, a.knots[-1]), np.clip(v, 0.0, b.knots[-1])
        gap = np.where(steep, gap, np.inf)
    return u, v, gap


def _distinct(points: Array, arcs: Array) -> list[Meeting]:
    """Merge answers that are the same crossing."""
    order = np.lexsort((arcs[:, 1], arcs[:, 0]))
    found: list[Meeting] = []
    for (x, y), (s_a, s_b) in zip(points[order].tolist(), arcs[order].tolist(), strict=True):
        if not any(abs(s_a - m.s_a) < _SAME and abs(s_b - m.s_b) < _SAME for m in found):
            found.append(Meeting(x, y, s_a, s_b))
    return found
