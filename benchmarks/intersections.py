"""All intersections of curves: speed compared with a search along chords, and correctness.

geomdl and SciPy have no such function.  The search along chords represents the usual method, which
this package once used; it misses points where curves touch, and crossings for which its chords are
too coarse.  Results are compared with polylines of the curves (tests/oracle_polylines.py).
"""

from __future__ import annotations

import itertools
import time

import numpy as np
import shapely

from benchmarks.table import Row
from benchmarks.timing import median_of
from coordinator.curves.intersections import Intersections, find_all_intersections
from coordinator.curves.nurbs import Array, Nurbs, nurbs
from coordinator.plan.crossings import find_all_crossings
from tests.oracle_polylines import differences, looks_alike, place

_CURVES = 40
_CONTROL_POINTS = 15
_CHORD = 0.05
_STEPS = 12
_COARSE, _FINE = 250, 2500
"""Chords per span of the polylines that are compared with all pairs, and with pairs that differ."""


def intersections() -> list[Row]:
    """Measure all pairs of 40 paths across a floor, and of 40 paths that wind about one place."""
    random = np.random.default_rng(5)
    part = np.linspace(0.0, 1.0, _CONTROL_POINTS)[:, None]
    paths, tangles = [], []
    for _ in range(_CURVES):
        start, goal = random.uniform(0.0, 60.0, (2, 2))
        wander = random.normal(0.0, 2.0, (_CONTROL_POINTS, 2))
        paths.append(_cubic(start + (goal - start) * part + wander))
        tangles.append(_cubic(random.uniform(0.0, 10.0, (_CONTROL_POINTS, 2))))
    return [_row("paths across a floor", paths), _row("tangles", tangles)]


def _row(what: str, curves: list[Nurbs]) -> Row:
    pairs = list(itertools.combinations(range(len(curves)), 2))
    found = find_all_crossings(curves, pairs)
    ours = median_of(lambda: find_all_crossings(curves, pairs), 5)
    few = pairs[:: len(pairs) // 50]
    chords = [_chords(curve) for curve in curves]
    theirs = median_of(lambda: [_by_chords(curves, chords, i, j) for i, j in few], 3)
    theirs *= len(pairs) / len(few)
    return {
        "curves": what,
        "pairs": len(pairs),
        "crossings a pair": sum(map(len, found)) / len(pairs),
        "us a pair": 1e6 * ours / len(pairs),
        "chords and Newton / this": theirs / ours,
    }


def _cubic(points: Array) -> Nurbs:
    inner = np.arange(1.0, len(points) - 3)
    return nurbs(3, np.concatenate((np.zeros(4), inner, np.full(4, len(inner) + 1.0))), points)


def _chords(curve: Nurbs) -> tuple[Array, Array]:
    """Return parameters and chords of about 5 cm."""
    u = curve.parameter_at(np.linspace(0.0, curve.length, 2 + int(curve.length / _CHORD)))
    places = curve.evaluate(u)
    return u, shapely.linestrings(np.stack((places[:-1], places[1:]), axis=1))


def _by_chords(curves: list[Nurbs], chords: list[tuple[Array, Array]], i: int, j: int) -> Array:
    """Return parameters of crossings (n, 2) by Newton's method from all pairs of near chords."""
    (u, lines), (v, others) = chords[i], chords[j]
    first, second = shapely.STRtree(others).query(lines, predicate="dwithin", distance=1e-3)
    at, its = 0.5 * (u[first] + u[first + 1]), 0.5 * (v[second] + v[second + 1])
    for _ in range(_STEPS if len(at) else 0):
        (p, dp), (q, dq) = curves[i].derivatives(at, 1), curves[j].derivatives(its, 1)
        x, y = (q - p).T
        det = dp[:, 1] * dq[:, 0] - dp[:, 0] * dq[:, 1]
        at = np.clip(at + (dq[:, 0] * y - dq[:, 1] * x) / det, 0.0, u[-1])
        its = np.clip(its + (dp[:, 0] * y - dp[:, 1] * x) / det, 0.0, v[-1])
    return np.column_stack((at, its))


def against_polylines(count: int = 10_000) -> list[Row]:
    """Compare the intersections of random pairs of curves with up to 20 control points each.

    A point is right if it lies on both curves (the gap is the largest difference of a coordinate
    [m]) and coarse polylines cross near it, with the same number of points in all; pairs that fail
    this are compared with finer polylines to 1e-6 m.  Mirror: how far points move when the curves
    are swapped.
    """
    pairs = [_random_pair(seed) for seed in range(count)]
    curves = [curve for pair in pairs for curve in pair]
    indices = np.arange(2 * count).reshape(-1, 2)
    find_all_intersections(curves[:2], indices[:1])
    begin = time.perf_counter()
    found = find_all_intersections(curves, indices)
    took = time.perf_counter() - begin
    swapped = find_all_intersections(curves, indices[:, ::-1])
    asked = [
        differences(a, b, its.points, _FINE)
        for (a, b), its in zip(pairs, found, strict=True)
        if not looks_alike(a, b, its.points, _COARSE)
    ]
    mirrors = [_mirror(one, other) for one, other in zip(found, swapped, strict=True)]
    return [
        {
            "pairs": count,
            "points": sum(len(its.u_a) for its in found),
            "overlaps": sum(len(its.overlaps) for its in found),
            "compared finely": len(asked),
            "missed": sum(missed for missed, _ in asked),
            "invented": sum(invented for _, invented in asked),
            "gap nm": 1e9 * max(_gap(*pair, its) for pair, its in zip(pairs, found, strict=True)),
            "mirror nm": 1e9 * max(mirrors),
            "coarser": sum(its.tolerance > 1e-9 for its in found),
            "us per pair": 1e6 * took / count,
        }
    ]


def _random_pair(seed: int) -> tuple[Nurbs, Nurbs]:
    random = np.random.default_rng(seed)
    return _random_curve(random), _random_curve(random)


def _random_curve(random: np.random.Generator) -> Nurbs:
    """Return a random curve within 10 m; half of all curves have weights between e^-2 and e^2."""
    degree = int(random.integers(1, 8))
    count = int(random.integers(degree + 1, 21))
    wild = bool(random.random() < 0.5)
    weights = np.exp(random.uniform(-2.0, 2.0, count)) if wild else np.ones(count)
    inner = np.arange(1.0, count - degree)
    knots = np.concatenate((np.zeros(degree + 1), inner, np.full(degree + 1, len(inner) + 1.0)))
    return nurbs(degree, knots, random.uniform(0.0, 10.0, (count, 2)), weights)


def _gap(a: Nurbs, b: Nurbs, found: Intersections) -> float:
    off = (place(curve, u) - found.points for curve, u in ((a, found.u_a), (b, found.u_b)))
    return max(float(np.abs(its).max(initial=0.0)) for its in off)


def _mirror(one: Intersections, other: Intersections) -> float:
    """Return the greatest distance [m] of corresponding points; infinite if the counts differ."""
    if len(one.u_a) != len(other.u_a):
        return float("inf")
    order = np.lexsort((other.u_a, other.u_b))
    return float(np.abs(one.points - other.points[order]).max(initial=0.0))
