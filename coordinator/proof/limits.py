"""The proof that a motion obeys its robot's limits: speed, acceleration, bends.

Decides: how far rounding may exceed a limit.  Must not know: other robots, or how motions are
planned.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from coordinator.curves.knots import bezier_pieces
from coordinator.curves.nurbs import Array
from coordinator.curves.nurbs_kernels import W, arc_table, series
from coordinator.plan.document import Limits
from coordinator.plan.wire import Driven
from coordinator.proof.limit_kernels import too_sharp

_CORNER: Final = 0.01
"""Where spans meet, directions that differ by more than this [rad] make a corner."""

_SPEED: Final = 1.0001
_ACCEL: Final = 1.01
_LATERAL: Final = 1.02
_TURN: Final = 1.01
_TURN_RATE: Final = 1.02
"""Factors by which a limit may be exceeded, to allow for rounding to the wire."""


def limit_failures(driven: Driven, limits: Limits, *, from_rest: bool = True) -> list[str]:
    """Return a sentence for each limit that a motion exceeds by more than the factors above allow.

    `from_rest`: whether it has to begin at rest, as all do that do not go on from another course.

    Nothing is sampled: speed and acceleration are computed per leg, and bends are proven at all
    places of the curve (limit_kernels.py).  A robot keeps to its authority by braking as its
    message says, which must not be more than it can.
    """
    line, failures = driven.timeline, []
    v0, v1 = np.array(line.v0), np.array(line.v1)
    if max(v0.max(), v1.max()) > limits.max_speed * _SPEED:
        failures.append(f"{driven.id} drives faster than {limits.max_speed:g} m/s")
    length = np.array(line.s1) - np.array(line.s0) + 1e-5
    rate = np.abs(v1**2 - v0**2) / (2.0 * length)
    if limits.max_accel is not None:
        if rate.max() > limits.max_accel * _ACCEL:
            failures.append(f"{driven.id} changes speed faster than {limits.max_accel:g} m/s^2")
        if (from_rest and v0[0] > 1e-6) or v1[-1] > 1e-6:
            failures.append(f"{driven.id} does not begin and end at rest")
        told = driven.plan.brake_mmps2
        if not 0 < told <= max(1000.0 * limits.max_accel, 1.0):
            failures.append(
                f"{driven.id} is told to brake at {told / 1000.0:g} m/s^2 (0 is at once), "
                f"can brake at {limits.max_accel:g} m/s^2"
            )
    return failures + _bend_failures(driven, limits)


def _corner_failures(driven: Driven) -> list[str]:
    """Return a sentence for each corner of a curve: a border of spans where its direction jumps."""
    borders, pieces = bezier_pieces(*driven.curve.lifted)
    corners = pieces[:, :, :W] / pieces[:, :, W:]
    inner = zip(borders[1:-1].tolist(), corners[:-1], corners[1:], strict=True)
    failures = []
    for u, before, after in inner:
        if np.count_nonzero(driven.curve.knots == u) < driven.curve.degree:
            continue
        into, onward = _direction(before[::-1]), _direction(after)
        if np.dot(-into, onward) < math.cos(_CORNER):
            s = float(driven.curve.arc_at([u])[0])
            failures.append(f"{driven.id}'s way has a corner at {s:.2f} m")
    return failures


def _direction(corners: Array) -> Array:
    """Return the unit direction in which a piece leaves its first corner; zeros if it has none."""
    legs = corners - corners[0]
    sizes = np.hypot(legs[:, 0], legs[:, 1])
    far = np.flatnonzero(sizes > 1e-6)
    return legs[far[0]] / sizes[far[0]] if len(far) else np.zeros(2)


def _bend_failures(driven: Driven, limits: Limits) -> list[str]:
    """Return a sentence for each limit that a bend breaks, with the arc length of the bend."""
    lateral, turning = limits.max_lateral_accel, limits.max_turn_rate
    radius = limits.min_turn_radius
    if lateral is None and turning is None and not radius > 0.0:
        return []
    line, failures = driven.timeline, _corner_failures(driven)
    curve = series(*driven.curve.lifted)
    table = arc_table(*curve)
    knots = np.array([*line.s0, line.length])
    squares = np.square(np.column_stack((line.v0, line.v1)))
    if lateral is not None:
        at = too_sharp(curve, table, knots, squares, 1, lateral * _LATERAL)
        if at >= 0.0:
            failures.append(f"{driven.id} takes a bend above {lateral:g} m/s^2 at {at:.2f} m")
    if turning is not None:
        at = too_sharp(curve, table, knots, squares, 2, (turning * _TURN_RATE) ** 2)
        if at >= 0.0:
            failures.append(f"{driven.id} turns faster than {turning:g} rad/s at {at:.2f} m")
    if radius > 0.0:
        at = too_sharp(curve, table, knots, np.ones((len(line.s0), 2)), 1, _TURN / radius)
        if at >= 0.0:
            failures.append(f"{driven.id} turns tighter than {radius:g} m at {at:.2f} m")
    return failures
