"""Robots whose starts or goals are as near together as is allowed: a smaller distance for zones.

Conflict zones require a little more than the need.  If two robots stand nearer than that, but not
nearer than their need, the zone would contain their own starts or goals, and the two could pass it
in neither order.  For these robots zones require only the distance between their starts or goals as
rounded for the wire.

Decides: by how much the required distance is reduced.  Must not know: paths, zones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely

from coordinator.curves.nurbs import Array
from coordinator.scenario.model import Scenario

_ERROR: Final = 5e-4
"""How far chords may be from a path [m] if no robots stand nearer than zones require."""

_SMALL_ERROR: Final = 2e-5
"""The same for robots that stand nearer: their zones fall short of the need by at most twice this
and the rounding of float32."""

_ROUNDING: Final = 1e-8
"""The rounding error [m] of sums of distances; smaller shortfalls of the need are ignored."""


@dataclass(frozen=True, eq=False)
class NearPlaces:
    """Per robot (n,) [m]: how much less its zones require, and how far its chords may deviate."""

    less: Array
    errors: Array


def near_places(scenario: Scenario, pad: float) -> NearPlaces:
    """Return the reductions for zones that otherwise require the need plus `pad` [m]."""
    count = len(scenario.robots)
    anchors = [robot.start[:2] for robot in scenario.robots]
    anchors += [robot.goal[:2] for robot in scenario.robots]
    places = np.array(anchors, dtype=np.float64)
    radii = np.tile([robot.radius for robot in scenario.robots], 2)
    most = 2.0 * radii.max(initial=0.0) + scenario.margin + pad + 2.0 * _ERROR
    points = shapely.points(places)
    one, other = shapely.STRtree(points).query(points, predicate="dwithin", distance=most)
    chosen = one % count != other % count
    one, other = one[chosen], other[chosen]
    need = radii[one] + radii[other] + scenario.margin
    spare = np.hypot(*(places[one] - places[other]).T) - need
    sent = places.astype(np.float32).astype(np.float64)
    left = np.hypot(*(sent[one] - sent[other]).T) - need
    tight = (spare > -_ROUNDING) & (left < pad + 2.0 * _ERROR)
    less, errors = np.zeros(count), np.full(count, _ERROR)
    asked = np.maximum(0.5 * (pad - left) + _SMALL_ERROR + _ROUNDING, 0.0)
    np.maximum.at(less, one[tight] % count, asked[tight])
    errors[one[tight] % count] = _SMALL_ERROR
    return NearPlaces(less, errors)
