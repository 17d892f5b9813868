"""Compiled: one rounded corner, in closed form and among what it must keep clear of.

A corner at which unit direction t0 turns by theta to t1, rounded over the half-width d on both
sides: the second derivative by arc length is a hat of height |t1 - t0| / d (see
paths/spline_fit.py), so

    cut of the corner        d / 3 * sin(theta / 2)
    least radius             d * cos(theta / 2)^2 / (2 sin(theta / 2))
    length saved             about 7 / 30 d (1 - cos(theta))

Decides: what a width means and costs, and how wide a corner can be.  Must not know: polygons.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import compiled
from coordinator.ground.distance_kernels import Solid, keeps

Flags = npt.NDArray[np.bool_]

STRAIGHT: Final = 1e-6
"""Vertices that turn less [rad] are no corners."""

NARROWEST: Final = 2e-3
"""No corner is rounded over less [m], where its legs are that long."""

_CHORDS_PER_ROOT: Final = 12.0
"""Chords over half a corner, by the root of |t1 - t0|: their sagittas are then alike."""

_HALVINGS: Final = 7
_TOO_TIGHT: Final = 1e3
"""Seconds that a metre of radius short of what the robot can turn counts as."""


class Limits(NamedTuple):
    """How a robot takes corners: speed [m/s], acceleration, lateral acceleration [m/s^2].

    `easy` [m] is the radius at which a corner costs no speed, `tightest` [m] the one that every
    corner should have, and `worth` [s] the time that a corner less is worth.
    """

    speed: float
    accel: float
    lateral: float
    easy: float
    tightest: float
    worth: float


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
def cost_of(width: float, turn: float, handling: Limits) -> float:
    """Return the time [s] that a corner costs against its polygon at full speed; may be < 0.

    Braking from V to the corner's speed v and back costs (V - v)^2 / (a V); the hat lets the robot
    drive at about v over a third of the corner.
    """
    speed, accel, lateral = handling.speed, handling.accel, handling.lateral
    radius = radius_of(width, turn)
    slow = max(min(speed, math.sqrt(lateral * radius)), 1e-3 * speed)
    braking = (speed - slow) ** 2 / (accel * speed)
    inside = 2.0 / 3.0 * width * (1.0 / slow - 1.0 / speed)
    saved = 7.0 / 30.0 * width * (1.0 - math.cos(turn)) / speed
    return float(braking + inside - saved + _TOO_TIGHT * max(handling.tightest - radius, 0.0))


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
    need, discs, edges, first, items, frame = solid
    chords = 2 + int(_CHORDS_PER_ROOT * math.sqrt(math.hypot(jx, jy)))
    step = 1.0 / chords
    ax, ay = cx - width * ix, cy - width * iy
    for i in range(1, 2 * chords + 1):
        x = i * step - 1.0
        bulge = (1.0 + x) ** 3 / 6.0 if x <= 0.0 else x + (1.0 - x) ** 3 / 6.0
        bx = cx + width * (x * ix + bulge * jx)
        by = cy + width * (x * iy + bulge * jy)
        hat = 1.0 - abs(x) + (step if x > 0.0 else 0.0)
        sagitta = 0.125 * step * step * width * math.hypot(jx, jy) * hat
        if not keeps(ax, ay, bx, by, sagitta, need, discs, edges, first, items, frame):
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
