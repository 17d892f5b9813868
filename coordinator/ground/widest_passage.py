"""The greatest clearance with which any way can lead from one place to another.

A disc can pass between two solid edges if it is no wider than their gap.  Gaps that it cannot pass
join edges into chains.  A closed chain separates the two places if the straight line between them
crosses it an odd number of times.  The narrowest such chain is found without searching for ways, by
a minimum spanning forest of the edges by gap; each of the other gaps closes one chain.

Decides: the reach at which two places are separated.  Must not know: robots, or how messages use
the result.
"""

from __future__ import annotations

import itertools

import numpy as np
import numpy.typing as npt
import shapely
from scipy.sparse import csr_array
from scipy.sparse.csgraph import (
    breadth_first_order,
    connected_components,
    minimum_spanning_tree,
)

from coordinator.curves.nurbs import Array
from coordinator.ground.growth import Rings

Parities = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.intp]


def widest_reach(rings: Rings, start: Array, goal: Array, most: float) -> float | None:
    """Return the least reach [m] at which there is no way from start to goal (2,).

    None if there is a way even at `most` [m]; 0 if touching obstacles enclose one of the places.
    A centre with any smaller reach has a way.  `Ground` replaces the arcs at corners by tangent
    polygons, so between two corners it passes only reaches up to cos(TURN_STEP / 2) times this.
    """
    ends = np.stack((rings.corners, rings.corners[rings.following]), axis=1)
    edges = shapely.linestrings(ends)
    one, other = shapely.STRtree(edges).query(edges, predicate="dwithin", distance=2.0 * most)
    one, other = one[one < other], other[one < other]
    lines = shapely.shortest_line(edges[one], edges[other])
    touch = shapely.get_coordinates(lines).reshape(-1, 2, 2)
    gap = shapely.length(lines)
    middle = ends.mean(axis=1)
    stations = (middle[one], touch[:, 0], touch[:, 1], middle[other])
    odd = np.zeros(len(one), dtype=np.bool_)
    for begin, end in itertools.pairwise(stations):
        odd ^= _crosses(begin, end, start, goal)
    parity = _parities(len(edges), one, other, gap, odd)
    parting = gap[parity[one] ^ parity[other] ^ odd]
    return 0.5 * float(parting.min()) if len(parting) else None


def _crosses(begin: Array, end: Array, start: Array, goal: Array) -> Parities:
    """Return which of the lines begin-end (n, 2) cross the one from start to goal (2,)."""
    along = goal - start
    (before, here), (after, there) = (
        (along[0] * away[:, 1] - along[1] * away[:, 0], away @ along)
        for away in (begin - start, end - start)
    )
    apart = (before >= 0.0) != (after >= 0.0)
    share = np.divide(before, before - after, out=np.zeros_like(before), where=apart)
    place = here + share * (there - here)
    return np.asarray(apart & (place > 0.0) & (place < along @ along))


def _parities(count: int, one: Indices, other: Indices, gap: Array, odd: Parities) -> Parities:
    """Return for each edge whether its chain crosses the line an odd number of times.

    The chain runs within the spanning forest, from the first edge of the tree.
    """
    # Sparse graphs take a weight of zero for no link; before SciPy 1.17.1 they want 32-bit indices.
    one, other = one.astype(np.int32), other.astype(np.int32)
    forest = minimum_spanning_tree(csr_array((1.0 + gap, (one, other)), shape=(count, count)))
    firsts = np.unique(connected_components(forest, directed=False)[1], return_index=True)[1]
    above, below = (np.asarray(ends, dtype=np.intp) for ends in forest.nonzero())
    root = np.full(len(firsts), count)
    ends = np.array([[*above, *root], [*below, *firsts]], dtype=np.int32)
    tree = csr_array((np.ones(ends.shape[1]), (ends[0], ends[1])), shape=(count + 1, count + 1))
    order, parent = breadth_first_order(tree, count, directed=False)
    child = order[1 + len(firsts) :]
    turns = csr_array((odd.astype(np.int8), (one, other)), shape=(count, count))
    step = (turns[parent[child], child] + turns[child, parent[child]]).astype(np.bool_)
    parity = [False] * count
    for edge, before, turned in zip(
        child.tolist(), parent[child].tolist(), step.tolist(), strict=True
    ):
        parity[edge] = parity[before] != turned
    return np.array(parity, dtype=np.bool_)
