"""Compiled: one rounded corner, in closed form and among what it must keep clear of.

At a corner the unit direction t0 turns by theta to t1.  It is rounded from d before the corner to d
behind it, where d is called the half-width.  The second derivative of the rounded corner by arc
length is a hat function of height |t1 - t0| / d (see paths/spline_fit.py), so

    cut of the corner        d / 3 * sin(theta / 2)
    least radius             d * cos(theta / 2)^2 / (2 sin(theta / 2))
    length saved             about 7 / 30 d (1 - cos(theta))

The cut is the distance from the corner to the curve.

Decides: what a width means and costs, and how wide a corner can be.  Must not know: polygons.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import allocation_free
from coordinator.ground.distance_kernels import Solid, keeps
from coordinator.ground.grid_kernels import Segment

Flags = npt.NDArray[np.bool_]

STRAIGHT: Final = 1e-6
"""Vertices that turn less [rad] are no corners."""

NARROWEST: Final = 2e-3
"""Least half-width [m] of a rounded corner; only legs that are too short make it smaller."""

_CHORDS_PER_ROOT: Final = 12.0
"""A half of a corner gets about this many chords times the root of |t1 - t0|: the chords of all
corners then have about the same sagitta for the same half-width."""

_HALVINGS: Final = 7
_TOO_TIGHT: Final = 1e3
"""Time [s] that a corner costs for each metre by which its radius is less than Limits.tightest."""


class Limits(NamedTuple):
    """What bounds a robot in corners: speed [m/s], acceleration and lateral acceleration [m/s^2].

    `turning` [rad/s]: its turn rate.  `easy` [m]: the radius from which on a corner costs no speed.
    `tightest` [m]: the least radius that a corner should have.  `worth` [s]: the time that one
    corner less is worth.
    """

    speed: float
    accel: float
    lateral: float
    turning: float
    easy: float
    tightest: float
    worth: float


class Corner(NamedTuple):
    """A corner at (x, y) [m] between the unit directions into it (ix, iy) and out of it (ox, oy).

    exact: its rounded curve has to pass through (x, y).
    """

    x: float
    y: float
    ix: float
    iy: float
    ox: float
    oy: float
    exact: bool


@allocation_free
def turn_between(ax: float, ay: float, bx: float, by: float) -> float:
    """Return the signed angle [rad] from direction a to direction b."""
    return math.atan2(ax * by - ay * bx, ax * bx + ay * by)


@allocation_free
def radius_of(width: float, turn: float) -> float:
    """Return the least radius of curvature [m] of a corner of half-width [m] and turn [rad]."""
    half = 0.5 * abs(turn)
    return width * math.cos(half) ** 2 / max(2.0 * math.sin(half), 1e-9)


@allocation_free
def width_for(radius: float, turn: float) -> float:
    """Return the half-width [m] that gives a corner its radius [m]."""
    half = 0.5 * abs(turn)
    return 2.0 * radius * math.sin(half) / max(math.cos(half) ** 2, 1e-9)


@allocation_free
def cost_of(width: float, turn: float, handling: Limits) -> float:
    """Return how much longer [s] a corner takes than its two legs at full speed; may be negative.

    Braking from the full speed V to the corner's speed v and speeding up again costs
    (V - v)^2 / (a V).  The robot drives at about v over a third of the corner, where the hat
    function is greatest.
    """
    speed, accel = handling.speed, handling.accel
    radius = radius_of(width, turn)
    bounded = min(math.sqrt(handling.lateral * radius), handling.turning * radius)
    slow = max(min(speed, bounded), 1e-3 * speed)
    braking = (speed - slow) ** 2 / (accel * speed)
    inside = 2.0 / 3.0 * width * (1.0 / slow - 1.0 / speed)
    saved = 7.0 / 30.0 * width * (1.0 - math.cos(turn)) / speed
    return float(braking + inside - saved + _TOO_TIGHT * max(handling.tightest - radius, 0.0))


@allocation_free
def _rounding_keeps(corner: Corner, width: float, solid: Solid) -> bool:
    """Tell whether a corner rounded with the half-width `width` [m] is clear."""
    cx, cy, ix, iy, ox, oy, exact = corner
    jx, jy = ox - ix, oy - iy
    if exact:
        # The vertex moves outwards by the cut, so that the curve passes through its place.
        cx, cy = cx - width / 6.0 * jx, cy - width / 6.0 * jy
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
        if not keeps(Segment(ax, ay, bx, by), sagitta, solid):
            return False
        ax, ay = bx, by
    return True


@allocation_free
def widest_rounding(corner: Corner, most: float, solid: Solid) -> float:
    """Return about the greatest half-width [m] up to `most` that is clear; -1 if none is.

    It is found by bisection of the logarithm, from NARROWEST up.
    """
    low, high = min(NARROWEST, most), most
    if _rounding_keeps(corner, high, solid):
        return high
    if not _rounding_keeps(corner, low, solid):
        return -1.0
    for _ in range(_HALVINGS):
        middle = math.sqrt(low * high)
        if _rounding_keeps(corner, middle, solid):
            low = middle
        else:
            high = middle
    return low
