"""All conflict zones of a fleet: cross-town, local and shared-lane paths, growth, other libraries.

Discs of 0.3 m on 100 m x 100 m.  The peers (shapely's STRtree and a k-d tree) do less: one finds
near segments, the other near points, and neither joins them into zones.
"""

from __future__ import annotations

import itertools
import resource
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Final

import numpy as np
import shapely
from scipy.spatial import cKDTree

from benchmarks.table import Row
from benchmarks.timing import median_of
from coordinator.curves.chords import Chords, chords_of
from coordinator.curves.nurbs import Array, Nurbs, nurbs
from coordinator.schedule.conflict_zones import find_zones

_SIDE: Final = 100.0
_RADIUS: Final = 0.3
_LANE: Final = 4.0
"""Distance between lanes [m]."""
_SAMPLE: Final = 0.1
_RUNS: Final = 5
_FEW: Final = 100
_MANY: Final = 1000

Scene = Callable[[int], list[Nurbs]]


def zones() -> list[Row]:
    """Measure 100 and 1,000 robots on three kinds of paths; the slow peers only 100."""
    scenes: dict[str, Scene] = {"cross-town": cross_town, "local": local, "shared lanes": lanes}
    _measure("", local(20))
    rows = []
    for name, scene in scenes.items():
        small, large = _measure(name, scene(_FEW)), _measure(name, scene(_MANY))
        large["growth of zones"] = float(large["zones"]) / float(small["zones"])
        large["growth of time"] = float(large["2 threads ms"]) / float(small["2 threads ms"])
        rows += [small, large]
    for row, scene in zip(rows[::2], scenes.values(), strict=True):
        curves = scene(_FEW)
        spent = 1e-3 * float(row["2 threads ms"])
        row["STRtree / 2 threads"] = _segments([chords_of(curve) for curve in curves]) / spent
        row["k-d tree / 2 threads"] = _samples(curves) / spent
    return rows


def cross_town(count: int) -> list[Nurbs]:
    """Return nearly straight paths between random places of the floor at least 35 m apart."""
    random = np.random.default_rng(1)
    curves: list[Nurbs] = []
    while len(curves) < count:
        start, goal = random.uniform(0.0, _SIDE, (2, 2))
        if np.hypot(*(goal - start)) > 0.35 * _SIDE:
            curves.append(_winding(start, goal, random))
    return curves


def local(count: int) -> list[Nurbs]:
    """Return paths of 15 m to 20 m all over the floor."""
    random, curves = np.random.default_rng(2), []
    for _ in range(count):
        start, heading = random.uniform(0.0, _SIDE, 2), random.uniform(0.0, 2.0 * np.pi)
        way = random.uniform(15.0, 20.0) * np.array([np.cos(heading), np.sin(heading)])
        curves.append(_winding(start, start + way, random))
    return curves


def lanes(count: int) -> list[Nurbs]:
    """Return paths along the lanes of a grid with one or two turns, corners rounded."""
    random, curves = np.random.default_rng(3), []
    last = int(_SIDE / _LANE)
    for _ in range(count):
        node, axis = random.integers(0, last + 1, 2), int(random.integers(2))
        corners: list[Array] = [_LANE * node.astype(np.float64)]
        for _ in range(int(random.integers(2, 4))):
            node = node.copy()
            node[axis] = (node[axis] + random.integers(2, 11)) % (last + 1)
            corners.append(_LANE * node.astype(np.float64))
            axis = 1 - axis
        legs = [_even(a, b, 1.0) for a, b in itertools.pairwise(corners)]
        curves.append(_through(np.concatenate([leg[:-1] for leg in legs] + [corners[-1:]])))
    return curves


def _winding(start: Array, goal: Array, random: np.random.Generator) -> Nurbs:
    """Return a cubic with eight control points, the inner ones moved at random."""
    swing = 0.02 * float(np.hypot(*(goal - start)))
    points = start + (goal - start) * np.linspace(0.0, 1.0, 8)[:, None]
    points[1:-1] += random.normal(0.0, swing, (6, 2))
    return _through(points)


def _even(a: Array, b: Array, step: float) -> Array:
    """Return places from a to b about a step apart."""
    parts = max(round(float(np.hypot(*(b - a))) / step), 1)
    return a + (b - a) * np.linspace(0.0, 1.0, parts + 1)[:, None]


def _through(points: Array) -> Nurbs:
    """Return the uniform cubic with these control points."""
    inner = np.arange(1.0, len(points) - 3)
    return nurbs(3, np.concatenate((np.zeros(4), inner, np.full(4, len(points) - 3.0))), points)


def _measure(name: str, curves: list[Nurbs]) -> Row:
    """Measure chords and zones of the same curves."""
    radii = np.full(len(curves), _RADIUS)
    begin = time.perf_counter()
    chords = [chords_of(curve) for curve in curves]
    cut = time.perf_counter() - begin
    found = find_zones(chords, radii, 0.0)
    with ThreadPoolExecutor(1) as single:
        one = median_of(lambda: find_zones(chords, radii, 0.0, single), _RUNS)
    two = median_of(lambda: find_zones(chords, radii, 0.0), _RUNS)
    first = median_of(lambda: find_zones(chords, radii, 0.0, among=[0]), _RUNS)
    return {
        "paths": name,
        "robots": len(curves),
        "zones": len(found.a),
        "pairs of chords": len(found.pairs),
        "chords ms": 1e3 * cut,
        "1 thread ms": 1e3 * one,
        "2 threads ms": 1e3 * two,
        "one robot ms": 1e3 * first,
        "peak MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
    }


def _segments(chords: list[Chords]) -> float:
    """Return the seconds that shapely takes for all pairs of near segments."""
    begin = time.perf_counter()
    ends = np.concatenate([np.stack((c.points[:-1], c.points[1:]), axis=1) for c in chords])
    lines = shapely.linestrings(ends)
    shapely.STRtree(lines).query(lines, predicate="dwithin", distance=2.0 * _RADIUS)
    return time.perf_counter() - begin


def _samples(curves: list[Nurbs]) -> float:
    """Return the seconds that a k-d tree takes for all pairs of near sampled points."""
    begin = time.perf_counter()
    places = [c.at_arc(np.arange(0.0, c.length, _SAMPLE)) for c in curves]
    owner = np.repeat(np.arange(len(curves)), [len(place) for place in places])
    near = cKDTree(np.concatenate(places)).query_pairs(2.0 * _RADIUS, output_type="ndarray")
    np.unique(owner[near], axis=0)
    return time.perf_counter() - begin
