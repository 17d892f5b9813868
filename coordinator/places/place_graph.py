"""A graph of places on a floor where discs may rest, and of ways between them.

The places are the robots' starts and goals, and others that are chosen so that a disc at one closes
few of the others: ends of aisles, bays and corners first, then the rest of the floor, filled as
densely as two discs may stand.  A robot that has to keep to one way has places along it.

Decides: where places are and which of them are connected.  Must not know: who moves when.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
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

_SAME_PLACE: Final = 6
"""Starts and goals with the same so many decimals [m] are one place, as on a circle of robots."""

_PER_NEED: Final = 8.0
_LEAST_PER_NEED: Final = 3.0
_MOST_POINTS: Final = 250_000
"""The candidates for places lie on a square grid, this many per need, or fewer on large floors; on
the largest ones places are farther apart than the need."""

_LONGEST: Final = 1.8
_LONGEST_AROUND: Final = 3.0
"""Places are connected by a straight edge of up to this many needs, or by a way around corners."""

_FINER: Final = 4.0
"""Places for small robots are no more than so many times closer than those for large ones, since
each edge has all those near it where a large one would be."""

_NEIGHBOURS: Final = 64
"""A place is connected to so many others at most, the nearest ones, as small robots' places may lie
close to each other."""

_PARALLEL: Final = 0.1
"""The first and the last leg of a way meet at one corner if the sine of their angle is more."""

_PER_MOVE: Final = 0.3
"""What a move costs beside its length [m]: each is a place where the robot may have to stop."""


NO_OWN_WAYS: Final[Mapping[int, Sequence[Array]]] = MappingProxyType({})


@dataclass(frozen=True, eq=False)
class Graph:
    """Places (V, 2) [m], the edges between them, and the way (n, 2) [m] along each edge."""

    places: Array
    edges: Edges
    ways: list[Array]
    team: Team


@dataclass(frozen=True, eq=False)
class _Net:
    """Places (V, 2) [m] with their `spare` [m] (V,), and edges: `pairs` (edges, 2), `ways`.

    owner (edges,): the only robot that may pass an edge, -1 if any robot may that has room.
    """

    places: Array
    spare: Array
    pairs: Indices
    ways: list[Array]
    owner: Indices

    def with_own(self, robot: int, parts: Sequence[Array]) -> _Net:
        """Return the net with a robot's own way; its places come last, in the order of driving."""
        line = np.array([parts[0][0], *(part[-1] for part in parts)])
        spare = np.full(len(line), _LESS_AT_ENDS)
        spare[[0, -1]] = ROOM
        numbers = len(self.places) + np.arange(len(line))
        onward = np.column_stack((numbers[:-1], numbers[1:]))
        return _Net(
            np.concatenate((self.places, line)),
            np.append(self.spare, spare),
            np.concatenate((self.pairs, onward, onward[:, ::-1])),
            [*self.ways, *parts, *(part[::-1] for part in parts)],
            np.append(self.owner, np.full(2 * len(parts), robot)),
        )

    def legs(self) -> tuple[Array, Array, Indices]:
        """Return all ways' straight legs, from (k, 2) [m] and to (k, 2) [m].

        Beside them, the number of each way's first leg (edges,).
        """
        sizes = np.array([len(way) for way in self.ways])
        flat, inside = np.concatenate(self.ways), np.ones(int(sizes.sum()) - 1, np.bool_)
        inside[np.cumsum(sizes)[:-1] - 1] = False
        first = np.cumsum(sizes - 1) - (sizes - 1)
        return flat[:-1][inside], flat[1:][inside], first

    def edges(self, reach: float) -> tuple[Edges, _Net]:
        """Return the edges with the places within `reach` [m] of each, and the net in their order.

        Both directions of an edge are in `pairs`.
        """
        order = np.lexsort((self.pairs[:, 1], self.pairs[:, 0]))
        ways = [self.ways[k] for k in order.tolist()]
        net = _Net(self.places, self.spare, self.pairs[order], ways, self.owner[order])
        origin, to = net.pairs.T.copy()
        flat, begins = np.concatenate(ways), np.cumsum([0, *map(len, ways)])
        from_place, to_place, first = net.legs()
        lengths = np.add.reduceat(np.hypot(*(to_place - from_place).T), first)
        return Edges(
            np.searchsorted(origin, np.arange(len(self.places) + 1)),
            to,
            lengths + _PER_MOVE,
            *places_near(flat, begins, origin, to, self.places, self.spare, reach),
            origin,
            np.lexsort((origin, to)),
        ), net


