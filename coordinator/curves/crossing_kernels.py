"""Compiled: the distance of two curves, and where they cross or touch.

Decides: which place in a range of parameters is the intersection.  Must not know: how ranges are
found, or which ranges belong to one intersection.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from coordinator.base.compiled import compiled
from coordinator.curves.bezier_kernels import Array, CurvePair, Pieces, Tangent, place
from coordinator.curves.pair_stack_kernels import U0, U1, V0, V1, PairStack

U, V, PLACE_X, PLACE_Y, PAIR = range(5)
"""Entries of an intersection point: the parameters on both curves, its place [m], and the number of
the pair of curves.  PAIR is the same column in tables of overlaps."""

_NOISE: Final = 1e-13
"""Smaller gaps [m] may be rounding errors, so their signs are ignored."""
_SHORTEST: Final = 1e-6
"""A curve that stays within this distance [m] of a place does not leave the place."""


class Projection(NamedTuple):
    """The point of a second curve that is nearest to a point of a first curve.

    v: its parameter.  gap: the distance [m] of both points; signed: the same, positive if the first
    curve's point is left of the second curve.  turn: the first curve's derivative across the second
    one, [m] per unit of u; it is 0 where the tangents are parallel.
    """

    v: float
    gap: float
    signed: float
    turn: float


class Touch(NamedTuple):
    """Parameters u and v at which two curves cross, touch or are nearest, and the gap [m] there."""

    u: float
    v: float
    gap: float


@compiled
def point_at(pieces: Pieces, curve: int, u: float, stack: PairStack) -> Tangent:
    """Return a curve's point and derivative at u, which is clamped to the domain."""
    low, high = pieces.first[curve], pieces.first[curve + 1] - 1
    while low < high:
        middle = (low + high + 1) // 2
        low, high = (middle, high) if pieces.borders[middle, 0] <= u else (low, middle - 1)
    begin, degree = pieces.borders[low, 0], pieces.degree[curve]
    width = pieces.borders[low, 1] - begin
    t = min(max((u - begin) / width, 0.0), 1.0)
    x, y, dx, dy = place(pieces.control[pieces.start[low] :], degree, t, stack.work)
    return Tangent(x, y, dx / width, dy / width)


@compiled
def project(pair: CurvePair, u: float, v: float, stack: PairStack) -> Projection:
    """Project the first curve's point at u on the second curve, by Gauss-Newton steps from v."""
    pieces, one, other = pair
    x, y, dx, dy = point_at(pieces, one, u, stack)
    first, last = pieces.first[other], pieces.first[other + 1] - 1
    gap, signed, turn = math.inf, 0.0, 0.0
    for step in range(7):
        its_x, its_y, its_dx, its_dy = point_at(pieces, other, v, stack)
        mx, my = x - its_x, y - its_y
        rate = its_dx * its_dx + its_dy * its_dy
        gap = math.sqrt(mx * mx + my * my)
        if rate == 0.0 or step == 6:
            break
        signed = (its_dx * my - its_dy * mx) / math.sqrt(rate)
        turn = (its_dx * dy - its_dy * dx) / math.sqrt(rate)
        shift = (mx * its_dx + my * its_dy) / rate
        v = min(max(v + shift, pieces.borders[first, 0]), pieces.borders[last, 1])
    return Projection(v, gap, signed, turn)


@compiled
def touch_in(pair: CurvePair, span: Array, stack: PairStack) -> Touch:
    """Return where two curves cross or touch in a range (U0, U1, V0, V1), or else are nearest.

    If the signed gap changes its sign between the ends, a crossing is found by bisection; else, if
    the turn does, a point with parallel tangents; else the nearest point by ternary search.
    """
    low, high = span[U0], span[U1]
    rate = (span[V1] - span[V0]) / (high - low) if high > low else 0.0
    first, last = project(pair, low, span[V0], stack), project(pair, high, span[V1], stack)
    best = Touch(low, first.v, first.gap)
    if not first.gap <= last.gap:
        best = Touch(high, last.v, last.gap)
    crosses = first.signed * last.signed < 0.0
    crosses = crosses and min(abs(first.signed), abs(last.signed)) > _NOISE
    if crosses or first.turn * last.turn < 0.0:
        sign, u, now = first.signed if crosses else first.turn, low, first
        for _ in range(60):
            u = 0.5 * (low + high)
            now = project(pair, u, span[V0] + rate * (u - span[U0]), stack)
            if (now.signed if crosses else now.turn) * sign > 0.0:
                low = u
            else:
                high = u
        return Touch(u, now.v, now.gap)
    for _ in range(60 if best.gap > 0.0 else 0):
        third = (high - low) / 3.0
        u, its_u = low + third, high - third
        first = project(pair, u, span[V0] + rate * (u - span[U0]), stack)
        last = project(pair, its_u, span[V0] + rate * (its_u - span[U0]), stack)
        low, high = (low, its_u) if first.gap <= last.gap else (u, high)
        if min(first.gap, last.gap) < best.gap:
            best = Touch(u, first.v, first.gap)
            if not first.gap <= last.gap:
                best = Touch(its_u, last.v, last.gap)
    return best


@compiled
def is_trivial(pieces: Pieces, curve: int, point: Array, stack: PairStack) -> bool:
    """Tell whether a self-intersection is spurious: the curve stays at its place from U to V."""
    for k in range(1, 8):
        u = point[U] + 0.125 * k * (point[V] - point[U])
        at = point_at(pieces, curve, u, stack)
        if max(abs(at.x - point[PLACE_X]), abs(at.y - point[PLACE_Y])) > _SHORTEST:
            return False
    return True
