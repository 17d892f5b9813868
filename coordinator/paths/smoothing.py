"""From a control polygon to a cubic curve: straight where the way is straight, C2 at corners.

Several vertices around one corner of an obstacle are merged where there is room; corners are moved
outwards as far as that shortens the travel time; each is then rounded as widely as it stays clear
(ground/polygon_kernels.py, spline_fit.py).

Decides: the corners and their half-widths.  Must not know: where the polygon comes from, other
robots' times.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Final

import numpy as np

from coordinator.base.errors import PlanError, TurnError
from coordinator.curves.nurbs import Array, Nurbs
from coordinator.ground.corner_kernels import NARROWEST, STRAIGHT
from coordinator.ground.free_space import Space
from coordinator.ground.polygon_kernels import merge, push, widths
from coordinator.motion.cornering import Handling
from coordinator.motion.message_room import ROOM, expected_bytes
from coordinator.paths.sharp_turns import blunt
from coordinator.paths.spline_fit import Fit, fit
from coordinator.paths.spline_fit_kernels import Flags, lengths_along

_SHRINK: Final = 0.75
_PUSH_SHARE: Final = 0.006
"""Moving all corners outwards may lengthen the way by at most this share."""
_LONGEST: Final = 1.02
"""A curve longer than this many times its polygon is made again without moving corners."""
_SHARE: Final = 0.45
"""The greatest share of a leg over which `smooth_near` rounds the corner at its end."""
_ALONG: Final = 1e-5
"""A way that turns by less than twice this [rad] at a vertex is straight there."""
_NEAR_END: Final = 1.5
"""A circle whose first knot would be nearer to an end than half a leg begins at the end."""
_SPENT_PER_CORNER: Final = (0.02, 0.1, 0.5, 2.0)
"""How much longer [m] a way may become for one corner less, tried in turn, if it has too many."""


def smooth(
    polygon: Array,
    exact: Flags,
    space: Space,
    handling: Handling,
    led: tuple[int, int] = (0, 0),
) -> Fit:
    """Return the cubic curve along a polygon (n, 2) [m], in the numbers of the wire (float32).

    exact (n,): vertices that the curve passes exactly; at the others it cuts the corner.  `led`:
    how many vertices of a lead follow the start, and how many come before the goal, if the curve
    must have the direction of the first or of the last leg there; several lie on a circle, one leg
    apart.  Raises PlanError if a turn has no room, TurnError if it is tighter than the robot can
    turn.

    If a way has too many corners for a message, some are removed, which makes it longer.
    """
    space = space.near(polygon)
    found = _smoothed(polygon, exact, space, handling, led)
    for spent in _SPENT_PER_CORNER:
        if _fits(found.curve, handling):
            break
        with suppress(PlanError):
            thrifty = replace(handling, spent_per_corner=spent)
            fewer = _smoothed(polygon, exact, space, thrifty, led)
            found = min(found, fewer, key=lambda fit: len(fit.curve.points))
    return found


def turned_near(
    polygon: Array,
    exact: Flags,
    space: Space,
    narrow: Collection[tuple[float, float]],
    headed: tuple[bool, bool] = (False, False),
) -> tuple[Array, Flags]:
    """Return a polygon (n, 2) [m] without turns too sharp to round, for `smooth_near`.

    exact (n,): vertices that are passed exactly; narrow: vertices beside which others may be, so
    that sharp turns there lead hardly beyond them; headed: as for `smooth`.  Raises PlanError if a
    turn has no room.
    """
    polygon, exact = _without_straight(polygon, exact, headed)
    blunted, passed = blunt(polygon, exact, space, headed, 0.0, narrow, swings=False)
    if blunted is polygon:
        return polygon, exact
    return _without_straight(blunted, passed, headed)


def smooth_near(
    polygon: Array,
    exact: Flags,
    space: Space,
    cut: float,
    cuts: Mapping[tuple[float, float], float],
) -> tuple[Nurbs, Array]:
    """Return the cubic curve along a polygon (n, 2) [m] that cuts its corners by at most `cut` [m].

    Beside it, the parameters at which it passes the exact vertices (n,); the polygon has no turns
    too sharp to round.  cuts: by how much at most corners are cut at vertices that the curve passes
    exactly [m], since it swings out beside them.  Raises PlanError if the curve has no room.
    """
    legs = np.diff(polygon, axis=0)
    sizes = np.hypot(legs[:, 0], legs[:, 1])
    # A corner that turns by theta, rounded over d, is cut by d / 3 * sin(theta / 2).
    halves = 0.5 * np.hypot(*np.diff(legs / sizes[:, None], axis=0).T)
    room = _SHARE * np.minimum(sizes[:-1], sizes[1:])
    there = [cuts.get((float(x), float(y)), cut) for x, y in polygon[1:-1]]
    most = np.where(exact[1:-1], there, cut)
    wide = np.minimum(3.0 * most / np.maximum(halves, 1e-9), room)
    wide = np.concatenate(([0.0], wide, [0.0]))
    # Where the way is straight the curve passes a vertex: no rounding of a corner reaches there.
    kept = np.concatenate(([True], halves > _ALONG, [True]))
    found = _clear(polygon[kept], exact[kept], space, wide[kept])
    along = lengths_along(polygon)
    return found.curve, np.interp(along, along[kept], found.at)[exact]


def _fits(curve: Nurbs, handling: Handling) -> bool:
    """Return whether a message has room for a curve and, if bends are slow, for its speeds."""
    return expected_bytes(len(curve.points), math.isfinite(handling.lateral)) <= ROOM


def _smoothed(
    polygon: Array, exact: Flags, space: Space, handling: Handling, led: tuple[int, int]
) -> Fit:
    """Do what `smooth` does; `space` needs only the discs that are near the polygon."""
    polygon, exact = _without_straight(polygon, exact, led)
    blunted, passed = blunt(polygon, exact, space, (led[0] > 0, led[1] > 0), handling.easy)
    if blunted is not polygon:
        polygon, exact = _without_straight(blunted, passed, led)
    begin, end = 1 + led[0], len(polygon) - 1 - led[1]
    numbers = handling.numbers()
    wider, passed = merge(polygon, exact, begin, end, numbers, space.solid)
    end -= len(polygon) - len(wider)
    budget = _PUSH_SHARE * float(lengths_along(polygon)[-1]) / max(end - begin, 1)
    wider = push(wider, passed, begin, end, budget, numbers, space.solid)
    found = _rounded(wider, passed, space, handling, led)
    too_long = found.curve.length > _LONGEST * lengths_along(polygon)[-1]
    if too_long and handling.spent_per_corner == 0.0:
        with suppress(TurnError):
            return _turnable(_rounded(polygon, exact, space, handling, led), handling)
    return _turnable(found, handling)


def _rounded(
    polygon: Array, exact: Flags, space: Space, handling: Handling, led: tuple[int, int]
) -> Fit:
    """Round the corners of a polygon, less widely where the curve is not proven clear otherwise."""
    wide = widths(polygon, exact, handling.numbers(), space.solid)
    shared, circles = _on_circles(np.hypot(*np.diff(polygon, axis=0).T), led)
    return _clear(polygon, exact, space, np.where(circles > 0.0, circles, wide), shared)


def _on_circles(legs: Array, led: tuple[int, int]) -> tuple[Flags, Array]:
    """Return which legs (n,) [m] of a polygon with leads are along circles.

    Beside them, the half-widths (n + 1,) [m] of the vertices on circles, 0 for others.
    """
    is_led = np.zeros(len(legs) + 1, np.bool_)
    is_led[1 : 1 + led[0] * (led[0] > 1)] = True
    is_led[len(legs) - led[1] * (led[1] > 1) : -1] = True
    inside = is_led[:-1] & is_led[1:]
    sizes = np.where(inside, legs, math.inf)
    wide = np.minimum(np.append(math.inf, sizes), np.append(sizes, math.inf))
    wide[np.isinf(wide)] = 0.0
    shared = inside & (legs < wide[:-1] + wide[1:])
    for end, beside in ((0, 1), (-1, -2)):  # No knot is so near an end that float32 would tell.
        if shared[beside : beside + 1].any() and legs[end] < _NEAR_END * wide[beside]:
            wide[beside] = legs[end]
    return shared, wide


def _clear(
    polygon: Array, exact: Flags, space: Space, wide: Array, shared: Flags | None = None
) -> Fit:
    """Round corners over half-widths (n,) [m], or narrower ones where the curve is not clear."""
    while True:
        found = fit(polygon, exact, wide, shared)
        hit = space.obstructed(found.curve)
        if len(hit) == 0:
            return found
        wide = _narrower(found, hit, shared)


def _without_straight(polygon: Array, exact: Flags, led: tuple[int, int]) -> tuple[Array, Flags]:
    """Drop doubled vertices and those at which the way does not turn.

    Exact vertices and those of leads stay, so that the next turn cannot extend past them.
    """
    legs = np.diff(polygon, axis=0)
    keep = np.append(True, np.hypot(legs[:, 0], legs[:, 1]) >= STRAIGHT)
    exact = exact.copy()
    group = np.cumsum(keep) - 1
    polygon, exact = polygon[keep], np.bincount(group, weights=exact) > 0.0
    legs = np.diff(polygon, axis=0)
    cross = legs[:-1, 0] * legs[1:, 1] - legs[:-1, 1] * legs[1:, 0]
    turns = np.abs(np.arctan2(cross, np.einsum("ij,ij->i", legs[:-1], legs[1:])))
    keep = exact | np.concatenate(([True], turns > STRAIGHT, [True]))
    keep[1 : 1 + led[0]] = True
    keep[len(keep) - 1 - led[1] : -1] = True
    return polygon[keep], exact[keep]


def _narrower(found: Fit, hit: Array, shared: Flags | None) -> Array:
    """Narrow the corners nearest to the parameters at which the curve is not clear.

    Exact vertices at the ends of a leg that is not clear are narrowed as well, because moving them
    outwards has moved the leg.  Raises PlanError if none can be narrowed, as on a circle.
    """
    wide = found.widths.copy()
    corners = np.flatnonzero(wide > 0.0)
    if len(corners) == 0:
        raise _blocked(found.curve, hit)
    nearest = corners[np.unique(np.argmin(np.abs(found.at[corners, None] - hit), axis=0))]
    ends = np.clip(np.searchsorted(found.at, hit)[:, None] - (1, 0), 0, len(wide) - 1).ravel()
    nearest = np.union1d(nearest, ends[found.exact[ends] & (wide[ends] > 0.0)])
    is_fixed = wide[nearest] <= NARROWEST
    if shared is not None:
        is_fixed |= np.append(shared, False)[nearest] | np.append(False, shared)[nearest]
    if np.all(is_fixed):
        raise _blocked(found.curve, hit)
    nearest = nearest[~is_fixed]
    wide[nearest] = np.maximum(_SHRINK * wide[nearest], np.minimum(NARROWEST, wide[nearest]))
    return wide


def _blocked(curve: Nurbs, hit: Array) -> PlanError:
    x, y = curve.evaluate(hit[:1])[0]
    place = (float(x), float(y))
    return PlanError(f"no smooth way past ({x:.2f}, {y:.2f})", place=place, helps="more room there")


def least_radius(found: Fit) -> float:
    """Return the least radius [m] that the curve has at its corners; infinite without any."""
    corners = np.flatnonzero(found.widths > 0.0)
    if len(corners) == 0:
        return math.inf
    offsets = np.linspace(-1.0, 1.0, 9)
    u = (found.at[corners, None] + found.widths[corners, None] * offsets).ravel()
    return 1.0 / max(float(np.abs(found.curve.curvature(u)).max()), 1e-9)


def _turnable(found: Fit, handling: Handling) -> Fit:
    """Return the fit; raises TurnError if one of its turns is tighter than the robot can turn."""
    corners = np.flatnonzero(found.widths > 0.0)
    if handling.min_turn_radius <= 0.0 or len(corners) == 0:
        return found
    offsets = np.linspace(-1.0, 1.0, 33)
    u = (found.at[corners, None] + found.widths[corners, None] * offsets).ravel()
    bend = np.abs(found.curve.curvature(u))
    worst = int(np.argmax(bend))
    if bend[worst] * handling.min_turn_radius > 1.001:
        x, y = found.curve.evaluate(u[worst])[0]
        radius = 1.0 / float(bend[worst])
        raise TurnError(
            f"the best turn found at ({x:.2f}, {y:.2f}) has a radius of {radius:.3f} m, "
            f"min_turn_radius is {handling.min_turn_radius} m",
            radius,
            (float(x), float(y)),
            "a smaller min_turn_radius, more room, or other via points or headings",
        )
    return found
