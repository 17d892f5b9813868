"""From a control polygon to a cubic curve: straight where the way is straight, C2 at corners.

The curve is the variation-diminishing spline (Schoenberg) of the polygon by arc length: with the
knots a - d, a, a + d for a corner at arc length a, the second derivative is a hat of height
|t1 - t0| / d over [a - d, a + d] and zero elsewhere (t0, t1: unit directions before and after).
For a turn by theta this gives, exactly,

    cut of the corner        d / 3 * sin(theta / 2)
    greatest curvature       2 sin(theta / 2) / (d cos(theta / 2)^2)

Decides: the half-width d of each corner: the widest that stays clear.  Must not know: where the
polygon comes from, other robots, times.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Final

import numpy as np
import numpy.typing as npt

from coordinator.errors import PlanError, TurnError
from coordinator.nurbs import Array, Nurbs, nurbs

Flags = npt.NDArray[np.bool_]
Clear = Callable[[Array], Flags]

_WIDEST: Final = 1.5
_NARROWEST: Final = 2e-3
_SHRINK: Final = 0.75
_SHARPEST: Final = math.radians(100.0)
_STEP: Final = 0.01
_TURN_LEGS: Final = (0.03, 0.06, 0.12, 0.25, 0.5, 1.0, 2.0, 4.0)
"""Lengths [m] tried for the leg between the two turns that replace a sharp one."""
_EASY_TURN: Final = 0.1
_TURN_RESERVE: Final = 1.2
_WIDTH_PER_RADIUS: Final = 4.0
"""Half-width that a turn by 90 degrees takes per metre of radius, with some reserve."""
_END_SHARE: Final = 0.9
"""Share of the first and last leg that a corner may take: a knot near the end would stall there."""


def smooth(
    polygon: Array,
    exact: Flags,
    clear: Clear,
    min_turn_radius: float = 0.0,
    headed: tuple[bool, bool] = (False, False),
) -> Nurbs:
    """Return the cubic curve along a polygon (n, 2) [m], with the numbers of the wire (float32).

    exact (n,): vertices that the curve passes exactly; the others are cut.  `clear` tells for
    points (m, 2) whether the curve may be there.  `headed`: whether the directions of the first
    and of the last leg are asked for.  Raises PlanError when a turn does not fit.
    """
    polygon, exact = _without_straight(polygon, exact, headed)
    radius = max(_TURN_RESERVE * min_turn_radius, _EASY_TURN)
    polygon, exact = _blunt(polygon, exact, clear, headed[1], radius)
    polygon, exact = _without_straight(polygon, exact, headed)
    widest = max(_WIDEST, _WIDTH_PER_RADIUS * min_turn_radius)
    widths = _widest(polygon, widest)
    while True:
        curve, centers = _spline(polygon, exact, widths)
        arcs = np.linspace(0.0, curve.length, 2 + int(curve.length / _STEP))
        corners = _corner_samples(centers, widths)
        u = np.concatenate((curve.parameter_at(arcs), corners))
        hit = u[~clear(curve.evaluate(u))]
        if len(hit) == 0:
            break
        _shrink(widths, centers, hit, curve)
    _check_turns(curve, corners, min_turn_radius)
    return curve


def _without_straight(
    polygon: Array, exact: Flags, headed: tuple[bool, bool]
) -> tuple[Array, Flags]:
    """Drop doubled vertices and those at which the way does not turn.

    Exact vertices and the ends of headed legs stay: a turn beyond them must not reach past them.
    """
    keep = np.ones(len(polygon), dtype=np.bool_)
    last = 0
    for i in range(1, len(polygon)):
        if np.hypot(*(polygon[i] - polygon[last])) < 1e-6:
            exact[last] |= exact[i]
            keep[i] = False
        else:
            last = i
    polygon, exact = polygon[keep], exact[keep]
    turns = np.concatenate(([1.0], np.abs(_turns(polygon)), [1.0]))
    keep = exact | (turns > 1e-6)
    keep[1] |= headed[0]
    keep[-2] |= headed[1]
    return polygon[keep], exact[keep]


def _directions(polygon: Array) -> tuple[Array, Array]:
    """Return unit directions (n - 1, 2) and lengths (n - 1,) of the legs."""
    legs = np.diff(polygon, axis=0)
    sizes = np.hypot(legs[:, 0], legs[:, 1])
    return legs / sizes[:, None], sizes


def _turns(polygon: Array) -> Array:
    """Return the signed turn [rad] at each inner vertex, (n - 2,)."""
    unit, _ = _directions(polygon)
    cross = unit[:-1, 0] * unit[1:, 1] - unit[:-1, 1] * unit[1:, 0]
    return np.asarray(np.arctan2(cross, np.einsum("ij,ij->i", unit[:-1], unit[1:])))


def _blunt(
    polygon: Array, exact: Flags, clear: Clear, keep_last: bool, radius: float
) -> tuple[Array, Flags]:
    """Replace turns too sharp to round by two turns of `radius` [m], if there is room.

    The first leg keeps its direction, the last one too when it has to.
    """
    vertices = [polygon[0]]
    flags = [bool(exact[0])]
    for i in range(1, len(polygon) - 1):
        here, after = polygon[i], polygon[i + 1]
        turn = _turns(np.stack((vertices[-1], here, after)))[0]
        if abs(turn) <= _SHARPEST:
            vertices.append(here)
            flags.append(bool(exact[i]))
            continue
        if keep_last and i == len(polygon) - 2:
            extra = _two_turns(after, here, vertices[-1], bool(exact[i]), clear, radius)[::-1]
        else:
            extra = _two_turns(vertices[-1], here, after, bool(exact[i]), clear, radius)
        vertices.extend(extra)
        flags.extend([False] * len(extra))
    return np.array([*vertices, polygon[-1]]), np.array([*flags, exact[-1]])


def _two_turns(
    before: Array, here: Array, after: Array, exact: bool, clear: Clear, radius: float
) -> list[Array]:
    """Return two vertices for one sharp turn; an exact vertex stays on the leg between them.

    The shortest leg that gives a turn of `radius` [m] is taken, else the one that turns widest.
    """
    into = (here - before) / np.hypot(*(here - before))
    onward = (after - here) / np.hypot(*(after - here))
    side = np.array([-into[1], into[0]])
    if side @ onward < 0.0:
        side = -side
    bisector = into + onward
    size = np.hypot(*bisector)
    along = bisector / size if exact and size > 0.1 else side
    best, best_radius = None, 0.0
    for width in _TURN_LEGS:
        for across in (along, -along):
            pair = [here - width * across, here + width * across]
            if not exact:
                pair = [here, here + width * across]
            way = np.stack((before, *pair, after))
            turned = float(_radii(way, _widest(way)).min())
            if turned > best_radius and bool(clear(_trail(way)).all()):
                best, best_radius = pair, turned
        if best_radius >= radius:
            break
    if best is None:
        raise PlanError(
            f"no room to turn round at ({here[0]:.2f}, {here[1]:.2f}); "
            "more room there or another heading would help"
        )
    return best


def _radii(polygon: Array, widths: Array) -> Array:
    """Return the least radius of curvature [m] at each corner, (n - 2,), from the closed form."""
    half = 0.5 * np.abs(_turns(polygon))
    return np.asarray(widths * np.cos(half) ** 2 / np.maximum(2.0 * np.sin(half), 1e-9))


def _trail(polygon: Array) -> Array:
    """Return points (m, 2) along a polygon, at most 2 cm apart."""
    parts = [
        a + (b - a) * np.linspace(0.0, 1.0, 2 + int(np.hypot(*(b - a)) / 0.02))[:, None]
        for a, b in pairwise(polygon)
    ]
    return np.concatenate(parts)


def _widest(polygon: Array, widest: float = _WIDEST) -> Array:
    """Return the greatest half-width of each corner, (n - 2,): inner legs are shared evenly."""
    _, sizes = _directions(polygon)
    share = 0.5 * sizes
    if len(sizes) > 1:
        share[0], share[-1] = _END_SHARE * sizes[0], _END_SHARE * sizes[-1]
    return np.minimum(np.minimum(share[:-1], share[1:]), widest)


def _spline(polygon: Array, exact: Flags, widths: Array) -> tuple[Nurbs, Array]:
    """Return the spline of the polygon and the parameters of its corners (n - 2,)."""
    bent = _bent_outwards(polygon, exact, widths)
    _, sizes = _directions(bent)
    arc = np.concatenate(([0.0], np.cumsum(sizes)))
    centers = arc[1:-1]
    share = np.minimum(_widest(bent, np.inf), widths)
    turns = np.abs(_turns(bent)) > 1e-6
    corner, width = centers[turns], share[turns]
    inner = np.sort(np.concatenate((corner - width, corner, corner + width)))
    inner = inner[(inner > 1e-5) & (inner < arc[-1] - 1e-5)]
    inner = inner[np.append(True, np.diff(inner) > 1e-5)] if len(inner) else inner
    knots = np.concatenate((np.zeros(4), inner, np.full(4, arc[-1])))
    greville = (knots[1:-3] + knots[2:-2] + knots[3:-1]) / 3.0
    points = np.column_stack(
        (np.interp(greville, arc, bent[:, 0]), np.interp(greville, arc, bent[:, 1]))
    )
    points[0], points[-1] = polygon[0], polygon[-1]
    return nurbs(3, knots.astype(np.float32), points.astype(np.float32)), centers


def _bent_outwards(polygon: Array, exact: Flags, widths: Array) -> Array:
    """Move exact vertices out by the cut, so that the curve passes where they were."""
    bent = polygon.copy()
    inner = np.flatnonzero(exact[1:-1]) + 1
    for _ in range(40 if len(inner) else 0):
        unit, _ = _directions(bent)
        share = np.minimum(_widest(bent, np.inf), widths)
        turn = (unit[1:] - unit[:-1]) * (share / 6.0)[:, None]
        bent[inner] = polygon[inner] - turn[inner - 1]
    return bent


def _corner_samples(centers: Array, widths: Array) -> Array:
    """Return parameters that look closely at every corner."""
    offsets = np.linspace(-1.0, 1.0, 17)
    return np.asarray((centers[:, None] + widths[:, None] * offsets).ravel())


def _shrink(widths: Array, centers: Array, hit: Array, curve: Nurbs) -> None:
    """Narrow the corners nearest to the parameters where the curve is not clear."""
    if len(centers) == 0:
        raise _blocked(curve, hit)
    nearest = np.unique(np.argmin(np.abs(centers[:, None] - hit), axis=0))
    if np.all(widths[nearest] <= _NARROWEST):
        raise _blocked(curve, hit)
    widths[nearest] = np.maximum(_SHRINK * widths[nearest], _NARROWEST)


def _blocked(curve: Nurbs, hit: Array) -> PlanError:
    x, y = curve.evaluate(hit[:1])[0]
    return PlanError(f"no smooth way past ({x:.2f}, {y:.2f}); more room there would help")


def _check_turns(curve: Nurbs, corners: Array, min_turn_radius: float) -> None:
    """Raise PlanError when the curve is tighter at parameters (m,) than the robot can turn."""
    if min_turn_radius <= 0.0 or len(corners) == 0:
        return
    bend = np.abs(curve.curvature(corners))
    worst = int(np.argmax(bend))
    if bend[worst] * min_turn_radius > 1.001:
        x, y = curve.evaluate(corners[worst])[0]
        radius = 1.0 / float(bend[worst])
        raise TurnError(
            f"the best turn found at ({x:.2f}, {y:.2f}) has a radius of {radius:.3f} m, "
            f"min_turn_radius is {min_turn_radius} m; more room or another heading would help",
            radius,
        )
