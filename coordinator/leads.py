"""How a path leaves its start and reaches its goal when they have headings.

First come the turns of a Dubins path: vertices around a circle to the left or right until the way
onwards lies ahead, so that rounding them keeps a radius.  Where these find no room a straight lead
is tried.

Decides: the vertices next to start and goal.  Must not know: what lies between, and curves.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import product
from typing import Final

import numpy as np

from coordinator.errors import CoarseError, PlanError
from coordinator.nurbs import Array, Nurbs
from coordinator.scenario import Robot
from coordinator.space import Space

_STRAIGHT: Final = (0.6, 0.3, 0.15, 0.08)
"""Straight leads [m], tried in turn."""

_TINY: Final = (0.8, 0.4)
"""The same for robots of a few centimetres, as shares of their radius."""

_PER_RADIUS: Final = 6.0
"""Straight lead of robots that turn wide, per metre of min_turn_radius."""

_SHARES: Final = (1.0, 0.5, 0.25)
_STEP: Final = math.pi / 4
_MOST_STEPS: Final = 8
_CIRCLE: Final = 2.0 * 1.08 / math.cos(0.5 * _STEP)
"""Radius of the circle that vertices go around, per metre of min_turn_radius: a corner that takes
half of each leg has the radius circle / 2 * cos(step / 2); 8 % in reserve."""

_EASY: Final = 0.6
"""Robots that turn on the spot take turns of this radius too, as a share of their own."""

_END_SHARE: Final = 0.9
"""Share of the first leg that its corner may take (polygon_kernels.py)."""

_OFF: Final = 8e-3
"""How far [rad] a curve may be off a heading; the proof accepts a little more."""

Leads = tuple[list[Array], list[Array]]


def leads(robot: Robot, space: Space) -> Iterator[Leads]:
    """Yield vertices after the start and before the goal, each in the order of driving.

    Raises PlanError when there is no room to move along a heading.
    """
    headed = len(robot.start) == 3 or len(robot.goal) == 3
    if headed:
        yield from _dubins(robot, space)
    for share in _SHARES if headed and robot.min_turn_radius > 0.0 else (1.0,):
        yield _straight(robot, space, share)


def check_headings(robot: Robot, curve: Nurbs) -> None:
    """Raise CoarseError where a curve's numbers are too coarse for a heading that is asked for."""
    along = np.diff(curve.points[[0, 1, -2, -1]], axis=0)[::2]
    for pose, (x, y) in zip((robot.start, robot.goal), along.tolist(), strict=True):
        if len(pose) == 3 and abs(math.remainder(math.atan2(y, x) - pose[2], math.tau)) > _OFF:
            raise CoarseError(
                f"heading {pose[2]:.2f} rad at ({pose[0]:.2f}, {pose[1]:.2f}) needs a longer "
                "straight way so far from the origin, where float32 numbers are coarse; more room "
                "or an origin nearer to the site would help"
            )


def _dubins(robot: Robot, space: Space) -> list[Leads]:
    """Return the leads that turn left or right at either end, those of the shortest way first."""
    circle = _CIRCLE * max(robot.min_turn_radius, _EASY * robot.radius)
    begin, end = np.array(robot.start[:2]), np.array(robot.goal[:2])
    inner = [np.array(place) for place in robot.via]
    found: list[tuple[float, Leads]] = []
    for sides in product((1.0, -1.0), repeat=2):
        there, back = inner[0] if inner else end, inner[-1] if inner else begin
        first: list[Array] | None = []
        last: list[Array] | None = []
        for _ in range(3):
            first = _around(robot.start, circle, sides[0], there)
            if not inner and first:
                back = first[-1]
            last = _around(_reversed(robot.goal), circle, sides[1], back)
            if not inner and last:
                there = last[-1]
        if first is None or last is None:
            continue
        way = np.array([begin, *first, *inner, *last[::-1], end])
        ends = [np.array([begin, *first]), np.array([*last[::-1], end])]
        if all(space.keeping(part[:-1], part[1:]).all() for part in ends):
            found.append((float(np.hypot(*np.diff(way, axis=0).T).sum()), (first, last[::-1])))
    return [pair for _, pair in sorted(found, key=lambda one: one[0])]


def _around(
    pose: Sequence[float], circle: float, side: float, towards: Array
) -> list[Array] | None:
    """Return vertices from a pose around a circle [m] until a place lies ahead; None if never.

    side: 1 turns left, -1 right.
    """
    if len(pose) < 3:
        return []
    leg = 2.0 * circle * math.tan(0.5 * _STEP)
    heading = pose[2]
    along = np.array([math.cos(heading), math.sin(heading)])
    vertices = [np.array(pose[:2]) + 0.5 * leg / _END_SHARE * along]
    for _ in range(_MOST_STEPS):
        onward = towards - vertices[-1]
        turn = side * math.atan2(along[0] * onward[1] - along[1] * onward[0], float(along @ onward))
        if -0.1 <= turn <= _STEP + 0.02:
            return vertices
        heading += side * _STEP
        along = np.array([math.cos(heading), math.sin(heading)])
        vertices.append(vertices[-1] + leg * along)
    return None


def _reversed(pose: Sequence[float]) -> Sequence[float]:
    """Return a pose as seen by somebody who drives the path from its end."""
    return pose if len(pose) < 3 else (pose[0], pose[1], pose[2] + math.pi)


def _straight(robot: Robot, space: Space, share: float) -> Leads:
    """Return straight leads, a share of the longest that is of use."""
    wide = max(_PER_RADIUS * robot.min_turn_radius, _STRAIGHT[0])
    first = robot.via[0] if robot.via else robot.goal[:2]
    last = robot.via[-1] if robot.via else robot.start[:2]
    found = []
    for pose, sign, towards in ((robot.start, 1.0, first), (robot.goal, -1.0, last)):
        longest = share * min(wide, 0.45 * math.dist(towards, pose[:2]))
        sizes = (longest, *_STRAIGHT, *(share * robot.radius for share in _TINY))
        found.append(_ahead(pose, sign, space, [size for size in sizes if size <= longest]))
    return found[0], found[1]


def _ahead(pose: Sequence[float], sign: float, space: Space, sizes: Sequence[float]) -> list[Array]:
    """Return the point that makes a path leave (or reach, sign -1) a place with its heading."""
    if len(pose) < 3:
        return []
    place = np.array(pose[:2], dtype=np.float64)
    along = sign * np.array([math.cos(pose[2]), math.sin(pose[2])])
    for size in sizes:
        point = place + size * along
        if space.ground.clear(place, point) and space.keeping(place[None], point[None]).all():
            return [point]
    raise PlanError(
        f"no room to move along heading {pose[2]:.2f} rad at ({pose[0]:.2f}, {pose[1]:.2f})"
    )
