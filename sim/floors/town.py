"""Open floors: empty ones, and towns with blocks of buildings.

Decides: where blocks stand and which sides of the town robots come from.  Must not know: the
places that robots get.
"""

from __future__ import annotations

from random import Random
from typing import Final

from sim.floors.layout import Box, Layout, Region, Trip, Wish, floor_of, least_trip, whole

EDGE: Final = 0.2
"""Share of the floor, on each side, where robots of a town start and end."""
BLOCK: Final = 1.2
BLOCK_SHARE: Final = 0.1
"""A plot, without its street, has at least the side BLOCK [m] and BLOCK_SHARE of the floor's
height."""
BUILT: Final = 0.75
"""Share of the plots that are built on."""


def empty(wish: Wish, dice: Random) -> Layout:  # noqa: ARG001
    """Return an empty floor: robots go from anywhere to anywhere."""
    size = wish.size_of(free=1.0)
    anywhere = Region(whole(size))
    return Layout(floor_of(size), (Trip(anywhere, anywhere),), least_trip(size))


def cross_town(wish: Wish, dice: Random) -> Layout:
    """Return a town in which robots go from each of the four sides to the opposite side."""
    width, height = size = wish.size_of(free=0.75)
    inside = Box(EDGE * width, EDGE * height, (1 - EDGE) * width, (1 - EDGE) * height)
    plot = max(BLOCK, BLOCK_SHARE * height) + wish.lane
    columns = int((inside.x1 - inside.x0) / plot)
    rows = int((inside.y1 - inside.y0) / plot)
    plots = [(column, row) for column in range(columns) for row in range(rows)]
    count = wish.chosen("blocks", round(BUILT * len(plots)), len(plots))
    blocks = []
    for column, row in sorted(dice.sample(plots, count)):
        across, up = (inside.x1 - inside.x0) / columns, (inside.y1 - inside.y0) / rows
        x0, y0 = inside.x0 + column * across, inside.y0 + row * up
        wide = dice.uniform(0.6, 1.0) * (across - wish.lane)
        high = dice.uniform(0.6, 1.0) * (up - wish.lane)
        x0 += dice.uniform(0.0, across - wide - wish.lane) + wish.lane / 2.0
        y0 += dice.uniform(0.0, up - high - wish.lane) + wish.lane / 2.0
        blocks.append(Box(x0, y0, x0 + wide, y0 + high).ring)
    west = Region(Box(0.0, 0.0, inside.x0, height))
    east = Region(Box(inside.x1, 0.0, width, height))
    south = Region(Box(0.0, 0.0, width, inside.y0))
    north = Region(Box(0.0, inside.y1, width, height))
    along, up_town = Trip(west, east), Trip(south, north)
    trips = (along, up_town, along.back(), up_town.back())
    return Layout(floor_of(size, blocks), trips, least_trip(size))
