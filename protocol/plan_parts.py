"""A Plan message unpacked into numbers for the robot: rules, path and motion.

Decides: what the fields of a Plan mean together.  Both sides use it: the robot to drive, the
coordinator to prove what it sends.
"""

from __future__ import annotations

from typing import NamedTuple

from protocol.curve import clamped_knots
from protocol.messages import Plan
from protocol.plan_bytes import unpack_floats, unpack_points, unpack_profile, unpack_stops
from protocol.timing import MILLISECOND, SECOND

Motion = tuple[list[float], list[float], list[float], list[float], float]


class PlanParts(NamedTuple):
    """The content of a Plan, as arguments for Ride, Curve and Timeline."""

    rules: tuple[int, int, int]
    """track [mm], brake [mm/s^2], clock error [ns]."""
    path: tuple[int, list[float], list[float], list[float], list[float]]
    """degree, full knot vector, x, y, weights: the arguments of Curve."""
    motion: Motion
    """Speed knots s and v, stops s and departures [s], begin [s]: the arguments of Timeline."""


def unpack_plan(plan: Plan) -> PlanParts:
    """Unpack a Plan; ValueError when a packed field is incomplete."""
    points = unpack_points(plan.points)
    return PlanParts(
        (plan.track_mm, plan.brake_mmps2, plan.clock_ms * MILLISECOND),
        (
            plan.degree,
            clamped_knots(plan.degree, unpack_floats(plan.knots) or [0.0]),
            [x for x, _ in points],
            [y for _, y in points],
            unpack_floats(plan.weights) or [1.0] * len(points),
        ),
        _motion_of(plan),
    )


def _motion_of(times: Plan) -> Motion:
    """Unpack the times of a plan; ValueError when a packed field is incomplete."""
    stops = unpack_stops(times.stops)
    profile = unpack_profile(times.speeds, times.profile)
    if times.brake_mmps2:
        profile = sorted(profile + [(s, 0.0) for s, _ in stops if s > 0.0])
    return (
        [s for s, _ in profile],
        [v for _, v in profile],
        [s for s, _ in stops],
        [depart_ns / SECOND for _, depart_ns in stops],
        times.begin_ms / 1000.0,
    )
