"""A warehouse: cargo shelves in rows and sorting tables, as in Fig. 4 of the paper.

Decides: where shelves and tables stand.  Robots go from a shelf to a table, or back.  Must not
know: which place at a shelf or table a robot gets.
"""

from __future__ import annotations

import math
from random import Random
from typing import Final

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
    whole,
)

BAY: Final = 0.9
"""Length [m] of one bay; the bays of a shelf share edges."""
DEPTH: Final = 0.8
TABLE: Final = 1.2
"""Side [m] of a sorting table."""
ROBOTS_A_TABLE: Final = 5
FEWEST_BAYS: Final = 3
BROKEN: Final = 0.3
"""Share of the shelves that lack a bay."""
BESIDE: Final = 0.75
"""Robots stop at `Wish.reach` from a shelf or table, or farther by up to this share of
`Wish.apart`.
"""


def warehouse(wish: Wish, dice: Random) -> Layout:
    """Return a floor with shelves on the left, tables on the right, and trips between the two."""
    size = wish.size_of(free=0.72)
    tables = _tables(wish, size)
    hall = min(table.x0 for table in tables) - wish.lane
    shelves = _shelves(wish, dice, hall, size[1])
    bays: list[Ring] = []
    for shelf in shelves:
        bays += _bays(dice, shelf)
    beside = wish.reach + BESIDE * wish.apart
    sides = [Box(x0, y0 - beside, x1, y0 - wish.reach) for x0, y0, x1, _ in shelves]
    sides += [Box(x0, y1 + wish.reach, x1, y1 + beside) for x0, _, x1, y1 in shelves]
    at_tables = Region(*(table.grown(beside) for table in tables))
    trip = Trip(Region(*(sides or [whole(size)])), at_tables)
    floor = floor_of(size, [*bays, *(table.ring for table in tables)])
    return Layout(floor, (trip, trip.back()), 0.7 * least_trip(size))


def _tables(wish: Wish, size: Size) -> list[Box]:
    """Return the sorting tables in columns from the right, spaced evenly over the height."""
    count = max(1, round(wish.robots / ROBOTS_A_TABLE))
    pitch = TABLE + 1.5 * wish.lane
    a_column = max(1, min(count, int(size[1] / pitch)))
    columns = math.ceil(count / a_column)
    tables = []
    for index in range(count):
        column, row = divmod(index, a_column)
        rows = min(a_column, count - column * a_column)
        x = size[0] - (column + 0.5) * pitch - TABLE / 2.0
        y = (row + 0.5) * size[1] / rows - TABLE / 2.0
        tables.append(Box(x, y, x + TABLE, y + TABLE))
    return tables if columns * pitch < size[0] else tables[:1]


def _shelves(wish: Wish, dice: Random, width: float, height: float) -> list[Box]:
    """Return the shelves, each of three bays or more, with a lane around each."""
    columns = max(0, int(width / (FEWEST_BAYS * BAY + wish.lane)))
    rows = max(0, int((height - wish.lane) / (DEPTH + wish.lane)))
    sites = [(column, row) for column in range(columns) for row in range(rows)]
    count = wish.chosen("shelves", len(sites), len(sites))
    shelves = []
    for column, row in sorted(dice.sample(sites, count)):
        across, up = width / columns, (height - wish.lane) / rows
        x0, y0 = column * across + wish.lane, wish.lane + row * up
        bays = int((across - wish.lane) / BAY + 1e-9)
        y0 += (up - wish.lane - DEPTH) / 2.0
        shelves.append(Box(x0, y0, x0 + bays * BAY, y0 + DEPTH))
    return shelves


def _bays(dice: Random, shelf: Box) -> list[Ring]:
    """Return the bays of a shelf; some shelves lack one."""
    count = round((shelf.x1 - shelf.x0) / BAY)
    lacking = dice.randrange(count) if dice.random() < BROKEN else count
    starts = [shelf.x0 + bay * BAY for bay in range(count) if bay != lacking]
    return [Box(x, shelf.y0, x + BAY, shelf.y1).ring for x in starts]
