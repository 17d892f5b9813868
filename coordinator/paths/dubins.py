"""The shortest ways of a robot that turns wide from pose to pose (Dubins 1957), as polygons.

Such a way is an arc, a straight piece or an arc the other way round, and an arc.  The vertices of
an arc lie where tangents of it meet, so that a spline with shared knots follows it (spline_fit.py).

Decides: the vertices.  Must not know: obstacles, curves.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from coordinator.curves.nurbs import Array
from coordinator.paths.end_headings import STEP

_FULL: Final = 2.0 * math.pi
_NOTHING: Final = 1e-9
"""Arcs of less than this [rad], or than this short of a full turn, are none."""

_RESERVE: Final = 1.03 / math.cos(0.5 * STEP)
"""Radius of arcs, per metre of the radius of turns; 3 % in reserve."""


_Parts = tuple[tuple[int, float], ...]
"""Parts of a way in turn: side (1 left, -1 right, 0 straight), and size: of an arc [rad], of a
straight piece [m]."""


def turning_ways(start: Sequence[float], goal: Sequence[float], radius: float) -> list[Array]:
    """Return polygons (n, 2) [m] from pose to pose with turns of a radius [m], in any order.

    Poses: x, y [m], heading [rad].
    """
    wide = _RESERVE * radius
    lead = wide * math.tan(0.5 * STEP)
    begin, end = _moved(start, lead), _moved(goal, -lead)
    return [_polygon(start, begin, goal, parts, wide) for parts in _ways(begin, end, wide)]


def _moved(pose: Sequence[float], size: float) -> tuple[float, float, float]:
    x, y, heading = pose
    return x + size * math.cos(heading), y + size * math.sin(heading), heading


def _ways(start: Sequence[float], goal: Sequence[float], radius: float) -> Iterator[_Parts]:
    """Yield the ways of all kinds that there are, with a straight piece and without."""
    for first in (1, -1):
        for last in (1, -1):
            (ax, ay), (bx, by) = _center(start, first * radius), _center(goal, last * radius)
            apart, ahead = math.hypot(bx - ax, by - ay), math.atan2(by - ay, bx - ax)
            across = (first - last) * radius
            if apart >= abs(across):
                size = math.sqrt(apart * apart - across * across)
                heading = ahead + math.atan2(across, size)
                arcs = _turn(first, start[2], heading), _turn(last, heading, goal[2])
                yield (first, arcs[0]), (0, size), (last, arcs[1])
            if first == last and apart <= 4.0 * radius:
                for side in (1, -1):
                    to = ahead + side * math.acos(0.25 * apart / radius)
                    mx, my = ax + 2.0 * radius * math.cos(to), ay + 2.0 * radius * math.sin(to)
                    one = to + first * 0.5 * math.pi
                    two = math.atan2(by - my, bx - mx) - first * 0.5 * math.pi
                    yield (
                        (first, _turn(first, start[2], one)),
                        (-first, _turn(-first, one, two)),
                        (first, _turn(first, two, goal[2])),
                    )


def _center(pose: Sequence[float], radius: float) -> tuple[float, float]:
    """Return the centre [m] of the circle that a robot turns around; radius < 0 to the right."""
    return pose[0] - radius * math.sin(pose[2]), pose[1] + radius * math.cos(pose[2])


def _turn(side: int, before: float, after: float) -> float:
    """Return by how much [rad] a robot turns to one side from a heading to another."""
    turned = (side * (after - before)) % _FULL
    return turned if _NOTHING < turned < _FULL - _NOTHING else 0.0


def _polygon(
    start: Sequence[float],
    pose: tuple[float, float, float],
    goal: Sequence[float],
    parts: _Parts,
    radius: float,
) -> Array:
    vertices = [(start[0], start[1])]
    for side, size in parts:
        if side == 0:
            pose = _moved(pose, size)
            continue
        steps = math.ceil(size / STEP - _NOTHING)
        for _ in range(steps):
            half = radius * math.tan(0.5 * size / steps)
            x, y, heading = _moved(pose, half)
            vertices.append((x, y))
            pose = _moved((x, y, heading + side * size / steps), half)
    return np.array([*vertices, (goal[0], goal[1])])
