"""Robots that start, or end, as near to others as they may: what zones may ask of them.

A zone asks for a little more than the need.  Where two robots stand nearer than that, and no nearer
than they may, it would hold their very places, and no order of the two would work.  For these
robots it asks for just what their places on the wire leave.

Decides: how much less.  Must not know: paths, zones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely

from coordinator.curves.nurbs import Array
from coordinator.scenario.model import Scenario

_ERROR: Final = 5e-4
"""How far chords may be from a path [m] where robots stand no nearer than zones ask."""

_SMALL_ERROR: Final = 2e-5
"""The same for robots that do: their zones fall short of the need by twice this at most, and by
what float32 takes."""

_ROUNDING: Final = 1e-8
"""What sums of distances lose [m]; places nearer than the need by less are no nearer."""


@dataclass(frozen=True, eq=False)
class NearPlaces:
    """Per robot: what zones ask less for it [m], and how far its chords may be out [m]; (n,)."""

    less: Array
    errors: Array


def near_places(scenario: Scenario, pad: float) -> NearPlaces:
    """Return what zones that ask for the need and `pad` [m] more have to ask less."""
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
