"""The shortest control polygon: straight when free, else taut around grown obstacles.

Decides: the cheapest way as travel time at one speed, so as length (Eq. 1-4).  A* over the corners
with lazy visibility: a line of sight is tested only from corners that the search reaches.
Must not know: curves, robots or times.
"""

from __future__ import annotations

import heapq

import numpy as np

from coordinator.floor import Ground
from coordinator.nurbs import Array


def shortest_way(ground: Ground, start: Array, goal: Array) -> Array | None:
    """Return the corners (n, 2) [m] of the shortest way, start and goal included; None if none.

    start, goal: (2,) [m].
    """
    if bool(ground.clear(start, goal[None, :])[0]):
        return np.stack((start, goal))
    places = np.vstack((start, goal, ground.corners))
    to_goal = np.hypot(*(places - goal).T)
    cost = np.full(len(places), np.inf)
    cost[0] = 0.0
    parent = np.zeros(len(places), dtype=np.intp)
    closed = np.zeros(len(places), dtype=np.bool_)
    heap: list[tuple[float, int]] = [(float(to_goal[0]), 0)]
    while heap:
        _, here = heapq.heappop(heap)
        if closed[here]:
            continue
        if here == 1:
            return _trace(places, parent)
        closed[here] = True
        step = np.hypot(*(places - places[here]).T)
        worth = np.flatnonzero(~closed & (cost[here] + step < cost - 1e-12))
        seen = worth[ground.clear(places[here], places[worth])]
        cost[seen] = cost[here] + step[seen]
        parent[seen] = here
        for there in seen.tolist():
            heapq.heappush(heap, (float(cost[there] + to_goal[there]), there))
    return None


def _trace(places: Array, parent: np.ndarray[tuple[int], np.dtype[np.intp]]) -> Array:
    chain = [1]
    while chain[-1] != 0:
        chain.append(int(parent[chain[-1]]))
    return places[chain[::-1]]
