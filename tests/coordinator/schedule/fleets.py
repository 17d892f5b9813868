"""Fleets of paths to find zones in, and the rows of their zones."""

from __future__ import annotations

import numpy as np

from coordinator.curves.chords import chords_of
from coordinator.curves.nurbs import nurbs
from coordinator.schedule.zone_kernels import Polyline, zone_rows

CELL = 0.008


def line(*corners):
    corners = np.array(corners, dtype=float)
    arc = np.append(0.0, np.cumsum(np.hypot(*np.diff(corners, axis=0).T)))
    return nurbs(1, np.concatenate(([0.0], arc, arc[-1:])), corners)


def through(points):
    knots = np.concatenate((np.zeros(4), np.arange(1.0, len(points) - 3), [len(points) - 3.0] * 4))
    return nurbs(3, knots, points)


def random_path(seed, legs=10, turn=0.7):
    """A path of about half a metre a leg that turns at random, across the same 3 m."""
    random = np.random.default_rng(seed)
    headings = random.uniform(0.0, 2.0 * np.pi) + np.cumsum(random.uniform(-turn, turn, legs))
    steps = 0.5 * np.column_stack((np.cos(headings), np.sin(headings)))
    points = np.concatenate(([[0.0, 0.0]], np.cumsum(steps, axis=0)))
    return through(points - points.mean(axis=0) + random.uniform(-0.6, 0.6, 2))


def rows_of(zones, k, chords, radii, margin, side, cell=CELL):
    a, b = chords[zones.a[k]], chords[zones.b[k]]
    me, other = (Polyline(path.s, path.points) for path in ((a, b) if side == 0 else (b, a)))
    reach = radii[zones.a[k]] + radii[zones.b[k]] + margin + a.error + b.error
    pairs = zones.pairs[zones.first[k] : zones.first[k + 1]]
    rows = np.empty((10, 3))
    count = zone_rows(me, other, pairs, side, reach, cell, rows, np.empty((len(pairs), 2)))
    if count < 0:
        rows = np.empty((-count, 3))
        count = zone_rows(me, other, pairs, side, reach, cell, rows, np.empty((len(pairs), 2)))
    return rows[:count]


def fleet(count, size=12.0, legs=14):
    """Robots all over a floor: curves, straight lines, one parked, one on a path reversed."""
    random = np.random.default_rng(count)
    curves = [random_path(seed, legs) for seed in range(count)]
    moved = [nurbs(3, c.knots, c.points + random.uniform(0.0, size, 2)) for c in curves]
    moved += [line(*random.uniform(0.0, size, (2, 2))) for _ in range(5)]
    moved += [line((3.0, 3.0), (3.0, 3.0 + 1e-9)), line(*moved[-1].points[::-1])]
    return [chords_of(curve) for curve in moved]
