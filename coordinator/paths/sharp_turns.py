"""Replacing turns that are too sharp to round by two turns.

Decides: where the two vertices go.  Must not know: curves; smoothing.py rounds the result.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from coordinator.base.errors import PlanError
from coordinator.curves.nurbs import Array
from coordinator.ground.corner_kernels import radius_of, turn_between
from coordinator.ground.free_space import Space
from coordinator.paths.spline_fit import Flags

_SHARPEST: Final = math.radians(100.0)
_LEGS: Final = (0.01, 0.03, 0.06, 0.12, 0.25, 0.5, 1.0, 2.0, 4.0)
"""Lengths [m] tried for the leg between the two turns."""


def blunt(
    polygon: Array, exact: Flags, space: Space, keep_last: bool, radius: float
) -> tuple[Array, Flags]:
    """Replace turns too sharp to round by two turns of `radius` [m], if there is room.

    polygon (n, 2) [m], exact (n,).  The first leg keeps its direction, and with `keep_last` the
    last one does, too.  Raises PlanError if there is no room to turn.
    """
    legs = np.diff(polygon, axis=0)
    along = np.einsum("ij,ij->i", legs[:-1], legs[1:])
    sizes = np.hypot(legs[:, 0], legs[:, 1])
    if np.all(along >= math.cos(_SHARPEST) * sizes[:-1] * sizes[1:]):
        return polygon, exact
    vertices, flags = [polygon[0]], [bool(exact[0])]
    for i in range(1, len(polygon) - 1):
        here, after = polygon[i], polygon[i + 1]
        into, onward = _unit(here - vertices[-1]), _unit(after - here)
        if abs(turn_between(*into, *onward)) <= _SHARPEST:
            vertices.append(here)
            flags.append(bool(exact[i]))
            continue
        if keep_last and i == len(polygon) - 2:
            extra = _two_turns(after, here, vertices[-1], bool(exact[i]), space, radius)[::-1]
        else:
            extra = _two_turns(vertices[-1], here, after, bool(exact[i]), space, radius)
        vertices.extend(extra)
        flags.extend([bool(exact[i]) and vertex is here for vertex in extra])
    return np.array([*vertices, polygon[-1]]), np.array([*flags, exact[-1]])


def _two_turns(
    before: Array, here: Array, after: Array, exact: bool, space: Space, radius: float
) -> list[Array]:
    """Return the vertices for one sharp turn; an exact vertex is among them.

    The shortest leg that gives a turn of `radius` [m] is taken, else the one that turns widest.
    """
    best: list[Array] | None = None
    best_radius = 0.0
    for width in _LEGS:
        for trial in _trials(_unit(here - before), _unit(after - here), here, width, exact):
            way = np.stack((before, trial[0], trial[-1], after))
            turned = _least_radius(way)
            if turned > best_radius and space.keeping(way[:-1], way[1:]).all():
                best, best_radius = trial, turned
        if best_radius >= radius:
            break
    if best is None:
        raise PlanError(
            f"no room to turn round at ({here[0]:.2f}, {here[1]:.2f})",
            place=(float(here[0]), float(here[1])),
            helps="more room there or another heading",
        )
    return best


def _trials(
    into: Array, onward: Array, here: Array, width: float, exact: bool
) -> Iterator[list[Array]]:
    """Yield vertices for a turn from one unit direction to another with a leg of `width` [m].

    An exact vertex lies in the middle of the leg, or else at one of its ends.
    """
    side = np.array([-into[1], into[0]])
    if side @ onward < 0.0:
        side = -side
    if not exact:
        yield from ([here, here + sign * width * side] for sign in (1.0, -1.0))
        return
    bisector = into + onward
    size = math.hypot(*bisector)
    along = width * (bisector / size if size > 0.1 else side)
    yield from ([here - sign * along, here, here + sign * along] for sign in (1.0, -1.0))
    yield from ([here, here + sign * width * side] for sign in (1.0, -1.0))
    back = width * np.array([-onward[1], onward[0]])
    yield from ([here + sign * back, here] for sign in (1.0, -1.0))


def _least_radius(way: Array) -> float:
    """Return the least radius [m] of the two corners of a way (4, 2) when each takes half a leg."""
    legs = np.diff(way, axis=0)
    sizes = np.hypot(legs[:, 0], legs[:, 1])
    unit = legs / sizes[:, None]
    middle = 0.5 * sizes[1]
    return min(
        radius_of(min(0.9 * sizes[0], middle), turn_between(*unit[0], *unit[1])),
        radius_of(min(middle, 0.9 * sizes[2]), turn_between(*unit[1], *unit[2])),
    )


def _unit(leg: Array) -> Array:
    return np.asarray(leg / math.hypot(*leg))
