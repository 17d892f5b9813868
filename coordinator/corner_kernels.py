"""Compiled: rounded corners in closed form, and the best places and widths for a polygon's corners.

A corner at which unit direction t0 turns by theta to t1, rounded over the half-width d on both
sides: the second derivative by arc length is a hat of height |t1 - t0| / d (see fit.py), so

    cut of the corner        d / 3 * sin(theta / 2)
    least radius             d * cos(theta / 2)^2 / (2 sin(theta / 2))
    length saved             about 7 / 30 d (1 - cos(theta))

`handling` (5,) is that of a robot: speed [m/s], acceleration, lateral acceleration [m/s^2], the
radius [m] at which a corner costs no speed, and the one that every corner should have.

Decides: where corners go, and how wide they are rounded.  Must not know: why.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from coordinator.compiled import compiled
from coordinator.gap_kernels import Solid, keeps
from coordinator.nurbs import Array

Flags = npt.NDArray[np.bool_]

STRAIGHT: Final = 1e-6
"""Vertices that turn less [rad] are no corners."""

NARROWEST: Final = 2e-3
"""No corner is rounded over less [m], where its legs are that long."""

_HALF_CHORDS: Final = 16
_HALVINGS: Final = 7
_END_SHARE: Final = 0.9
"""Share of the first and last leg that a corner may take: a knot near the end would stall there."""

_WIDEST_MERGED: Final = math.radians(100.0)
_PUSHES: Final = (0.01, 0.03, 0.06, 0.12, 0.25, 0.5, 1.0)
"""How far [m] a corner may move out, tried in turn."""

_TOO_TIGHT: Final = 1e3
"""Seconds that a metre of radius short of what the robot can turn counts as."""


@compiled
def turn_between(ax: float, ay: float, bx: float, by: float) -> float:
    """Return the signed angle [rad] from direction a to direction b."""
    return math.atan2(ax * by - ay * bx, ax * bx + ay * by)


@compiled
def radius_of(width: float, turn: float) -> float:
    """Return the least radius of curvature [m] of a corner of half-width [m] and turn [rad]."""
    half = 0.5 * abs(turn)
    return width * math.cos(half) ** 2 / max(2.0 * math.sin(half), 1e-9)


@compiled
def width_for(radius: float, turn: float) -> float:
    """Return the half-width [m] that gives a corner its radius [m]."""
    half = 0.5 * abs(turn)
    return 2.0 * radius * math.sin(half) / max(math.cos(half) ** 2, 1e-9)


@compiled
def cost_of(width: float, turn: float, handling: Array) -> float:
    """Return the time [s] that a corner costs against its polygon at full speed; may be < 0.

    Braking from V to the corner's speed v and back costs (V - v)^2 / (a V); the hat lets the robot
    drive at about v over a third of the corner.
    """
    speed, accel, lateral = handling[0], handling[1], handling[2]
    radius = radius_of(width, turn)
    slow = max(min(speed, math.sqrt(lateral * radius)), 1e-3 * speed)
    braking = (speed - slow) ** 2 / (accel * speed)
    inside = 2.0 / 3.0 * width * (1.0 / slow - 1.0 / speed)
    saved = 7.0 / 30.0 * width * (1.0 - math.cos(turn)) / speed
    return float(braking + inside - saved + _TOO_TIGHT * max(handling[4] - radius, 0.0))


@compiled
def _rounding_keeps(
    cx: float,
    cy: float,
    ix: float,
    iy: float,
    ox: float,
    oy: float,
    width: float,
    exact: bool,
    solid: Solid,
) -> bool:
    """Tell whether the corner c between unit directions i and o is clear, rounded over `width`."""
    jx, jy = ox - ix, oy - iy
    if exact:
        # The vertex is moved out by the cut, so that the curve passes its place.
        cx, cy = cx - width / 6.0 * jx, cy - width / 6.0 * jy
    step = 1.0 / _HALF_CHORDS
    ax, ay = cx - width * ix, cy - width * iy
    for i in range(1, 2 * _HALF_CHORDS + 1):
        x = i * step - 1.0
        bulge = (1.0 + x) ** 3 / 6.0 if x <= 0.0 else x + (1.0 - x) ** 3 / 6.0
        bx = cx + width * (x * ix + bulge * jx)
        by = cy + width * (x * iy + bulge * jy)
        hat = 1.0 - abs(x) + (step if x > 0.0 else 0.0)
        sagitta = 0.125 * step * step * width * math.hypot(jx, jy) * hat
        if not keeps(ax, ay, bx, by, sagitta, solid):
            return False
        ax, ay = bx, by
    return True


@compiled
def widest_rounding(
    cx: float,
    cy: float,
    ix: float,
    iy: float,
    ox: float,
    oy: float,
    most: float,
    exact: bool,
    solid: Solid,
) -> float:
    """Return the greatest half-width [m] up to `most` that is clear; -1 when none is.

    Found by halving; c (2,) [m] is the corner, i and o the unit directions into and out of it.
    """
    low, high = min(NARROWEST, most), most
    if _rounding_keeps(cx, cy, ix, iy, ox, oy, high, exact, solid):
        return high
    if not _rounding_keeps(cx, cy, ix, iy, ox, oy, low, exact, solid):
        return -1.0
    for _ in range(_HALVINGS):
        middle = math.sqrt(low * high)
        if _rounding_keeps(cx, cy, ix, iy, ox, oy, middle, exact, solid):
            low = middle
        else:
            high = middle
    return low


@compiled
def _trial(
    a: Array,
    c: Array,
    b: Array,
    handling: Array,
    solid: Solid,
) -> tuple[float, bool]:
    """Return the time [s] from a over a corner at c to b, and whether c is as wide as is of use.

    The time is infinite where the legs or the corner are not clear.
    """
    into, onward = math.hypot(c[0] - a[0], c[1] - a[1]), math.hypot(b[0] - c[0], b[1] - c[1])
    if min(into, onward) < STRAIGHT:
        return math.inf, False
    ix, iy, ox, oy = (c[0] - a[0]) / into, (c[1] - a[1]) / into, b[0] - c[0], b[1] - c[1]
    ox, oy = ox / onward, oy / onward
    if not keeps(a[0], a[1], c[0], c[1], 0.0, solid) or not (
        keeps(c[0], c[1], b[0], b[1], 0.0, solid)
    ):
        return math.inf, False
    time = (into + onward) / handling[0]
    turn = turn_between(ix, iy, ox, oy)
    if abs(turn) < STRAIGHT:
        return time, True
    most = min(0.5 * into, 0.5 * onward, width_for(handling[3], turn))
    width = widest_rounding(c[0], c[1], ix, iy, ox, oy, most, False, solid)
    if width < 0.0:
        return math.inf, False
    return time + cost_of(width, turn, handling), width >= most


@compiled
def merge(
    polygon: Array,
    exact: Flags,
    begin: int,
    end: int,
    handling: Array,
    solid: Solid,
) -> tuple[Array, Flags]:
    """Make one corner of two neighbours that turn the same way, where that is quicker.

    Only vertices begin..end - 1 of the polygon (n, 2) that are not exact are merged.
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
            and width_for(handling[3], one) + width_for(handling[3], two) > size
        )
        if better:
            into = math.hypot(b[0] - a[0], b[1] - a[1])
            ahead = size * math.sin(abs(two)) / math.sin(abs(one + two)) / into
            corner[0], corner[1] = b[0] + ahead * (b[0] - a[0]), b[1] + ahead * (b[1] - a[1])
            single, _ = _trial(a, corner, d, handling, solid)
            if single < math.inf:
                pair, _ = _trial(a, b, c, handling, solid)
                other, _ = _trial(b, c, d, handling, solid)
                better = single < pair + other - size / handling[0]
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
    handling: Array,
    solid: Solid,
) -> Array:
    """Move corners begin..end - 1 outwards, away from what they go around, where that saves time.

    No corner lengthens the way by more than `budget` [m], unless it would be too tight.
    """
    moved = polygon.copy()
    for i in range(begin, end):
        a, c, b = moved[i - 1], moved[i].copy(), moved[i + 1]
        if exact[i]:
            continue
        best, wide = _trial(a, c, b, handling, solid)
        into, onward = math.hypot(c[0] - a[0], c[1] - a[1]), math.hypot(b[0] - c[0], b[1] - c[1])
        ux = (c[0] - a[0]) / into - (b[0] - c[0]) / onward
        uy = (c[1] - a[1]) / into - (b[1] - c[1]) / onward
        size = math.hypot(ux, uy)
        if wide or best == math.inf or size < STRAIGHT:
            continue
        most = budget if best < 0.5 * _TOO_TIGHT * handling[4] else math.inf
        place = np.empty(2)
        for push_by in _PUSHES:
            place[0], place[1] = c[0] + push_by * ux / size, c[1] + push_by * uy / size
            longer = math.hypot(place[0] - a[0], place[1] - a[1]) - into - onward
            longer += math.hypot(b[0] - place[0], b[1] - place[1])
            time, wide = _trial(a, place, b, handling, solid)
            if longer > most or time >= best:
                break
            best = time
            moved[i] = place
            if wide:
                break
    return moved


@compiled
def widths(
    polygon: Array,
    exact: Flags,
    handling: Array,
    solid: Solid,
) -> Array:
    """Return the half-width of each vertex (n,) [m]: as wide as is clear and of use."""
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
        most = min(into, onward, width_for(handling[3], turn))
        wide = widest_rounding(
            polygon[i, 0],
            polygon[i, 1],
            ix,
            iy,
            ox,
            oy,
            most,
            exact[i],
            solid,
        )
        wish[i] = max(wide, min(NARROWEST, most))
    for i in range(1, count - 2):
        if wish[i] + wish[i + 1] > legs[i]:
            wish[i] = min(wish[i], max(0.5 * legs[i], legs[i] - wish[i + 1]))
            wish[i + 1] = min(wish[i + 1], legs[i] - wish[i])
    return wish
