"""Compiled: two curves side by side, the gap between them and where they cross or touch.

Decides: where in a stretch a meeting is.  Must not know: how stretches are found, or which of them
are one meeting.
"""

from __future__ import annotations

import math
from typing import Final

from coordinator.base.compiled import compiled
from coordinator.curves.bezier_kernels import Array, Pieces, place
from coordinator.curves.pair_stack_kernels import Desk

_NOISE: Final = 1e-13
"""Smaller gaps [m] may be rounding errors, so their signs are ignored."""
_SHORTEST: Final = 1e-6
"""A curve without a point farther away [m] has not left a place."""


@compiled
def point_at(pieces: Pieces, curve: int, u: float, desk: Desk) -> tuple[float, float, float, float]:
    """Return point and derivative x, y, x', y' of a curve at u, moved into its domain."""
    low, high = pieces.first[curve], pieces.first[curve + 1] - 1
    while low < high:
        middle = (low + high + 1) // 2
        low, high = (middle, high) if pieces.borders[middle, 0] <= u else (low, middle - 1)
    begin, degree = pieces.borders[low, 0], pieces.degree[curve]
    width = pieces.borders[low, 1] - begin
    t = min(max((u - begin) / width, 0.0), 1.0)
    x, y, dx, dy = place(pieces.control[pieces.start[low] :], degree, t, desk.work)
    return x, y, dx / width, dy / width


@compiled
def compare(
    pieces: Pieces, one: int, other: int, u: float, v: float, desk: Desk
) -> tuple[float, float, float, float]:
    """Return v of the foot of one's point at u on the other, the gap there, its signed size, turn.

    The search for the foot begins at v and stays near; the turn is the sine between tangents.
    """
    x, y, dx, dy = point_at(pieces, one, u, desk)
    first, last = pieces.first[other], pieces.first[other + 1] - 1
    gap, signed, turn = math.inf, 0.0, 0.0
    for step in range(7):
        its_x, its_y, its_dx, its_dy = point_at(pieces, other, v, desk)
        mx, my = x - its_x, y - its_y
        rate = its_dx * its_dx + its_dy * its_dy
        gap = math.sqrt(mx * mx + my * my)
        if rate == 0.0 or step == 6:
            break
        signed = (its_dx * my - its_dy * mx) / math.sqrt(rate)
        turn = (its_dx * dy - its_dy * dx) / math.sqrt(rate)
        shift = (mx * its_dx + my * its_dy) / rate
        v = min(max(v + shift, pieces.borders[first, 0]), pieces.borders[last, 1])
    return v, gap, signed, turn


@compiled
def touch_in(
    pieces: Pieces, one: int, other: int, whole: Array, desk: Desk
) -> tuple[float, float, float]:
    """Return u, v and gap of the place in a range (u0, u1, v0, v1) where curves cross or touch.

    By halving, where the signed gap or else the turn changes sign; else the nearest place.
    """
    low, high = whole[0], whole[1]
    rate = (whole[3] - whole[2]) / (high - low) if high > low else 0.0
    v, gap, signed, turn = compare(pieces, one, other, low, whole[2], desk)
    last, last_gap, last_signed, last_turn = compare(pieces, one, other, high, whole[3], desk)
    best, foot, least = (low, v, gap) if gap <= last_gap else (high, last, last_gap)
    crosses = signed * last_signed < 0.0 and min(abs(signed), abs(last_signed)) > _NOISE
    if crosses or turn * last_turn < 0.0:
        sign, u = signed if crosses else turn, low
        for _ in range(60):
            u = 0.5 * (low + high)
            guess = whole[2] + rate * (u - whole[0])
            v, gap, signed, turn = compare(pieces, one, other, u, guess, desk)
            if (signed if crosses else turn) * sign > 0.0:
                low = u
            else:
                high = u
        return u, v, gap
    for _ in range(60 if least > 0.0 else 0):
        third = (high - low) / 3.0
        u, its_u = low + third, high - third
        v, gap, _, _ = compare(pieces, one, other, u, whole[2] + rate * (u - whole[0]), desk)
        guess = whole[2] + rate * (its_u - whole[0])
        last, last_gap, _, _ = compare(pieces, one, other, its_u, guess, desk)
        low, high = (low, its_u) if gap <= last_gap else (u, high)
        if min(gap, last_gap) < least:
            best, foot, least = (u, v, gap) if gap <= last_gap else (its_u, last, last_gap)
    return best, foot, least


@compiled
def is_trivial(pieces: Pieces, curve: int, point: Array, desk: Desk) -> bool:
    """Tell whether a curve has not left a point [within 1e-6 m] between its two parameters."""
    for k in range(1, 8):
        u = point[0] + 0.125 * k * (point[1] - point[0])
        x, y, _, _ = point_at(pieces, curve, u, desk)
        if max(abs(x - point[2]), abs(y - point[3])) > _SHORTEST:
            return False
    return True
