"""Robots side by side, each on a lane of its own: a fleet without waits.

Decides: how far they drive.  Must not know: what is measured meanwhile.
"""

from __future__ import annotations

from typing import Final

from coordinator.scenario.model import Robot, Scenario, Workspace

_SPEED: Final = 0.5
"""The robots' speed [m/s]."""


def lanes(count: int, seconds: float, name: str = "lanes") -> Scenario:
    """Return a scenario of robots R1, R2, ... that drive for `seconds` on lanes a metre apart."""
    far = 1.0 + 0.95 * _SPEED * seconds
    robots = tuple(
        Robot(
            id=f"R{i + 1}",
            start=(1.0, 1.0 + i),
            goal=(far, 1.0 + i),
            radius=0.2,
            max_speed=_SPEED,
            max_accel=_SPEED,
            max_lateral_accel=_SPEED,
        )
        for i in range(count)
    )
    wide, high = far + 1.0, count + 1.0
    floor = Workspace(boundary=((0.0, 0.0), (wide, 0.0), (wide, high), (0.0, high)))
    return Scenario(name=name, workspace=floor, robots=robots)
