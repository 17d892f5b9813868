"""All intersections of planar NURBS curves: crossings, touches, shared ends, overlaps, loops.

Decides: the input of the search and the form of its results.  Must not know: arc lengths, robots
or what an intersection is used for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from coordinator.curves.bezier_kernels import Pieces
from coordinator.curves.intersection_kind_kernels import find_all
from coordinator.curves.knots import bezier_pieces
from coordinator.curves.nurbs import Array, Nurbs
from coordinator.curves.nurbs_kernels import Indices


@dataclass(frozen=True, eq=False)
class Intersections:
    """Where curves a and b meet, sorted along a.

    u_a, u_b (n,): parameters of the points; points (n, 2) [m].  overlaps (m, 4): parameters a0 <=
    a1 and b0, b1 of stretches on one another; b0 > b1 where they run against each other.  tolerance
    [m]: the one that was used, which is coarser than the one that was asked for when that is less
    than rounding, or when the curves run beside each other at little more than it.
    """

    u_a: Array
    u_b: Array
    points: Array
    overlaps: Array
    tolerance: float


def find_intersections(a: Nurbs, b: Nurbs, tolerance: float = 1e-9) -> Intersections:
    """Return all intersections of two curves, to a tolerance [m]; the answer tells which was used.

    Raises ValueError for a tolerance or weights that are not positive, degree 0, numbers that are
    not finite.
    """
    (found,) = find_all_intersections([a, b], np.array([[0, 1]]), tolerance)
    return found


def find_self_intersections(curve: Nurbs, tolerance: float = 1e-9) -> Intersections:
    """Return where a curve meets itself, each meeting once, u_a < u_b; raises ValueError."""
    (found,) = find_all_intersections([curve], np.array([[0, 0]]), tolerance)
    return found


def find_all_intersections(
    curves: Sequence[Nurbs], pairs: npt.ArrayLike, tolerance: float = 1e-9
) -> list[Intersections]:
    """Return the intersections of each pair (m, 2) of indices of curves; raises ValueError.

    A pair of a curve with itself gives its self-intersections.
    """
    wanted = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    points, overlaps, used = intersection_tables(curves, wanted, tolerance)
    numbers = np.arange(len(wanted) + 1)
    at, over = np.searchsorted(points[:, 0], numbers), np.searchsorted(overlaps[:, 0], numbers)
    return [
        Intersections(points[i:j, 1], points[i:j, 2], points[i:j, 3:], overlaps[k:m, 1:], fine)
        for i, j, k, m, fine in zip(at, at[1:], over, over[1:], used.tolist(), strict=False)
    ]


def intersection_tables(
    curves: Sequence[Nurbs], pairs: Indices, tolerance: float = 1e-9
) -> tuple[Array, Array, Array]:
    """Return the intersections of all pairs (m, 2) as three tables; raises ValueError.

    Points (n, 5): pair, u_a, u_b, x, y; overlaps (k, 5): pair, a0, a1, b0, b1; both in order of
    pairs and along the first curve; and the tolerances used (m,) [m].
    """
    if not tolerance > 0.0:
        raise ValueError(f"the tolerance has to be positive, it is {tolerance} m")
    if not len(pairs):
        return np.empty((0, 5)), np.empty((0, 5)), np.empty(0)
    pieces, origin, largest = _prepare(curves)
    *rows, used = find_all(pieces, pairs, max(tolerance, 1e-14 * largest))
    points, overlaps = map(_sorted, rows)
    points[:, 3:] += origin
    return points, overlaps, used


def _prepare(curves: Sequence[Nurbs]) -> tuple[Pieces, Array, float]:
    """Return curves in pieces about an origin, that origin (2,), and the largest coordinate."""
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
        control = np.column_stack(((curve.points - origin) * control[:, 2:], control[:, 2]))
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
    """Return rows (m, 5) sorted by pair, parameter on the first curve, then on the second."""
    return np.asarray(rows[np.lexsort((rows[:, 2], rows[:, 1], rows[:, 0]))])


def _boxes(lifted: Array) -> Array:
    corners = lifted[:, :, :2] / lifted[:, :, 2:]
    return np.concatenate((corners.min(axis=1), corners.max(axis=1)), axis=1)
