"""A graph of places on a floor where discs may rest, and of ways between them.

The places are the robots' starts and goals, and others that are chosen so that a disc at one closes
few of the others: ends of aisles, bays and corners first, then the rest of the floor, filled as
densely as two discs may stand.

Decides: where places are and which of them are connected.  Must not know: who moves when.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy.ndimage as ndimage
from scipy.spatial import KDTree

from coordinator.curves.nurbs import Array
from coordinator.ground.free_space import NO_DISCS, Space
from coordinator.ground.grown_floor import GrownFloor
from coordinator.places.move_kernels import Edges, Indices, Team, costs_to, places_near
from coordinator.scenario.model import Scenario

ROOM: Final = 0.02
"""Edges keep this much more [m] from robots at rest, since curves round the corners of edges."""

_LESS_AT_ENDS: Final = 0.008
"""By how much less [m] where a robot is at one of the places: it comes there exactly.  Starts and
goals may lie as near to each other as is allowed."""

_TOUCH: Final = 0.0005
"""Edges keep this much more [m] from solid things, for float32 and chords."""

_FLUSH: Final = 2e-6
"""What float32 may change [m] where a robot stands exactly as near to walls as is allowed."""

_PER_NEED: Final = 8.0
_MOST_POINTS: Final = 250_000
"""The candidates for places lie on a square grid, this many per need, or fewer on large floors."""

_LONGEST: Final = 1.8
_LONGEST_AROUND: Final = 3.0
"""Places are connected by a straight edge of up to this many needs, or by a way around corners."""

_PER_MOVE: Final = 0.3
"""What a move costs beside its length [m]: each is a place where the robot may have to stop."""


@dataclass(frozen=True, eq=False)
class Graph:
    """Places (V, 2) [m], the edges between them, and the way (n, 2) [m] along each edge."""

    places: Array
    edges: Edges
    ways: list[Array]
    team: Team


def place_graph(
    scenario: Scenario, floor: GrownFloor, radii: Sequence[float], density: float = 1.0
) -> Graph | None:
    """Return the graph for robots of a scenario, whose `radii` [m] are at most theirs.

    Places in between are at least 1 / `density` of the distance apart that robots at rest keep.
    None if no robot can move from any place to another.
    """
    robots, margin = scenario.robots, scenario.margin
    kinds, kind = np.unique(np.round(radii, 6), return_inverse=True)
    need = kinds[:, None] + kinds[None, :] + margin + ROOM
    ends = np.array([place[:2] for robot in robots for place in (robot.start, robot.goal)])
    keep = kinds + margin
    slack = floor.distance(ends) - np.repeat(keep[kind], 2)
    spaces = [
        _space(floor, reach, float(slack.reshape(-1, 2)[kind == k].min()))
        for k, reach in enumerate(keep.tolist())
    ]
    ends, whose = np.unique(ends, axis=0, return_inverse=True)
    spacing = float(need[-1, -1]) + ROOM
    between = _spread(floor, float(kinds[-1]) + margin + _TOUCH, spacing / density)
    places = np.concatenate((ends, between))
    pairs, ways = _connected(places, spaces, spacing)
    if not ways:
        return None
    order = np.lexsort((pairs[:, 1], pairs[:, 0]))
    pairs, ways = pairs[order], [ways[k] for k in order.tolist()]
    spare = np.where(np.arange(len(places)) < len(ends), ROOM, _LESS_AT_ENDS)
    flat, begins = np.concatenate(ways), np.cumsum([0, *map(len, ways)])
    legs = np.array([float(np.hypot(*np.diff(way, axis=0).T).sum()) for way in ways])
    first = np.searchsorted(pairs[:, 0], np.arange(len(places) + 1))
    origin, to = pairs.T.copy()
    edges = Edges(
        first,
        to,
        legs + _PER_MOVE,
        *places_near(flat, begins, origin, to, places, spare, float(need.max())),
        origin,
        np.lexsort((pairs[:, 0], pairs[:, 1])),
    )
    fits = np.array([[bool(space.keeping(w[:-1], w[1:]).all()) for w in ways] for space in spaces])
    starts, goals = whose.reshape(-1, 2).T.astype(np.int64, order="C")
    nothing = np.zeros(len(ways))
    left = np.array(
        [costs_to(goals[i : i + 1], edges, fits[k], nothing) for i, k in enumerate(kind)]
    )
    count = len(robots)
    team = Team(
        kind.astype(np.int64),
        starts,
        goals,
        left,
        np.zeros(count, np.int64),
        np.arange(len(places)) == goals[:, None],
        need,
        fits,
    )
    return Graph(places, edges, ways, team)


def _space(floor: GrownFloor, reach: float, spare: float) -> Space:
    """Return the space of robots whose starts and goals have so much to `spare` [m].

    Ways go around corners at a distance at which these can be rounded, even if there is none to
    spare at an end.
    """
    touch = min(max(spare - _FLUSH, 0.0), _TOUCH)
    return Space(floor.ground(reach + _TOUCH), reach + 0.5 * touch - _FLUSH, 0.4 * touch)


def _spread(floor: GrownFloor, reach: float, spacing: float) -> Array:
    """Return places (n, 2) [m] at least `spacing` apart, those that close least of the floor first.

    What a disc closes is measured by how much free floor there is within `spacing` of its centre.
    """
    x0, y0, x1, y1 = floor.outline.bounds
    pitch = max(spacing / _PER_NEED, math.sqrt((x1 - x0) * (y1 - y0) / _MOST_POINTS))
    xs, ys = np.arange(x0, x1, pitch), np.arange(y0, y1, pitch)
    points = np.stack(np.meshgrid(xs, ys), axis=-1)
    free = (floor.distance(points.reshape(-1, 2)) > reach).reshape(points.shape[:2])
    around = int(spacing / pitch) + 1
    offsets = pitch * np.arange(-around, around + 1)
    disc = np.hypot(*np.meshgrid(offsets, offsets)) < spacing
    closes = ndimage.convolve(free.astype(np.int64), disc.astype(np.int64), mode="constant")
    found: list[Array] = []
    rows, columns = np.nonzero(free)
    for at in np.argsort(closes[rows, columns], kind="stable").tolist():
        row, column = int(rows[at]), int(columns[at])
        if not free[row, column]:
            continue
        found.append(points[row, column])
        low, left = max(row - around, 0), max(column - around, 0)
        part = free[low : row + around + 1, left : column + around + 1]
        part[
            disc[
                low - row + around : low - row + around + part.shape[0],
                left - column + around : left - column + around + part.shape[1],
            ]
        ] = False
    return np.array(found).reshape(-1, 2)


def _connected(places: Array, spaces: list[Space], spacing: float) -> tuple[Indices, list[Array]]:
    """Return which places are connected (edges, 2), in both directions, and along which ways."""
    wide = spaces[0]
    near = KDTree(places).query_pairs(_LONGEST * spacing, output_type="ndarray").astype(np.int64)
    a, b = places[near[:, 0]], places[near[:, 1]]
    seen = wide.keeping(a, b)
    pairs = near[seen].tolist()
    ways = [np.stack(ends) for ends in zip(a[seen], b[seen], strict=True)]
    for one, other in near[~seen].tolist():
        way = wide.ground.shortest_way(
            places[one], places[other], NO_DISCS, _LONGEST_AROUND * spacing
        )
        if way is not None and wide.keeping(way[:-1], way[1:]).all():
            pairs.append([one, other])
            ways.append(way)
    both = np.array(pairs).reshape(-1, 2)
    return np.concatenate((both, both[:, ::-1])), [*ways, *(way[::-1] for way in ways)]
