"""Compiled: where the corners of a robot's way go, and how wide each is rounded.

A way is an open polygon (n, 2) [m].  `exact` (n,) tells which vertices the curve has to pass
through: these stay where they are.  `handling` is how the robot takes corners, `solid` what it
keeps clear of.

Decides: which corners become one, which move out, and their half-widths.  Must not know: curves.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import allocation_free, compiled
from coordinator.curves.nurbs import Array
from coordinator.ground.corner_kernels import (
    NARROWEST,
    STRAIGHT,
    Corner,
    Limits,
    cost_of,
    radius_of,
    turn_between,
    widest_rounding,
    width_for,
)
from coordinator.ground.distance_kernels import Solid, keeps
from coordinator.ground.grid_kernels import Segment

Flags = npt.NDArray[np.bool_]

_END_SHARE: Final = 0.9
"""Greatest share of the first or last leg that a corner may take.  A greater share would put a knot
so near to the end of the curve that the derivative almost vanishes there."""

_WIDEST_MERGED: Final = math.radians(100.0)
"""Greatest turn of a corner made of two."""

_PUSHES: Final = (0.01, 0.03, 0.06, 0.12, 0.25, 0.5, 1.0)
"""How far [m] a corner may move out, tried in turn."""


@allocation_free
def _trial(
    a: Array,
    c: Array,
    b: Array,
    handling: Limits,
    solid: Solid,
) -> tuple[float, bool, float]:
    """Return the time [s] from a over a corner at c to b, whether it is wide enough, its radius.

    A corner is wide enough if it takes half of a leg or costs no speed.  The time is infinite if
    the legs or the corner are not clear.  The radius is in metres.
    """
    into, onward = math.hypot(c[0] - a[0], c[1] - a[1]), math.hypot(b[0] - c[0], b[1] - c[1])
    if min(into, onward) < STRAIGHT:
        return math.inf, False, 0.0
    ix, iy, ox, oy = (c[0] - a[0]) / into, (c[1] - a[1]) / into, b[0] - c[0], b[1] - c[1]
    ox, oy = ox / onward, oy / onward
    if not (
        keeps(Segment(a[0], a[1], c[0], c[1]), 0.0, solid)
        and keeps(Segment(c[0], c[1], b[0], b[1]), 0.0, solid)
    ):
        return math.inf, False, 0.0
    time = (into + onward) / handling.speed
    turn = turn_between(ix, iy, ox, oy)
    if abs(turn) < STRAIGHT:
        return time, True, math.inf
    most = min(0.5 * into, 0.5 * onward, width_for(handling.easy, turn))
    width = widest_rounding(Corner(c[0], c[1], ix, iy, ox, oy, False), most, solid)
    if width < 0.0:
        return math.inf, False, 0.0
    return time + cost_of(width, turn, handling), width >= most, radius_of(width, turn)


@compiled
def merge(
    polygon: Array,
    exact: Flags,
    begin: int,
    end: int,
    handling: Limits,
    solid: Solid,
) -> tuple[Array, Flags]:
    """Make one corner of two neighbours that turn the same way, where that is quicker.

    Only vertices begin..end - 1 that are not exact are merged.  Two neighbours are merged only if
    their roundings of radius `handling.easy` would overlap, or if `handling.worth` is positive.
    Returns the polygon and `exact`.
    """
    vertices, flags, count = polygon.copy(), exact.copy(), len(polygon)
    corner = np.empty(2)
    i = begin
    while i + 1 < end:
        a, b, c, d = vertices[i - 1], vertices[i], vertices[i + 1], vertices[i + 2]
        size = math.hypot(c[0] - b[0], c[1] - b[1])
        one = turn_between(b[0] - a[0], b[1] - a[1], c[0] - b[0], c[1] - b[1])
        two = turn_between(c[0] - b[0], c[1] - b[1], d[0] - c[0], d[1] - c[1])
        better = (
            not flags[i]
            and not flags[i + 1]
            and one * two > 0.0
            and abs(one + two) <= _WIDEST_MERGED
            and (
                handling.worth > 0.0
                or width_for(handling.easy, one) + width_for(handling.easy, two) > size
            )
        )
        if better:
            into = math.hypot(b[0] - a[0], b[1] - a[1])
            ahead = size * math.sin(abs(two)) / math.sin(abs(one + two)) / into
            corner[0], corner[1] = b[0] + ahead * (b[0] - a[0]), b[1] + ahead * (b[1] - a[1])
            single, _, _ = _trial(a, corner, d, handling, solid)
            if single < math.inf:
                pair, _, _ = _trial(a, b, c, handling, solid)
                other, _, _ = _trial(b, c, d, handling, solid)
                better = single < pair + other - size / handling.speed + handling.worth
            else:
                better = False
        if better:
            vertices[i] = corner
            vertices[i + 1 : count - 1] = vertices[i + 2 : count].copy()
            flags[i + 1 : count - 1] = flags[i + 2 : count].copy()
            count, end, i = count - 1, end - 1, max(i - 1, begin)
        else:
            i += 1
    return vertices[:count], flags[:count]


@compiled
def push(
    polygon: Array,
    exact: Flags,
    begin: int,
    end: int,
    budget: float,
    handling: Limits,
    solid: Solid,
) -> Array:
    """Move corners begin..end - 1 outwards, away from what they go around, where that saves time.

    No corner makes the way longer by more than `budget` [m], unless it was too tight before.
    """
    moved = polygon.copy()
    for i in range(begin, end):
        a, c, b = moved[i - 1], moved[i].copy(), moved[i + 1]
        if exact[i]:
            continue
        best, wide, radius = _trial(a, c, b, handling, solid)
        into, onward = math.hypot(c[0] - a[0], c[1] - a[1]), math.hypot(b[0] - c[0], b[1] - c[1])
        ux = (c[0] - a[0]) / into - (b[0] - c[0]) / onward
        uy = (c[1] - a[1]) / into - (b[1] - c[1]) / onward
        size = math.hypot(ux, uy)
        if wide or best == math.inf or size < STRAIGHT:
            continue
        most = budget if radius >= handling.tightest else math.inf
        place = np.empty(2)
        for push_by in _PUSHES:
            place[0], place[1] = c[0] + push_by * ux / size, c[1] + push_by * uy / size
            longer = math.hypot(place[0] - a[0], place[1] - a[1]) - into - onward
            longer += math.hypot(b[0] - place[0], b[1] - place[1])
            time, wide, _ = _trial(a, place, b, handling, solid)
            if longer > most or time >= best:
                break
            best = time
            moved[i] = place
            if wide:
                break
    return moved


@allocation_free
def _legs_clear(way: Array, width: float, jx: float, jy: float, solid: Solid) -> float:
    """Return a half-width [m] up to `width` at which the legs of an exact vertex are clear.

    way (3, 2) [m]: the vertex between its neighbours; (jx, jy): the change of direction there.  The
    vertex moves outwards by the cut, and the ends of its legs with it.
    """
    while width > NARROWEST:
        x, y = way[1, 0] - width / 6.0 * jx, way[1, 1] - width / 6.0 * jy
        if keeps(Segment(way[0, 0], way[0, 1], x, y), 0.0, solid) and keeps(
            Segment(x, y, way[2, 0], way[2, 1]), 0.0, solid
        ):
            break
        width *= 0.7
    return width


@compiled
def widths(
    polygon: Array,
    exact: Flags,
    handling: Limits,
    solid: Solid,
) -> Array:
    """Return the half-width (n,) [m] of each vertex: as wide as is clear and saves time."""
    count = len(polygon)
    wish, legs = np.zeros(count), np.zeros(count - 1)
    for i in range(count - 1):
        legs[i] = math.hypot(polygon[i + 1, 0] - polygon[i, 0], polygon[i + 1, 1] - polygon[i, 1])
    for i in range(1, count - 1):
        ix, iy = (polygon[i] - polygon[i - 1]) / legs[i - 1]
        ox, oy = (polygon[i + 1] - polygon[i]) / legs[i]
        turn = turn_between(ix, iy, ox, oy)
        if abs(turn) < STRAIGHT:
            continue
        into = legs[i - 1] * (_END_SHARE if i == 1 else 1.0)
        onward = legs[i] * (_END_SHARE if i == count - 2 else 1.0)
        most = min(into, onward, width_for(handling.easy, turn))
        corner = Corner(polygon[i, 0], polygon[i, 1], ix, iy, ox, oy, exact[i])
        wide = widest_rounding(corner, most, solid)
        if exact[i]:
            wide = _legs_clear(polygon[i - 1 : i + 2], wide, ox - ix, oy - iy, solid)
        wish[i] = max(wide, min(NARROWEST, most))
    for i in range(1, count - 2):
        if wish[i] + wish[i + 1] > legs[i]:
            wish[i] = min(wish[i], max(0.5 * legs[i], legs[i] - wish[i + 1]))
            wish[i + 1] = min(wish[i + 1], legs[i] - wish[i])
    return wish
