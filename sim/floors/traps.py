"""Floors of U-shaped obstacles that open towards the robots: Fig. 5 of the paper, many times.

Decides: where the traps stand and to which side they open.  Must not know: how robots get out.
"""

from __future__ import annotations

import math
from random import Random
from typing import Final

from coordinator.scenario.model import Point
from sim.floors.layout import (
    Box,
    Layout,
    Region,
    Ring,
    Size,
    Trip,
    Wish,
    floor_of,
    least_trip,
    millimetres,
)

THICK: Final = 0.3
"""Thickness [m] of a trap's walls."""
BAND: Final = 0.22
"""Share of the floor's width, on each side, where robots start and end."""
TILT: Final = 0.25
"""A trap is turned by at most this angle [rad]."""
IN_TRAPS: Final = 4
"""About one in this many robots starts inside a trap."""


def u_traps(wish: Wish, dice: Random) -> Layout:
    """Return traps between two bands; their columns open alternately to the left and to the right.

    Robots cross from band to band, each facing traps that open towards it; some start in one.
    """
    width, height = size = wish.size_of(free=0.85)
    band = BAND * width
    pitch = wish.lane + wish.door + 2.0 * THICK + 0.5
    columns = int((width - 2.0 * band) / pitch)
    rows = int((height - wish.door) / pitch)
    sites = [(column, row) for column in range(columns) for row in range(rows)]
    count = wish.chosen("traps", len(sites), len(sites))
    across, up = (width - 2.0 * band) / max(1, columns), (height - wish.door) / max(1, rows)
    shapes: list[Ring] = []
    insides: tuple[list[Box], list[Box]] = ([], [])
    for column, row in sorted(dice.sample(sites, count)):
        middle = band + (column + 0.5) * across, 0.5 * wish.door + (row + 0.5) * up
        opening = column % 2 if columns > 1 else row % 2
        ring, inside = _trap(wish, dice, middle, (across, up), leftwards=not opening)
        shapes.append(ring)
        insides[opening].append(inside)
    west = Region(Box(0.0, 0.0, band, height))
    east = Region(Box(width - band, 0.0, width, height))
    eastward, westward = Trip(west, east), Trip(east, west)
    trips = [eastward, westward] * math.ceil(wish.robots / 2)
    for index, boxes in enumerate(insides):
        dice.shuffle(boxes)
        for turn, box in enumerate(boxes[: wish.robots // (2 * IN_TRAPS) + 1]):
            at = 2 * (turn * IN_TRAPS + 1) + index
            if at < wish.robots:
                trips[at] = Trip(Region(box), trips[at].goals)
    return Layout(floor_of(size, shapes), tuple(trips), 0.5 * least_trip(size))


def _trap(wish: Wish, dice: Random, middle: Point, plot: Size, leftwards: bool) -> tuple[Ring, Box]:
    """Return a U-shaped obstacle with a door's width free around it, and the box inside it."""
    tilt = dice.uniform(-TILT, TILT)
    upright, slanting = math.cos(tilt), abs(math.sin(tilt))
    wide, high = dice.uniform(0.85, 1.2) * min(plot), min(plot)
    fit = min(
        (plot[0] - wish.door) / (wide * upright + high * slanting),
        (plot[1] - wish.door) / (wide * slanting + high * upright),
    )
    x, y = fit * wide / 2.0, fit * high / 2.0
    inner, back = y - THICK, x - THICK
    corners = [(-x, -y), (x, -y), (x, y), (-x, y)]
    corners += [(-x, inner), (back, inner), (back, -inner), (-x, -inner)]
    side = 1.0 if leftwards else -1.0
    turned = [
        (
            middle[0] + side * (a * math.cos(tilt) - b * math.sin(tilt)),
            middle[1] + a * math.sin(tilt) + b * math.cos(tilt),
        )
        for a, b in corners
    ]
    return millimetres(turned), Box(*middle, *middle).grown(0.6 * min(x, y))