_EMPTY: Final = _Net(
    np.empty((0, 2)), np.empty(0), np.empty((0, 2), np.int64), [], np.empty(0, np.int64)
)


def place_graph(
    scenario: Scenario,
    floor: GrownFloor,
    radii: Sequence[float],
    density: float = 1.0,
    own_ways: Mapping[int, Sequence[Array]] = NO_OWN_WAYS,
) -> Graph | None:
    """Return the graph for robots of a scenario, whose `radii` [m] are at most theirs.

    Places in between are at least 1 / `density` of the distance apart that robots at rest keep.
    `own_ways`: of each robot (index) that has to keep to one way, the parts (n, 2) [m] of that way,
    two or more, at whose ends it may rest.
    None if no robot can move from any place to another.
    """
    robots, margin, sizes = scenario.robots, scenario.margin, np.round(radii, 6)
    free = [index for index in range(len(robots)) if index not in own_ways]
    kinds, of_free = np.unique(sizes[free], return_inverse=True)
    ends = np.array([p[:2] for k in free for p in (robots[k].start, robots[k].goal)]).reshape(-1, 2)
    _, first, whose = np.unique(
        np.round(ends, _SAME_PLACE), axis=0, return_index=True, return_inverse=True
    )
    places = ends[first]
    number = np.empty((len(robots), 2), np.int64)
    number[free] = whose.reshape(-1, 2)
    slack = (floor.distance(places)[number[free]] - kinds[of_free, None] - margin).min(axis=1)
    spaces = [
        _space(floor, radius + margin, float(slack[of_free == k].min()))
        for k, radius in enumerate(kinds.tolist())
    ]
    net = _shared(places, spaces, floor, kinds.tolist(), margin, density) if free else _EMPTY
    for index, parts in own_ways.items():
        number[index] = len(net.places) + np.array((0, len(parts)))
        net = net.with_own(index, parts)
    if not net.ways:
        return None
    radius = np.append(kinds, sizes[list(own_ways)])
    need = radius[:, None] + radius + margin + ROOM
    edges, net = net.edges(float(need.max()))
    onward, (here, there, first) = edges.origin < edges.to, net.legs()
    fits = np.array(
        [
            (net.owner < 0) & np.logical_and.reduceat(space.keeping(here, there), first)
            for space in spaces
        ]
        + [(net.owner == index) & onward for index in own_ways]
    )
    kind = np.empty(len(robots), np.int64)
    kind[free], kind[list(own_ways)] = of_free, len(kinds) + np.arange(len(own_ways))
    starts, goals = number.T.copy()
    nothing = np.zeros(len(net.ways))
    left = np.array(
        [costs_to(goals[i : i + 1], edges, fits[k], nothing) for i, k in enumerate(kind)]
    )
    team = Team(
        kind,
        starts,
        goals,
        left,
        np.zeros(len(robots), np.int64),
        np.arange(len(net.places)) == goals[:, None],
        need,
        fits,
        kind >= len(kinds),
    )
    return Graph(net.places, edges, net.ways, team)


def _shared(
    ends: Array,
    spaces: list[Space],
    floor: GrownFloor,
    radii: Sequence[float],
    margin: float,
    density: float,
) -> _Net:
    """Return the net of robots that may drive anywhere, of these radii [m], the least first.

    There are places for the largest robots, and for the smallest where the largest cannot be.
    """
    between, below = np.empty((0, 2)), math.inf
    widest = _spacing(radii[-1], margin)
    least = max(_LEAST_PER_NEED * _least_pitch(floor), widest / density / _FINER)
    for radius in dict.fromkeys((radii[-1], radii[0])):
        apart = max(_spacing(radius, margin) / density, least)
        reach = radius + margin + _TOUCH
        between = np.concatenate((between, _spread(floor, (reach, below), apart, between)))
        below = reach
    places = np.concatenate((ends, between))
    spare = np.where(np.arange(len(places)) < len(ends), ROOM, _LESS_AT_ENDS)
    pairs, ways = _connected(places, spaces, max(widest, least))
    return _Net(places, spare, pairs, ways, np.full(len(ways), -1))


