"""Replacing turns that are too sharp to round by two turns, or by one that is less sharp.

Decides: where the vertices go.  Must not know: curves; smoothing.py rounds the result.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np

from coordinator.base.errors import PlanError
from coordinator.curves.nurbs import Array
from coordinator.ground.corner_kernels import radius_of, turn_between
from coordinator.ground.free_space import Space
from coordinator.paths.spline_fit_kernels import Flags

_SHARPEST: Final = math.radians(100.0)
_LEGS: Final = (0.01, 0.03, 0.06, 0.12, 0.25, 0.5, 1.0, 2.0, 4.0)
"""Lengths [m] tried for the leg between the two turns, or for how far to swing out."""

_NARROW: Final = 0.002
"""Length [m] of that leg that is tried first at places where there is hardly room for it."""

_SLOPE: Final = 3.0
"""A way swings out over this many times as far along."""


def blunt(
    polygon: Array,
    exact: Flags,
    space: Space,
    headed: tuple[bool, bool],
    radius: float,
    narrow: Collection[tuple[float, float]] = (),
    *,
    swings: bool = True,
) -> tuple[Array, Flags]:
    """Replace turns too sharp to round by turns of `radius` [m], if there is room.

    polygon (n, 2) [m], exact (n,).  `headed`: whether the first and the last leg keep their
    directions.  `narrow`: vertices at which the two turns are as near to each other as they can be.
    `swings`: whether a robot may set out, or arrive, beside the polygon in place of turning.
    Raises PlanError if there is no room to turn.
    """
    legs = np.diff(polygon, axis=0)
    along = np.einsum("ij,ij->i", legs[:-1], legs[1:])
    sizes = np.hypot(legs[:, 0], legs[:, 1])
    if np.all(along >= math.cos(_SHARPEST) * sizes[:-1] * sizes[1:]):
        return polygon, exact
    vertices, flags, last = [polygon[0]], [bool(exact[0])], len(polygon) - 2
    for i in range(1, len(polygon) - 1):
        before, here, after = vertices[-1], polygon[i], polygon[i + 1]
        if abs(turn_between(*_unit(here - before), *_unit(after - here))) <= _SHARPEST:
            vertices.append(here)
            flags.append(bool(exact[i]))
            continue
        held = (i == 1 and headed[0]) or (i == last and headed[1])
        ends = (i == 1, i == last) if swings and not held else (False, False)
        widths = (_NARROW, *_LEGS) if (float(here[0]), float(here[1])) in narrow else _LEGS
        if i == last and headed[1]:
            turn = _Turn(after, here, before, bool(exact[i]), ends)
            extra = _rounded(turn, space, radius, widths)[::-1]
        else:
            turn = _Turn(before, here, after, bool(exact[i]), ends)
            extra = _rounded(turn, space, radius, widths)
        vertices.extend(extra)
        flags.extend([bool(exact[i]) and vertex is here for vertex in extra])
    return np.array([*vertices, polygon[-1]]), np.array([*flags, exact[-1]])


class _Turn(NamedTuple):
    """A sharp turn at a vertex, `exact` if it has to be passed, between those before and after it.

    `ends`: which of these end the way; none if a leg of the turn has a heading.
    """

    before: Array
    here: Array
    after: Array
    exact: bool
    ends: tuple[bool, bool]


def _rounded(turn: _Turn, space: Space, radius: float, widths: Sequence[float]) -> list[Array]:
    """Return the vertices for one sharp turn; an exact vertex is among them.

    The shortest leg that gives a turn of `radius` [m] is taken, else the one that turns widest.
    """
    here, best, best_radius = turn.here, list[Array](), 0.0
    into, onward = _unit(here - turn.before), _unit(turn.after - here)
    for width in widths:
        for trial in (*_trials(into, onward, here, width, turn.exact), *_swung(turn, width)):
            way = np.stack((turn.before, *trial[:1], *trial[1:][-1:], turn.after))
            turned = _least_radius(way)
            if turned > best_radius and space.keeping(way[:-1], way[1:]).all():
                best, best_radius = trial, turned
        if best_radius >= radius:
            break
    if not best:
        for trial in _slanted(into, onward, here):
            way = np.stack((turn.before, *trial, turn.after))
            if space.keeping(way[:-1], way[1:]).all():
                return trial
        raise PlanError(
            f"no room to turn round at ({here[0]:.2f}, {here[1]:.2f})",
            place=(float(here[0]), float(here[1])),
            helps="more room there or another heading",
        )
    return best


def _swung(turn: _Turn, width: float) -> Iterator[list[Array]]:
    """Yield a vertex in place of the turn's, `width` [m] beside the line between its neighbours.

    A robot that touches something may have to back away a little before it passes that; one that
    may set out, or arrive, in any direction swings out instead.
    """
    pairs = (turn.before, turn.after), (turn.after, turn.before)
    for (end, other), is_end in zip(pairs, turn.ends, strict=True):
        if is_end and not turn.exact:
            line = other - end
            ahead = min(0.5 * math.hypot(*line), _SLOPE * width) * _unit(line)
            side = width * np.array([-ahead[1], ahead[0]]) / math.hypot(*ahead)
            yield from ([end + ahead + side], [end + ahead - side])


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


def _slanted(into: Array, onward: Array, here: Array) -> Iterator[list[Array]]:
    """Yield vertices for a turn in a corner of the floor, where there is room backwards only.

    The vertex itself comes first, so that a leg which leads there keeps its direction.
    """
    for back in (-into, onward):
        for sign in (1.0, -1.0):
            slant = back + sign * np.array([-back[1], back[0]])
            yield [here, here + _LEGS[0] * _unit(slant)]


def _least_radius(way: Array) -> float:
    """Return the least radius [m] of a way's corners (3 or 4, 2) when two take half a leg each."""
    legs = np.diff(way, axis=0)
    sizes = np.hypot(legs[:, 0], legs[:, 1])
    room = sizes * np.array((0.9, *(0.5 for _ in sizes[2:]), 0.9))
    return min(
        radius_of(
            min(room[k], room[k + 1]),
            turn_between(*(legs[k] / sizes[k]), *(legs[k + 1] / sizes[k + 1])),
        )
        for k in range(len(legs) - 1)
    )


def _unit(leg: Array) -> Array:
    return np.asarray(leg / math.hypot(*leg))
