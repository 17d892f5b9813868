"""Independent oracles for ways and curves on floors: naive, with shapely, apart from the code.

Nothing in here imports the coordinator.
"""

from __future__ import annotations

import heapq
import itertools
import math

import numpy as np
import shapely

TURN_STEP = math.pi / 8


def grown(floor, distance):
    """All that is solid, grown: strips along edges, tangent polygons around convex corners."""
    pieces = [shapely.Polygon(ring) for ring in floor.obstacles]
    outline = shapely.Polygon(floor.boundary)
    frame = shapely.box(*outline.bounds).buffer(2.0 + distance, join_style="mitre")
    pieces.append(shapely.difference(frame, outline))
    for ring in floor.obstacles:
        pieces += _gain(_solid_on_the_left(ring, False), distance)
    pieces += _gain(_solid_on_the_left(floor.boundary, True), distance)
    # Without a grid GEOS 3.14 may drop a piece without a word.
    return _without_cracks(shapely.union_all(pieces, grid_size=1e-9))


def _without_cracks(area):
    """Fill the holes that the grid leaves between pieces that share an edge."""
    filled = []
    for part in shapely.get_parts(area):
        holes = [ring for ring in part.interiors if shapely.Polygon(ring).area > 1e-7]
        filled.append(shapely.Polygon(part.exterior, holes))
    return shapely.MultiPolygon(filled)


def _solid_on_the_left(ring, outside):
    anticlockwise = shapely.LinearRing(ring).is_ccw
    return ring if anticlockwise != outside else ring[::-1]


def _gain(ring, distance):
    """What a ring gains: a strip per edge, a tangent polygon per convex corner."""
    ring = [p for p, q in zip(ring, [ring[-1], *ring[:-1]], strict=True) if p != q]
    pieces = []
    for (ax, ay), (bx, by), (cx, cy) in zip(
        ring, ring[1:] + ring[:1], ring[2:] + ring[:2], strict=True
    ):
        into, onward = math.atan2(by - ay, bx - ax), math.atan2(cy - by, cx - bx)
        nx, ny = distance * math.sin(into), -distance * math.cos(into)
        strip = [(ax, ay), (ax + nx, ay + ny), (bx + nx, by + ny), (bx, by)]
        pieces.append(shapely.Polygon(strip))
        turn = math.remainder(onward - into, 2.0 * math.pi)
        if turn > 1e-9:
            pieces.append(_tangent_polygon(bx, by, into - 0.5 * math.pi, turn, distance))
    return pieces


def _tangent_polygon(x, y, first, turn, distance):
    count = math.ceil(turn / TURN_STEP - 1e-9)
    angles = [first + turn * (k + 0.5) / count for k in range(count)]
    far = distance / math.cos(0.5 * turn / count)
    ring = [(first, distance), *((a, far) for a in angles), (first + turn, distance)]
    return shapely.Polygon([(x, y), *((x + r * math.cos(a), y + r * math.sin(a)) for a, r in ring)])


def convex_corners(area, least_turn=1e-6):
    """The corners (n, 2) of an area that a taut way can turn at: those that stick out.

    `least_turn` [rad] leaves out what rounding makes of places on a straight edge.
    """
    found = [np.empty((0, 2))]
    for part in shapely.get_parts(shapely.orient_polygons(area)):
        for ring in (part.exterior, *part.interiors):
            at = shapely.get_coordinates(ring)[:-1]
            into, onward = at - np.roll(at, 1, axis=0), np.roll(at, -1, axis=0) - at
            cross = into[:, 0] * onward[:, 1] - into[:, 1] * onward[:, 0]
            turn = np.arctan2(cross, np.einsum("ij,ij->i", into, onward))
            found.append(at[turn > least_turn])
    return np.concatenate(found)


class VisibilityGraph:
    """Lengths of shortest ways: Dijkstra over the full visibility graph of the corners (n, 2)."""

    def __init__(self, blocked, corners, discs=()):
        self.blocked, self.corners, self.discs = blocked, corners, discs
        shapely.prepare(blocked)
        pairs = np.array(list(itertools.combinations(range(len(corners)), 2))).reshape(-1, 2)
        free = self.free(corners[pairs[:, 0]], corners[pairs[:, 1]])
        self.pairs = pairs[free]

    def free(self, starts, ends):
        """Which straight lines (k, 2)-(k, 2) meet nothing that is blocked."""
        lines = shapely.linestrings(np.stack((starts, ends), axis=1))
        free = ~shapely.intersects(self.blocked, lines)
        for x, y, radius in self.discs:
            free &= shapely.distance(lines, shapely.Point(x, y)) > radius
        return free

    def length(self, start, goal):
        """The length of the shortest way; inf when there is none."""
        places = np.concatenate((self.corners, [start, goal]))
        count = len(self.corners)
        ends = np.arange(count + 1)
        more = [np.column_stack((ends[:-1], np.full(count, count)))]
        more.append(np.column_stack((ends, np.full(count + 1, count + 1))))
        more = np.concatenate(more)
        more = more[self.free(places[more[:, 0]], places[more[:, 1]])]
        pairs = np.concatenate((self.pairs, more))
        sizes = np.hypot(*(places[pairs[:, 0]] - places[pairs[:, 1]]).T)
        return _dijkstra(len(places), pairs.tolist(), sizes.tolist(), count, count + 1)


def _dijkstra(count, pairs, sizes, start, goal):
    neighbours = [[] for _ in range(count)]
    for (i, j), size in zip(pairs, sizes, strict=True):
        neighbours[i].append((j, size))
        neighbours[j].append((i, size))
    best, heap = {start: 0.0}, [(0.0, start)]
    while heap:
        cost, here = heapq.heappop(heap)
        if here == goal:
            return cost
        for there, size in neighbours[here] if cost <= best[here] else []:
            if cost + size < best.get(there, math.inf):
                best[there] = cost + size
                heapq.heappush(heap, (cost + size, there))
    return math.inf
