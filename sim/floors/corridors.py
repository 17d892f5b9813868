"""Long corridors: walls from side to side of the floor, each with a few gaps.

Decides: where walls run and where they have gaps.  Must not know: which robots pass through.
"""

from __future__ import annotations

from random import Random
from typing import Final

from sim.floors.layout import (
    Box,
    Layout,
    Region,
    Ring,
    Trip,
    Wish,
    floor_of,
    least_trip,
    millimetres,
)

THICK: Final = 0.2
"""Thickness [m] of a wall."""
GAP_EVERY: Final = 7.0
"""Usual distance [m] between the gaps of a wall."""
SLANT: Final = 0.12
"""Each end of a wall lies up to this share of a corridor's width off its line."""


def corridors(wish: Wish, dice: Random) -> Layout:
    """Return long, slightly slanting walls with gaps; every trip leads through one at least."""
    width, height = size = wish.size_of(free=0.9)
    most = max(0, int(height / (1.4 * wish.lane + THICK)) - 1)
    count = wish.chosen("walls", most, most)
    pitch = height / (count + 1)
    walls: list[Ring] = []
    for wall in range(1, count + 1):
        left, right = (pitch * (wall + dice.uniform(-SLANT, SLANT)) for _ in range(2))
        walls += [
            _piece(x0, x1, left, (right - left) / width)
            for x0, x1 in _between_gaps(wish, dice, width)
        ]
    strips = [Box(0.0, row * pitch, width, (row + 1) * pitch) for row in range(count + 1)]
    trips = [
        Trip(Region(strip), Region(*(other for other in strips if other != strip or not count)))
        for strip in strips
    ]
    dice.shuffle(trips)
    return Layout(floor_of(size, walls), tuple(trips), 0.7 * least_trip(size))


def _between_gaps(wish: Wish, dice: Random, width: float) -> list[tuple[float, float]]:
    """Return begin and end [m] of the closed pieces along a wall."""
    slots = max(1, round(width / GAP_EVERY))
    ends = [0.0]
    for slot in range(slots):
        gap = min(dice.uniform(wish.door, wish.lane), 0.8 * width / slots)
        begin = slot * width / slots + dice.uniform(0.0, width / slots - gap)
        ends += [begin, begin + gap]
    closed = zip(ends[::2], [*ends[1::2], width], strict=True)
    return [(x0, x1) for x0, x1 in closed if x1 - x0 >= THICK]


def _piece(x0: float, x1: float, left: float, slope: float) -> Ring:
    """Return a piece of a wall whose middle is at the height `left` [m] at x = 0."""
    y0, y1 = left + slope * x0, left + slope * x1
    half = THICK / 2.0
    return millimetres(((x0, y0 - half), (x1, y1 - half), (x1, y1 + half), (x0, y0 + half)))
