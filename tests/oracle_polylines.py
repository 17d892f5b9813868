"""Where polylines of two curves cross: the judge of intersections.

Nothing in here imports the coordinator; a curve is whatever has a degree, knots, points (n, 2) and
weights.
"""

from __future__ import annotations

import numpy as np
import shapely

from tests.oracles import basis_table

NEAR = 1e-6
"""Crossings [m] this near are the same."""
ALIKE = 2e-3
"""Crossings [m] of coarse polylines are this near to those of the curves, when not too flat."""


def place(curve, u):
    """Return the points (len(u), 2) of a curve at parameters u."""
    basis = basis_table(curve.degree, curve.knots, u) * curve.weights
    return basis @ curve.points / basis.sum(axis=1)[:, None]


def polyline_crossings(a, b, chords):
    """Return where polylines of two curves cross, looked at more closely near each: (n, 2).

    `chords`: how many a span of knots has.
    """
    u, v = _parameters(a, chords), _parameters(b, chords)
    first, second = shapely.STRtree(_chords(b, v)).query(_chords(a, u), predicate="intersects")
    found = []
    for i, j in zip(first, second, strict=True):
        pieces = _chords(a, _window(u, i)), _chords(b, _window(v, j))
        k, m = shapely.STRtree(pieces[1]).query(pieces[0], predicate="intersects")
        meets = shapely.intersection(pieces[0][k], pieces[1][m])
        found += shapely.get_coordinates(meets).tolist()
    return np.array(sorted(found)).reshape(-1, 2)


def differences(a, b, points, chords):
    """Return how many of the points (n, 2) are missed and how many invented, to NEAR."""
    wanted = polyline_crossings(a, b, chords)
    if not len(wanted) or not len(points):
        return len(wanted), len(points)
    missed, invented = _gaps(wanted, points)
    return int((missed > NEAR).sum()), int((invented > NEAR).sum())


def looks_alike(a, b, points, chords):
    """Tell whether polylines cross as often as there are points (n, 2), and to ALIKE there."""
    lines = [shapely.linestrings(place(curve, _parameters(curve, chords))) for curve in (a, b)]
    wanted = shapely.get_coordinates(shapely.intersection(*lines))
    if len(wanted) != len(points) or not len(points):
        return len(wanted) == len(points)
    return max(gaps.max() for gaps in _gaps(wanted, points)) <= ALIKE


def _gaps(wanted, points):
    """Return how far each is from the nearest of the others."""
    gaps = np.hypot(*(wanted[:, None] - points).transpose(2, 0, 1))
    return gaps.min(axis=1), gaps.min(axis=0)


def _parameters(curve, chords):
    borders = np.unique(curve.knots)
    steps = np.arange((len(borders) - 1) * chords + 1) / chords
    return np.interp(steps, range(len(borders)), borders)


def _chords(curve, u):
    places = place(curve, u)
    return shapely.linestrings(np.stack((places[:-1], places[1:]), axis=1))


def _window(u, i):
    return np.linspace(u[max(i - 1, 0)], u[min(i + 2, len(u) - 1)], 100)
