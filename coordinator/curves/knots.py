"""The same curve with other control points: knots inserted, pieces cut out, Bezier form.

Decides: how knots and control points change while the curve stays the same.  Computations use
homogeneous coordinates, so they include the weights.  Control points that need not change are
copied bit by bit.  Must not know: what a curve is used for.

Source: Boehm's knot insertion, as in Piegl and Tiller, The NURBS Book, Eq. (5.15).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import compiled
from coordinator.curves.nurbs import Array, Nurbs
from coordinator.curves.nurbs_kernels import W

Indices = npt.NDArray[np.int64]


def insert_knot(curve: Nurbs, u: float, times: int = 1) -> Nurbs:
    """Return the curve with a knot inserted `times` times; raises ValueError as `refine` does."""
    return refine(curve, [u] * times)


def refine(curve: Nurbs, knots: npt.ArrayLike) -> Nurbs:
    """Return the curve with all these knots inserted; they may be in any order and repeated.

    The degree stays the same and each knot adds a control point.  Only those control points change
    whose basis functions have an inserted knot inside their support.  Raises ValueError for a knot
    that is not inside the domain, or whose multiplicity would exceed the degree.
    """
    added = np.sort(np.array(knots, dtype=np.float64, ndmin=1))
    _check(curve, added)
    if not len(added):
        return curve
    merged, control, origin = _insert(*curve.lifted, added)
    old = np.maximum(origin, 0)
    kept = origin >= 0
    points = np.where(kept[:, None], curve.points[old], control[:, :W] / control[:, W:])
    weights = np.where(kept, curve.weights[old], control[:, W])
    return Nurbs(curve.degree, merged, points, weights)


def piece(curve: Nurbs, u0: float, u1: float) -> Nurbs:
    """Return the curve from u0 to u1; its parameter runs from 0 to u1 - u0.

    Raises ValueError unless 0 <= u0 < u1 <= knots[-1].
    """
    end = float(curve.knots[-1])
    if not 0.0 <= u0 < u1 <= end:
        raise ValueError(f"there is no piece from {u0} to {u1} of a curve from 0 to {end}")
    degree = curve.degree
    missing = [
        np.full(degree - np.count_nonzero(curve.knots == u), u) for u in (u0, u1) if 0.0 < u < end
    ]
    cut = refine(curve, np.concatenate([np.empty(0), *missing]))
    first = max(int(np.searchsorted(cut.knots, u0)) - 1, 0)
    past = int(np.searchsorted(cut.knots, u1))
    inner = cut.knots[(cut.knots > u0) & (cut.knots < u1)] - u0
    knots = np.concatenate((np.zeros(degree + 1), inner, np.full(degree + 1, u1 - u0)))
    return Nurbs(degree, knots, cut.points[first:past], cut.weights[first:past])


def bezier_form(curve: Nurbs) -> Nurbs:
    """Return the curve with the multiplicity of every inner knot raised to the degree.

    Each span is then a rational Bezier curve: span j has the control points from degree * j to
    degree * (j + 1), both included.
    """
    inner, times = np.unique(curve.knots[curve.degree + 1 : -curve.degree - 1], return_counts=True)
    return refine(curve, np.repeat(inner, curve.degree - times))


def beziers(curve: Nurbs) -> list[Nurbs]:
    """Return one rational Bezier curve per span; its parameter runs from 0 to the span's width."""
    degree, form = curve.degree, bezier_form(curve)
    pieces = []
    for index, width in enumerate(np.diff(np.unique(curve.knots)).tolist()):
        its = slice(degree * index, degree * (index + 1) + 1)
        knots = np.repeat([0.0, width], degree + 1)
        pieces.append(Nurbs(degree, knots, form.points[its], form.weights[its]))
    return pieces


def _check(curve: Nurbs, added: Array) -> None:
    """Raise ValueError if these knots (m,), which are sorted, cannot be inserted."""
    end = float(curve.knots[-1])
    outside = added[~((added > 0.0) & (added < end))]
    if len(outside):
        raise ValueError(f"knot {outside[0]} is not inside the domain from 0 to {end}")
    degree = curve.degree
    inner = np.sort(np.concatenate((curve.knots[degree + 1 : -degree - 1], added)))
    later = inner[degree:]
    crowded = later[later == inner[: len(later)]]
    if len(crowded):
        raise ValueError(f"knot {crowded[0]} would have multiplicity above the degree, {degree}")


@compiled
def _insert(
    degree: int, knots: Array, control: Array, added: Array
) -> tuple[Array, Array, Indices]:
    """Insert knots one by one; return the knots, control points (n, 3) and their origins (n,).

    The origin of a control point is the index of the old one that it is a copy of, or -1.
    """
    count, total = len(control), len(control) + len(added)
    merged, points = np.empty(total + degree + 1), np.empty((total, 3))
    origin = np.arange(total)
    for i in range(count):
        for axis in range(3):
            points[i, axis] = control[i, axis]
    for i in range(len(knots)):
        merged[i] = knots[i]
    for u in added:
        past = count + degree + 1
        while merged[past - 1] > u:
            merged[past] = merged[past - 1]
            past -= 1
        merged[past] = u
        last = past - 1
        while merged[last] == u:
            last -= 1
        for i in range(count, last, -1):
            origin[i] = origin[i - 1]
            for axis in range(3):
                points[i, axis] = points[i - 1, axis]
        for i in range(last, past - degree - 1, -1):
            part = (u - merged[i]) / (merged[i + degree + 1] - merged[i])
            origin[i] = -1
            for axis in range(3):
                points[i, axis] = (1.0 - part) * points[i - 1, axis] + part * points[i, axis]
        count += 1
    return merged, points, origin


@compiled
def bezier_pieces(degree: int, knots: Array, control: Array) -> tuple[Array, Array]:
    """Return the borders (m + 1,) of a curve's m spans, and the spans as Bezier curves.

    The Bezier curves are homogeneous control points (m, degree + 1, 3), from `control` (n, 3).
    Control point j is the blossom whose arguments are degree - j times the span's start and j times
    its end.
    """
    count = len(control)
    borders, pieces = np.empty(count - degree + 1), np.empty((count - degree, degree + 1, 3))
    work, total = np.empty((degree + 1, 3)), 0
    borders[0] = knots[degree]
    for span in range(degree, count):
        begin, end = knots[span], knots[span + 1]
        if not end > begin:
            continue
        for j in range(degree + 1):
            for i in range(degree + 1):
                for axis in range(3):
                    work[i, axis] = control[span - degree + i, axis]
            for level in range(1, degree + 1):
                at = end if level <= j else begin
                for i in range(degree, level - 1, -1):
                    low = knots[span - degree + i]
                    part = (at - low) / (knots[span + i + 1 - level] - low)
                    for axis in range(3):
                        work[i, axis] = (1.0 - part) * work[i - 1, axis] + part * work[i, axis]
            for axis in range(3):
                pieces[total, j, axis] = work[degree, axis]
        total += 1
        borders[total] = end
    return borders[: total + 1], pieces[:total]