def _spacing(radius: float, margin: float) -> float:
    """Return how far apart [m] two robots of a radius keep at rest."""
    return 2.0 * radius + margin + 2.0 * ROOM


def _least_pitch(floor: GrownFloor) -> float:
    """Return the pitch [m] of a square grid that has _MOST_POINTS on a floor."""
    x0, y0, x1, y1 = floor.outline.bounds
    return math.sqrt((x1 - x0) * (y1 - y0) / _MOST_POINTS)


def _space(floor: GrownFloor, reach: float, spare: float) -> Space:
    """Return the space of robots whose starts and goals have so much to `spare` [m].

    Ways go around corners at a distance at which these can be rounded, even if there is none to
    spare at an end.
    """
    touch = min(max(spare - _FLUSH, 0.0), _TOUCH)
    return Space(floor.ground(reach + _TOUCH), reach + 0.5 * touch - _FLUSH, 0.4 * touch)


def _spread(
    floor: GrownFloor, clearance: tuple[float, float], spacing: float, taken: Array
) -> Array:
    """Return places (n, 2) [m] at least `spacing` apart, those that close least of the floor first.

    clearance [m]: farther than the first from what is solid, and no farther than the second;
    taken (k, 2) [m]: other places, from which they are as far apart.  What a disc closes is
    measured by how much free floor there is within `spacing` of its centre.
    """
    x0, y0, x1, y1 = floor.outline.bounds
    pitch = max(spacing / _PER_NEED, _least_pitch(floor))
    xs, ys = np.arange(x0, x1, pitch), np.arange(y0, y1, pitch)
    points = np.stack(np.meshgrid(xs, ys), axis=-1)
    away = floor.distance(points.reshape(-1, 2)).reshape(points.shape[:2])
    free = (away > clearance[0]) & (away <= clearance[1])
    if len(taken):
        free &= KDTree(taken).query(points)[0] >= spacing
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
    near = _neighbours(places, _LONGEST * spacing)
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
            ways.append(_with_one_corner(way, wide))
    both = np.array(pairs).reshape(-1, 2)
    return np.concatenate((both, both[:, ::-1])), [*ways, *(way[::-1] for way in ways)]


def _neighbours(places: Array, reach: float) -> Indices:
    """Return pairs (n, 2) of places within `reach` [m]: each with its _NEIGHBOURS nearest ones."""
    others = 1 + min(_NEIGHBOURS, len(places) - 1)
    apart, other = KDTree(places).query(places, others, distance_upper_bound=reach)
    one, rank = np.nonzero(np.isfinite(np.asarray(apart)[:, 1:]))
    pairs = np.column_stack((one, np.asarray(other)[one, 1 + rank])).astype(np.int64)
    return np.unique(np.sort(pairs, axis=1), axis=0)


def _with_one_corner(way: Array, space: Space) -> Array:
    """Return a way (n, 2) around a corner with one vertex in place of several, if it is clear.

    Each vertex costs a message as many bytes as any other, also those close to each other.
    """
    if len(way) < 4:
        return way
    out, back = way[1] - way[0], way[-2] - way[-1]
    across = out[0] * back[1] - out[1] * back[0]
    if abs(across) < _PARALLEL * np.hypot(*out) * np.hypot(*back):
        return way
    gap = way[-1] - way[0]
    share = (gap[0] * back[1] - gap[1] * back[0]) / across
    far = (gap[0] * out[1] - gap[1] * out[0]) / across
    corner = way[0] + share * out
    shorter = np.stack((way[0], corner, way[-1]))
    is_ahead = share >= 1.0 and far >= 1.0
    if is_ahead and space.keeping(shorter[:-1], shorter[1:]).all():
        return shorter
    return way
