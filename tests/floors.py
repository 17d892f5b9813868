"""Seeded random floors of every kind that people draw: for tests of ways and paths.

Nothing in here imports the coordinator.  Shared edges and touching corners stay exact on floors
that are not turned; on turned ones rounding opens and overlaps them by about 1e-15 m.
"""

from __future__ import annotations

import itertools
import math
import random
from dataclasses import dataclass

import numpy as np
import shapely

SIZE = (10.0, 8.0)


@dataclass(frozen=True)
class FloorCase:
    """A floor with its obstacles [m], and what a centre has to keep from them [m]."""

    kind: str
    boundary: list[tuple[float, float]]
    obstacles: list[list[tuple[float, float]]]
    reach: float


def box(x0, y0, x1, y1):
    return [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]


def random_floor(seed):
    """A floor; kinds take turns, every other round is turned by some angle."""
    dice = random.Random(seed)
    kind = sorted(KINDS)[seed % len(KINDS)]
    reach = dice.uniform(0.05, 0.4)
    boundary, obstacles = KINDS[kind](dice, reach)
    rings = [_either_way(dice, ring) for ring in (boundary, *obstacles)]
    if (seed // len(KINDS)) % 2:
        rings = _turned(rings, dice.uniform(0.0, 2.0 * math.pi))
    return FloorCase(kind, rings[0], rings[1:], reach)


def random_places(floor, count, seed, on_walls=0.3):
    """Up to `count` places (n, 2) that keep the reach, outside of the slivers at corners.

    Some stand exactly as near to a wall as they may.
    """
    dice = random.Random(seed)
    corners = np.array(list(itertools.chain(floor.boundary, *floor.obstacles)))
    solid = solid_of(floor)
    low, high = np.min(floor.boundary, axis=0), np.max(floor.boundary, axis=0)
    found = []
    for _ in range(60 * count):
        if len(found) == count:
            break
        place = np.array([dice.uniform(a, b) for a, b in zip(low, high, strict=True)])
        if dice.random() < on_walls:
            place = _beside_a_wall(dice, floor)
        apart = np.hypot(*(corners - place).T).min()
        if apart > 1.0197 * floor.reach and is_free(solid, place, floor.reach - 1e-9):
            found.append(place)
    return np.array(found).reshape(-1, 2)


def solid_of(floor):
    """All that is solid, as one area: the obstacles and what lies around the floor."""
    outline = shapely.Polygon(floor.boundary)
    around = shapely.box(*outline.bounds).buffer(2.0, join_style="mitre").difference(outline)
    solid = shapely.union_all([around, *(shapely.Polygon(ring) for ring in floor.obstacles)])
    shapely.prepare(solid)
    return solid


def is_free(solid, place, reach):
    return not shapely.dwithin(solid, shapely.Point(place), reach)


def _beside_a_wall(dice, floor):
    ring = dice.choice([floor.boundary, *floor.obstacles])
    k = dice.randrange(len(ring))
    a, b = np.array(ring[k - 1]), np.array(ring[k])
    along = (b - a) / max(math.hypot(*(b - a)), 1e-12)
    side = dice.choice((-1.0, 1.0)) * np.array([-along[1], along[0]])
    return a + dice.random() * (b - a) + floor.reach * side


def _either_way(dice, ring):
    ring = [(float(x), float(y)) for x, y in ring]
    return ring[::-1] if dice.random() < 0.5 else ring


def _turned(rings, angle):
    c, s = math.cos(angle), math.sin(angle)
    return [[(c * x - s * y, s * x + c * y) for x, y in ring] for ring in rings]


def _place(dice, edge=0.8):
    return dice.uniform(edge, SIZE[0] - edge), dice.uniform(edge, SIZE[1] - edge)


def _round_polygon(dice, count, radii):
    x, y = _place(dice)
    turn = dice.uniform(0.0, 2.0 * math.pi)
    angles = [turn + 2.0 * math.pi * k / count for k in range(count)]
    return [(x + r * math.cos(a), y + r * math.sin(a)) for r, a in zip(radii, angles, strict=True)]


def _boxes(dice, _):
    shapes = []
    for _ in range(dice.randint(2, 6)):
        (x, y), (w, h) = _place(dice), (dice.uniform(0.2, 2.5), dice.uniform(0.2, 2.5))
        shapes += _turned_about(x, y, [box(x, y, x + w, y + h)], dice.choice((0.0, 0.4, 1.1)))
    return box(0, 0, *SIZE), shapes


def _turned_about(x, y, rings, angle):
    moved = [[(px - x, py - y) for px, py in ring] for ring in rings]
    return [[(px + x, py + y) for px, py in ring] for ring in _turned(moved, angle)]


def _convex(dice, _):
    shapes = []
    for _ in range(dice.randint(2, 4)):
        count = dice.randint(3, 8)
        shapes.append(_round_polygon(dice, count, [dice.uniform(0.3, 1.2)] * count))
    return box(0, 0, *SIZE), shapes


def _stars(dice, _):
    shapes = []
    for _ in range(dice.randint(1, 3)):
        tips = dice.randint(3, 5)
        inner, outer = dice.uniform(0.15, 0.6), dice.uniform(0.7, 1.8)
        shapes.append(_round_polygon(dice, 2 * tips, [inner, outer] * tips))
    return box(0, 0, *SIZE), shapes


def _concave(dice, _):
    shapes = []
    for _ in range(dice.randint(1, 3)):
        x, y = _place(dice)
        w, h, t = dice.uniform(1.0, 3.5), dice.uniform(1.0, 2.5), dice.uniform(0.1, 0.4)
        if dice.random() < 0.5:
            ring = [(0, 0), (w, 0), (w, h), (w - t, h), (w - t, t), (t, t), (t, h), (0, h)]
        else:
            ring = [(0, 0), (w, 0), (w, t), (t, t), (t, h), (0, h)]
        ring = [(x + px - 0.5 * w, y + py - 0.5 * h) for px, py in ring]
        shapes += _turned_about(x, y, [ring], dice.choice((0.0, 1.5707963267948966, 0.7, 3.9)))
    return box(0, 0, *SIZE), shapes


def _shared_edges(dice, _):
    shapes = []
    for _ in range(dice.randint(1, 3)):
        x, y = _place(dice)
        for _ in range(dice.randint(2, 4)):
            w, h, dy = dice.uniform(0.3, 1.0), dice.uniform(0.3, 1.2), dice.uniform(-0.2, 0.2)
            shapes.append(box(x, y + dy, x + w, y + dy + h))
            x += w
    return box(0, 0, *SIZE), shapes


def _touching_corners(dice, _):
    shapes = []
    for _ in range(dice.randint(1, 2)):
        x, y = _place(dice)
        for _ in range(dice.randint(2, 4)):
            w, h = dice.uniform(0.3, 1.2), dice.choice((-1, 1)) * dice.uniform(0.3, 1.2)
            shapes.append(box(x, min(y, y + h), x + w, max(y, y + h)))
            x, y = x + w, y + h
    return box(0, 0, *SIZE), shapes


def _overlapping(dice, reach):
    _, shapes = dice.choice((_boxes, _convex))(dice, reach)
    for ring in list(shapes):
        dx, dy = dice.uniform(-0.4, 0.4), dice.uniform(-0.4, 0.4)
        shapes.append([(x + dx, y + dy) for x, y in ring])
    return box(0, 0, *SIZE), shapes


def _courtyards(dice, reach):
    x, y = dice.uniform(0.5, 4.0), dice.uniform(0.5, 3.0)
    w, h, t = dice.uniform(2.0, 5.0), dice.uniform(2.0, 4.0), dice.uniform(0.1, 0.3)
    door = dice.choice((0.0, 0.9, 1.1, 2.5)) * 2.0 * reach
    at = x + dice.uniform(0.0, max(w - 2.0 * t - door, 0.0)) + t
    south = box(x, y, x + w, y + t)
    walls = [[south], [box(x, y, at, y + t), box(at + door, y, x + w, y + t)]][door > 0.0]
    walls += [box(x, y + h - t, x + w, y + h), box(x, y + t, x + t, y + h - t)]
    walls.append(box(x + w - t, y, x + w, y + h))
    if dice.random() < 0.4:
        walls.append(box(x + 0.4 * w, y + 0.4 * h, x + 0.55 * w, y + 0.6 * h))
    return box(0, 0, *SIZE), walls


def _on_the_edge(dice, _):
    w, h = SIZE
    shapes = [box(2, 0, 3, dice.uniform(1, 5)), box(-1, dice.uniform(5, 6), 4, 6.5)]
    shapes.append(box(6, dice.uniform(2, 5), 6 + dice.uniform(0.1, 1), h + 1))
    x, y = dice.uniform(6, 8), dice.uniform(0.5, 2)
    shapes.append([(x, -0.5), (x + 1, y), (x + 2, -0.5)])
    shapes.append([(w, y + 2), (w, y + 4), (w - dice.uniform(0.2, 1.5), y + 3)])
    return box(0, 0, w, h), dice.sample(shapes, dice.randint(2, 5))


def _concave_floors(dice, reach):
    w, h = SIZE
    a, b, c = dice.uniform(2, 3.5), dice.uniform(5, 7), dice.uniform(1, 3)
    outlines = [
        [(0, 0), (w, 0), (w, c + 1), (a, c + 1), (a, h), (0, h)],
        [(0, 0), (w, 0), (w, h), (b, h), (b, c), (a, c), (a, h), (0, h)],
        [(0, 0), (w, 0), (w, h), (b, h), (a, 0.6 * h), (0, h)],
        [(0, 0), (a, 0.3 * h), (b, 0), (w, 0.5 * h), (b, h), (a, 0.7 * h), (0, h)],
    ]
    return dice.choice(outlines), dice.choice((_boxes, _convex))(dice, reach)[1][:3]


def _thin_walls(dice, reach):
    w, h = SIZE
    shapes = []
    for x in sorted(dice.sample((1.5, 3.0, 4.5, 6.0, 7.5), dice.randint(1, 3))):
        thick, door = dice.choice((1e-3, 1e-2, 5e-2)), reach * dice.choice((1.9, 2.2, 5.0))
        y = dice.uniform(0.0, h - door)
        shapes += [box(x, 0, x + thick, y), box(x, y + door, x + thick, h)]
    shapes = [ring for ring in shapes if ring[2][1] - ring[0][1] > 1e-3]
    return box(0, 0, w, h), shapes


def _cells(dice, _):
    size = dice.choice((0.5, 1.0))
    taken = dice.uniform(0.05, 0.25)
    places = itertools.product(range(int(SIZE[0] / size)), range(int(SIZE[1] / size)))
    chosen = [place for place in places if dice.random() < taken]
    chosen = dice.sample(chosen, min(len(chosen), 9))
    return box(0, 0, *SIZE), [
        box(c * size, r * size, (c + 1) * size, (r + 1) * size) for c, r in chosen
    ]


def _slivers(dice, _):
    shapes = []
    for _ in range(dice.randint(2, 5)):
        (x, y), angle = _place(dice), dice.uniform(0, 2 * math.pi)
        long, thin = dice.uniform(0.5, 4.0), dice.choice((1e-6, 1e-4, 1e-2))
        ax, ay = long * math.cos(angle), long * math.sin(angle)
        bx, by = -thin * math.sin(angle), thin * math.cos(angle)
        shapes.append([(x, y), (x + ax, y + ay), (x + bx, y + by)])
    return box(0, 0, *SIZE), shapes


def _nearly_touching(dice, reach):
    gaps = (1e-9, -1e-9, 1e-12, 1e-6, 2.0 * reach + 1e-3, 2.0 * reach - 1e-3)
    shapes = []
    for _ in range(dice.randint(1, 3)):
        x, y = _place(dice)
        for _ in range(dice.randint(2, 3)):
            w, h, dy = dice.uniform(0.3, 1.0), dice.uniform(0.3, 1.2), dice.choice((0, 0, 0.3))
            shapes.append(box(x, y + dy, x + w, y + dy + h))
            x += w + dice.choice(gaps)
    return box(0, 0, *SIZE), shapes


def _collinear(dice, reach):
    outline, shapes = dice.choice((_boxes, _concave, _convex))(dice, reach)
    return _with_points_between(dice, outline), [
        _with_points_between(dice, ring) for ring in shapes[:3]
    ]


def _with_points_between(dice, ring):
    points = []
    for (ax, ay), (bx, by) in itertools.pairwise([*ring, ring[0]]):
        parts = sorted({0.0, *(dice.choice((0.25, 0.5, dice.random())) for _ in range(2))})
        points += [(ax + part * (bx - ax), ay + part * (by - ay)) for part in parts]
    return points


KINDS = {
    "boxes": _boxes,
    "cells": _cells,
    "collinear points": _collinear,
    "concave floors": _concave_floors,
    "concave polygons": _concave,
    "convex polygons": _convex,
    "courtyards": _courtyards,
    "nearly touching": _nearly_touching,
    "on the edge": _on_the_edge,
    "overlapping": _overlapping,
    "shared edges": _shared_edges,
    "slivers": _slivers,
    "stars": _stars,
    "thin walls": _thin_walls,
    "touching corners": _touching_corners,
}
