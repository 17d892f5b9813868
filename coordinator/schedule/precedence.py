"""Who has to go first because a start or goal lies on another robot's path, whatever the times.

A robot has to be the first through a zone that contains its start, and the second through one that
contains its goal.  If a zone demands both orders, the two robots can never pass each other.

Decides: which orders the paths alone demand.  Must not know: times.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from graphlib import CycleError, TopologicalSorter

import numpy as np
import numpy.typing as npt

from coordinator.schedule.junctions import Junctions

Flags = npt.NDArray[np.bool_]


def demands(junctions: Junctions) -> tuple[Flags, Flags]:
    """Return for each zone whether robot a has to pass it first, and whether robot b has."""
    zones, lengths = junctions.zones, np.array(junctions.lengths())
    a0, a1, b0, b1 = zones.extent.T
    a_first = (a0 <= 0.0) | (b1 >= lengths[zones.b])
    b_first = (b0 <= 0.0) | (a1 >= lengths[zones.a])
    return a_first, b_first


def stuck_pairs(junctions: Junctions) -> list[tuple[int, int]]:
    """Return the pairs that can pass each other in neither order, even without other robots."""
    a_first, b_first = demands(junctions)
    stuck = np.flatnonzero(a_first & b_first)
    pairs = zip(junctions.zones.a[stuck].tolist(), junctions.zones.b[stuck].tolist(), strict=True)
    return sorted(set(pairs))


def ring_of(junctions: Junctions) -> list[int]:
    """Return robots of which each has to go before the next, and the last before the first.

    The list is empty when the orders that the paths demand form no ring.
    """
    before, after = _edges(junctions)
    needs: dict[int, set[int]] = {}
    for one, two in zip(before.tolist(), after.tolist(), strict=True):
        needs.setdefault(two, set()).add(one)
    try:
        TopologicalSorter(needs).prepare()
    except CycleError as error:
        return [int(index) for index in error.args[1][:-1]]
    return []


def first_order(junctions: Junctions, priorities: Sequence[int]) -> list[int]:
    """Return the order to begin with: by the paths' demands, then priority, then driving time.

    The driving time is that of a robot that no other robot delays.  Within a ring of demands,
    priority and driving time decide.
    """
    count = len(priorities)
    alone = [track.alone for track in junctions.tracks]
    before, after = _edges(junctions)
    waiting_for = np.bincount(after, minlength=count)
    order: list[int] = []
    ready: list[tuple[int, float, int]] = []
    left = set(range(count))

    def key(index: int) -> tuple[int, float, int]:
        return -priorities[index], alone[index], index

    for index in np.flatnonzero(waiting_for == 0).tolist():
        heapq.heappush(ready, key(index))
    while left:
        index = heapq.heappop(ready)[2] if ready else min(left, key=key)
        if index not in left:
            continue
        left.remove(index)
        order.append(index)
        for other in after[before == index].tolist():
            waiting_for[other] -= 1
            if waiting_for[other] == 0:
                heapq.heappush(ready, key(other))
    return order


def _edges(junctions: Junctions) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return the pairs (before, after) of robots whose order the paths demand."""
    a_first, b_first = demands(junctions)
    zones = junctions.zones
    one, two = a_first & ~b_first, b_first & ~a_first
    before = np.concatenate((zones.a[one], zones.b[two]))
    after = np.concatenate((zones.b[one], zones.a[two]))
    pairs = np.unique(np.column_stack((before, after)), axis=0)
    return pairs[:, 0], pairs[:, 1]
