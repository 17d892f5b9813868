"""Robots of one kind that go from places to places, for scenarios that tests write down."""

from __future__ import annotations

import math

from coordinator.scenario.model import TURN_RATE, Robot


def crowd(trips, radius, speed=0.8, accel=0.8):
    """Return robots R1, R2, ...; trips: each one's start and goal."""
    turning = TURN_RATE if math.isfinite(accel) else math.inf
    return tuple(
        Robot(
            id=f"R{number}", start=start, goal=goal, radius=radius, max_speed=speed,
            max_accel=accel, max_lateral_accel=accel, max_turn_rate=turning,
        )
        for number, (start, goal) in enumerate(trips, 1)
    )  # fmt: skip


def square(side):
    """Return the corners of a square floor."""
    return (0.0, 0.0), (side, 0.0), (side, side), (0.0, side)
