"""One robot's way in space and time among others: searched on its mesh, pulled taut.

Decides: how much such a way keeps beyond what is needed, and how long it is searched.  Must not
know: who the others are, curves.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from coordinator.bends.mesh_kernels import Mesh
from coordinator.bends.taut_kernels import pulled_taut
from coordinator.bends.traffic_kernels import Traffic
from coordinator.bends.way_kernels import Trip, earliest_way
from coordinator.curves.nurbs import Array
from coordinator.ground.free_space import Space

PADS: Final = ((0.25, 0.04), (0.5, 0.09), (1.0, 0.12))
"""What a way keeps beyond tau [s] and the need [m]: its curve and its times differ a little from
those of the mesh.  If the curve meets others, the next pair is tried."""

_MOST_STATES: Final = 20_000
"""How many states the search for one way expands at most in the first plan."""


def way_among(
    mesh: Mesh,
    trip: Trip,
    space: Space,
    traffic: Traffic,
    latest: float,
    most: int = _MOST_STATES,
) -> tuple[Array, Array]:
    """Return the polygon (n, 2) [m] of the earliest way, and when the robot comes and goes there.

    The times are (n, 2) [s].  Empty if it cannot arrive before `latest` [s], or if no such way is
    found with `most` states.
    """
    way, when = earliest_way(mesh, trip, traffic, latest, most)
    if not len(way):
        return way, when
    one, other = np.triu_indices(len(way), 1)
    sight = np.zeros((len(way), len(way)), dtype=np.bool_)
    sight[one, other] = space.keeping(way[one], way[other])
    kept, times = pulled_taut(way, when, sight, trip, traffic)
    return way[kept], times
