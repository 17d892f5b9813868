"""All intersections of planar NURBS curves: crossings, touches, shared ends, overlaps, loops.

Decides: how curves are prepared for the search, and the form of its results.  Must not know: arc
lengths, robots or what an intersection is used for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from coordinator.curves.bezier_kernels import Pieces
from coordinator.curves.crossing_kernels import PAIR, PLACE_X, U, V
from coordinator.curves.intersection_kind_kernels import IntersectionTables, find_all
from coordinator.curves.knots import bezier_pieces
from coordinator.curves.nurbs import Array, Nurbs
from coordinator.curves.nurbs_kernels import Indices, W


@dataclass(frozen=True, eq=False)
class Intersections:
    """Where curves a and b meet, sorted along a.

    u_a, u_b (n,): parameters of the points; points (n, 2) [m].  overlaps (m, 4): parameters a0 <=
    a1 on a and b0, b1 on b between which the curves coincide; b0 > b1 where they run in opposite
    directions.  tolerance [m]: the one that was used.  It is coarser than the given one if the
    given one is below the rounding error, or if the curves run beside each other at a distance
    little above the given one.
    """

    u_a: Array
    u_b: Array
    points: Array
    overlaps: Array
    tolerance: float


def find_all_intersections(
    curves: Sequence[Nurbs], pairs: npt.ArrayLike, tolerance: float = 1e-9
) -> list[Intersections]:
    """Return the intersections of each pair (m, 2) of indices of curves, to a tolerance [m].

    The pair (i, i) gives the self-intersections of curve i, each once, with u_a < u_b.  Raises
    ValueError for a tolerance or weights that are not positive, degree 0, and numbers that are not
    finite.
    """
    wanted = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    points, overlaps, used = intersection_tables(curves, wanted, tolerance)
    numbers = np.arange(len(wanted) + 1)
    at = np.searchsorted(points[:, PAIR], numbers)
    over = np.searchsorted(overlaps[:, PAIR], numbers)
    u_a, u_b, places = points[:, U], points[:, V], points[:, PLACE_X:PAIR]
    return [
        Intersections(u_a[i:j], u_b[i:j], places[i:j], overlaps[k:m, :PAIR], fine)
        for i, j, k, m, fine in zip(at, at[1:], over, over[1:], used.tolist(), strict=False)
    ]


def intersection_tables(
    curves: Sequence[Nurbs], pairs: Indices, tolerance: float = 1e-9
) -> IntersectionTables:
    """Return the intersections of all pairs (m, 2) of indices, in tables for all pairs together.

    Points and overlaps are sorted by pair, then along the first curve.  Raises ValueError as
    `find_all_intersections` does.
    """
    if not tolerance > 0.0:
        raise ValueError(f"the tolerance has to be positive, it is {tolerance} m")
    if not len(pairs):
        return IntersectionTables(np.empty((0, 5)), np.empty((0, 5)), np.empty(0))
    pieces, origin, largest = _prepare(curves)
    found = find_all(pieces, pairs, max(tolerance, 1e-14 * largest))
    points, overlaps = _sorted(found.points), _sorted(found.overlaps)
    points[:, PLACE_X:PAIR] += origin
    return IntersectionTables(points, overlaps, found.tolerances)


def _prepare(curves: Sequence[Nurbs]) -> tuple[Pieces, Array, float]:
    """Return the pieces of all curves relative to an origin, this origin (2,), and a size [m].

    The origin is the middle of all control points; the size is their largest coordinate.
    """
    for curve in curves:
        least = curve.weights.min()
        if curve.degree == 0 or not least > 0.0:
            raise ValueError(
                f"degree {curve.degree} and least weight {least} are not both positive"
            )
    every = np.concatenate([curve.points for curve in curves])
    if not np.isfinite(every).all():
        raise ValueError("a control point is not finite")
    origin = np.round(0.5 * (every.min(axis=0) + every.max(axis=0)))
    borders, lifted = [], []
    for curve in curves:
        degree, knots, control = curve.lifted
        control = np.column_stack(((curve.points - origin) * control[:, W:], control[:, W]))
        ends, its = bezier_pieces(degree, knots, control)
        borders.append(np.column_stack((ends[:-1], ends[1:])))
        lifted.append(its)
    counts, degrees = [len(its) for its in lifted], [curve.degree for curve in curves]
    sizes = np.repeat(np.array(degrees) + 1, counts)
    boxes = [_boxes(its) for its in lifted]
    pieces = Pieces(
        np.concatenate(([0], np.cumsum(counts))),
        np.array(degrees, dtype=np.int64),
        np.cumsum(sizes) - sizes,
        np.concatenate([its.reshape(-1, 3) for its in lifted]),
        np.concatenate(borders),
        np.concatenate(boxes),
    )
    return pieces, origin, float(np.abs(every).max())


def _sorted(rows: Array) -> Array:
    """Return rows (m, 5) sorted by pair, then by their first two columns."""
    return np.asarray(rows[np.lexsort((rows[:, 1], rows[:, 0], rows[:, PAIR]))])


def _boxes(lifted: Array) -> Array:
    """Return the boxes (m, 4) of the control points of Bezier pieces (m, degree + 1, 3)."""
    corners = lifted[:, :, :W] / lifted[:, :, W:]
    return np.concatenate((corners.min(axis=1), corners.max(axis=1)), axis=1)
