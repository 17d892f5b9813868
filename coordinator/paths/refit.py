"""Changing a path in one place: a via point more, or another goal.

The path keeps its knots and control points outside of the neighbourhood of the change, so whatever
was said about those parts of it stays true.  A stretch between two straight places is made anew;
its parameters are scaled to fit where the old ones were.

Decides: how far the neighbourhood reaches.  Must not know: who asks for the change, and times.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from coordinator.base.errors import PlanError
from coordinator.curves.nurbs import Array
from coordinator.ground.free_space import Space
from coordinator.motion.cornering import Handling
from coordinator.paths.smoothing import smooth
from coordinator.paths.spline_fit import Fit, fit_at

_REACHES: Final = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
"""Neighbourhoods [m] on each side of a change, tried in turn."""

_EASE: Final = 0.05
"""Half-width [m] over which the parameter's speed changes on a straight stretch."""

_SHORTEST: Final = 4.0 * _EASE
"""A straight stretch has to be this long [m] for a change to begin or end there."""


def with_via(
    found: Fit,
    via: Array,
    space: Space,
    handling: Handling,
    headed: tuple[bool, bool] = (False, False),
) -> Fit:
    """Return the path led through one more place (2,) [m], passed exactly.

    `headed`: whether its ends have directions to keep.  Raises PlanError when no smooth way leads
    through the place.
    """
    here = _nearest(found, via)
    for reach in _REACHES:
        before, after = _cut_before(found, here - reach), _cut_after(found, here + reach)
        into, onward = space.shortest_way(before.leave, via), space.shortest_way(via, after.leave)
        if into is None or onward is None:
            continue
        way = np.concatenate((into, onward[1:]))
        changed = _led(found, before, way, len(into) - 1, after, space, handling, headed)
        if changed is not None:
            return changed
    raise PlanError(f"no smooth way leads through ({via[0]:.2f}, {via[1]:.2f})")


def with_goal(
    found: Fit, goal: Array, space: Space, handling: Handling, headed: bool = False
) -> Fit:
    """Return the path with another goal (2,) [m], kept up to where the way there leaves it.

    `headed`: whether its start has a direction to keep.  Raises PlanError when no smooth way leads
    to the goal.
    """
    end = found.at[-1]
    moved = max(float(np.hypot(*(goal - found.vertices[-1]))), _REACHES[0])
    for reach in (*(moved * share for share in _REACHES if moved * share < end), end):
        before = _cut_before(found, end - reach)
        way = space.shortest_way(before.leave, goal)
        if way is None:
            continue
        changed = _led(found, before, way, 0, None, space, handling, (headed, False))
        if changed is not None:
            return changed
    raise PlanError(f"no smooth way leads to ({goal[0]:.2f}, {goal[1]:.2f})")


@dataclass(frozen=True, eq=False)
class _Cut:
    """Where a change begins or ends.

    Vertices up to `kept`, or from it on, stay as they are.  The change begins (or ends) at
    `border` (2,) [m] with parameter u on a straight leg, and its way leaves (reaches) the leg at
    `leave` (2,) [m].  A cut at an end of the path has both there, and keeps nothing beyond.
    """

    kept: int
    u: float
    border: Array
    leave: Array
    at_end: bool


def _cut_before(found: Fit, u: float) -> _Cut:
    """Return the last straight stretch that begins before u, or the path's start."""
    at, widths = found.at, found.widths
    for i in range(len(at) - 2, -1, -1):
        begin, end = at[i] + widths[i], min(at[i + 1] - widths[i + 1], u)
        if end - begin >= _SHORTEST:
            places = found.curve.evaluate([begin + 2.0 * _EASE, end])
            return _Cut(i, begin + 2.0 * _EASE, places[0], places[1], at_end=False)
    start = found.vertices[0]
    return _Cut(-1, float(at[0]), start, start, at_end=True)


def _cut_after(found: Fit, u: float) -> _Cut:
    """Return the first straight stretch that ends after u, or the path's end."""
    at, widths = found.at, found.widths
    for i in range(1, len(at)):
        begin, end = max(at[i - 1] + widths[i - 1], u), at[i] - widths[i]
        if end - begin >= _SHORTEST:
            places = found.curve.evaluate([end - 2.0 * _EASE, begin])
            return _Cut(i, end - 2.0 * _EASE, places[0], places[1], at_end=False)
    goal = found.vertices[-1]
    return _Cut(len(at), float(at[-1]), goal, goal, at_end=True)


def _nearest(found: Fit, place: Array) -> float:
    """Return the parameter of the point of the path nearest to a place (2,) [m], to 5 cm."""
    count = 2 + int(found.curve.length / 0.05)
    u = found.curve.parameter_at(np.linspace(0.0, found.curve.length, count))
    return float(u[np.argmin(np.hypot(*(found.curve.evaluate(u) - place).T))])


def _led(
    found: Fit,
    before: _Cut,
    way: Array,
    passed: int,
    after: _Cut | None,
    space: Space,
    handling: Handling,
    headed: tuple[bool, bool],
) -> Fit | None:
    """Return the path led along a way (n, 2) between two cuts; None where it cannot be smooth.

    Vertex `passed` of the way is passed exactly, if it is an inner one.
    """
    ends_here = after is None or after.at_end
    if (before.at_end and headed[0]) or (ends_here and headed[1]):
        return None
    first = [] if before.at_end else [before.border]
    last = [] if after is None or after.at_end else [after.border]
    polygon = np.array([*first, *way, *last])
    exact = np.zeros(len(polygon), dtype=np.bool_)
    exact[[0, passed + len(first), -1]] = True
    exact[len(first)] &= passed > 0 or not first
    try:
        inner = smooth(polygon, exact, space, handling, (bool(first), bool(last)))
    except PlanError:
        return None
    changed = _spliced(found, inner, before, after)
    return changed if len(space.obstructed(changed.curve)) == 0 else None


def _spliced(found: Fit, inner: Fit, before: _Cut, after: _Cut | None) -> Fit:
    """Return the path with the stretch between two cuts replaced."""
    head, tail = slice(0, before.kept + 1), slice(len(found.at), None)
    length, scale = float(inner.at[-1]), 1.0
    if after is not None and not after.at_end:
        tail = slice(after.kept, None)
        scale = (after.u - before.u) / length
    widths = scale * inner.widths
    widths[0] = 0.0 if before.at_end else _EASE
    widths[-1] = 0.0 if tail.start == len(found.at) else _EASE
    passed = inner.exact.copy()
    passed[0], passed[-1] = before.at_end, tail.start == len(found.at)

    def joined(kept: Array, new: Array) -> Array:
        return np.concatenate((kept[head], new, kept[tail]))

    return fit_at(
        joined(found.vertices, inner.vertices),
        joined(found.bent, inner.bent),
        np.concatenate((found.exact[head], passed, found.exact[tail])),
        joined(found.at, before.u + scale * inner.at),
        joined(found.widths, widths),
    )
