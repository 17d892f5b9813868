"""Scenes made for measuring: robots that swap places across a circle."""

from __future__ import annotations

import math

from coordinator.scenario.model import Robot, Scenario, Workspace


def circle_swap(count: int, radius: float = 0.2, tau: float = 1.0) -> Scenario:
    """Return `count` robots on a circle, each with its goal at the opposite place."""
    circle = max(4.0, 0.6 * count)
    middle = circle + 1.5
    robots = []
    for index in range(count):
        angle = 2.0 * math.pi * index / count
        x, y = circle * math.cos(angle), circle * math.sin(angle)
        robots.append(
            Robot(
                id=f"R{index + 1}",
                start=(middle + x, middle + y),
                goal=(middle - x, middle - y),
                radius=radius,
                max_speed=0.5,
                max_accel=0.5,
                max_lateral_accel=0.5,
            )
        )
    side = 2.0 * middle
    floor = Workspace(boundary=((0.0, 0.0), (side, 0.0), (side, side), (0.0, side)))
    name = f"circle-{count}"
    return Scenario(name=name, workspace=floor, robots=tuple(robots), tau=tau)
