"""How a path may leave its start or reach its goal when it has a heading there.

A lead is the few vertices next to that end: straight ahead for a while, or around a circle to the
left or right as on a Dubins path.  From its last vertex the way continues in any direction.

Decides: which leads there are at one end, and which of them are clear.  Must not know: which is
best (end_heading_choice.py), what lies between the ends, and curves.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from coordinator.base.errors import CoarseError
from coordinator.curves.nurbs import Array, Nurbs
from coordinator.ground.free_space import Space
from coordinator.scenario.model import Robot

STEP: Final = math.pi / 8
"""Turn [rad] at each vertex of a lead around a circle."""

END_SHARE: Final = 0.9
"""Share of the first leg that its corner may take (ground/polygon_kernels.py)."""

_STRAIGHT: Final = (0.08, 0.15, 0.3, 0.6)
"""Lengths [m] of straight leads that are tried; others end where the heading crosses the way."""

_TINY: Final = (0.4, 0.8)
"""Further lengths of straight leads, for robots of a few centimetres, as shares of their radius.

No lead is shorter than the shortest of all these lengths: rounding to float32 would turn it."""

_LAST: Final = (0.03, 0.01)
"""Lengths [m] that are tried where there is room for no other lead: the robot all but turns where
it stands."""

_PER_RADIUS: Final = 6.0
"""Length of a further straight lead, for robots that turn wide, per metre of min_turn_radius."""

_SHARES: Final = (1.0, 0.5, 0.25)
"""Shares that are tried of that length, or of the longest of _STRAIGHT if the latter is longer."""

_OFF_END: Final = 1e-3
"""A lead ends at least this far [m] from the place that it leads to."""

_LONGEST: Final = 0.45
"""The longest straight lead, as a share of the distance to the last place ahead."""

_MOST_STEPS: Final = 16
_CIRCLE: Final = 1.03 / math.cos(0.5 * STEP) ** 2
"""Radius of the circle on which vertices lie, per metre of the radius of turns (spline_fit.py); 3 %
in reserve."""

_EASY: Final = (0.6, 0.3)
"""Robots that turn on the spot take turns of these radii, as shares of the robot's radius."""

_OFF: Final = 8e-3
"""How far [rad] a curve may be off a heading; the proof accepts a little more."""


class Lead(NamedTuple):
    """The vertices [m] next to an end, in the order of driving away from it; the end is left out.

    heading [rad] and length [m] are those at the last vertex, whose corner may use `width` [m] of
    the leg before it.  side: 1 if the lead turns left, -1 right, 0 if it is straight; radius [m]:
    that of its turns.
    """

    vertices: list[Array]
    last: tuple[float, float]
    heading: float
    length: float
    width: float
    side: int = 0
    radius: float = math.inf


def check_headings(robot: Robot, curve: Nurbs) -> None:
    """Raise CoarseError if the curve's float32 numbers are too coarse for a required heading."""
    along = np.diff(curve.points[[0, 1, -2, -1]], axis=0)[::2]
    for pose, (x, y) in zip((robot.start, robot.goal), along.tolist(), strict=True):
        if len(pose) == 3 and abs(math.remainder(math.atan2(y, x) - pose[2], math.tau)) > _OFF:
            raise CoarseError(
                f"heading {pose[2]:.2f} rad at ({pose[0]:.2f}, {pose[1]:.2f}) needs a longer "
                "straight way so far from the origin, where float32 numbers are coarse",
                place=pose[:2],
                helps="more room or an origin nearer to the site",
            )


def leads(robot: Robot, pose: Sequence[float], ahead: Array, space: Space) -> list[Lead]:
    """Return the clear leads away from a pose with a heading.

    ahead (k, 2) [m]: the places that the way would pass if there were no heading, in order.
    """
    found = [_straight(pose, size) for size in _sizes(robot, pose, ahead)]
    for radius in _radii(robot):
        for side in (1, -1):
            found += _around(pose, radius, side)
    return _clear(found, pose, space) or _clear([_straight(pose, s) for s in _LAST], pose, space)


def _clear(found: list[Lead], pose: Sequence[float], space: Space) -> list[Lead]:
    """Return those leads that are clear; those around one circle are in the order of lengths."""
    place = np.array(pose[:2])
    ends = np.array([lead.last for lead in found])
    begins = np.array([lead.vertices[-2] if len(lead.vertices) > 1 else place for lead in found])
    clear = space.keeping(begins, ends).tolist()
    kept, blocked = [], None
    for lead, free in zip(found, clear, strict=True):
        # Leads around one circle extend each other: after one that is not clear, none is.
        circle = (lead.side, lead.radius)
        if not free:
            blocked = circle
        if free and (lead.side == 0 or circle != blocked):
            kept.append(lead)
    return kept


def _sizes(robot: Robot, pose: Sequence[float], ahead: Array) -> list[float]:
    """Return the lengths [m] of straight leads worth a trial."""
    longest = _LONGEST * math.dist(ahead[-1], pose[:2])
    most = min(max(_PER_RADIUS * robot.min_turn_radius, _STRAIGHT[-1]), longest)
    sizes = [*_STRAIGHT, *(share * robot.radius for share in _TINY)]
    shortest = min(sizes)
    sizes = [size for size in sizes if size <= longest]
    sizes += [share * most for share in _SHARES]
    dx, dy = math.cos(pose[2]), math.sin(pose[2])
    way = [(x - pose[0], y - pose[1]) for x, y in ahead.tolist()]
    for (ax, ay), (bx, by) in pairwise(way):
        across = dx * (by - ay) - dy * (bx - ax)
        if abs(across) > 1e-9:
            sizes.append((ax * (by - ay) - ay * (bx - ax)) / across)
    sizes += [dx * x + dy * y for x, y in way]
    sizes = [size for size in dict.fromkeys(sizes) if size >= shortest]
    # The way may end at a via point, which smoothing moves outwards: that would turn a lead to it.
    return [size for size in sizes if math.dist((size * dx, size * dy), way[-1]) > _OFF_END]


def _straight(pose: Sequence[float], size: float) -> Lead:
    last = pose[0] + size * math.cos(pose[2]), pose[1] + size * math.sin(pose[2])
    return Lead([np.array(last)], last, pose[2], size, END_SHARE * size)


def _radii(robot: Robot) -> list[float]:
    """Return the radii [m] of turns worth a trial."""
    easy = [share * robot.radius for share in _EASY]
    return [size for size in easy if size > robot.min_turn_radius] + (
        [robot.min_turn_radius] if robot.min_turn_radius > 0.0 else []
    )


def _around(pose: Sequence[float], radius: float, side: int) -> Iterator[Lead]:
    """Yield leads with more and more vertices around a circle; side: 1 turns left, -1 right."""
    leg = 2.0 * _CIRCLE * radius * math.sin(0.5 * STEP)
    heading, length, width = pose[2], leg, END_SHARE * leg
    x, y = pose[0] + length * math.cos(heading), pose[1] + length * math.sin(heading)
    vertices = [np.array((x, y))]
    yield Lead(vertices, (x, y), heading, length, width, side, radius)
    for _ in range(_MOST_STEPS):
        heading += side * STEP
        x, y, length = x + leg * math.cos(heading), y + leg * math.sin(heading), length + leg
        vertices = [*vertices, np.array((x, y))]
        yield Lead(vertices, (x, y), heading, length, leg, side, radius)
