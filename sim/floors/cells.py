"""Floors made of cells: mazes, rooms with doors, grids with blocked cells.

Decides: which neighbouring cells are connected, and the walls between the others.  Must not know:
which robots start or end in a cell.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
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

THICK: Final = 0.2
"""Thickness [m] of a wall."""
LOOPS: Final = 0.12
"""Share of a perfect maze's walls that are opened, which makes loops."""
SECOND_DOORS: Final = 0.5
"""Share of the walls between rooms that get a door although all rooms are connected already."""
ROOM: Final = 3.6
"""Usual side [m] of a room."""
FEW_ROOMS: Final = 12
"""A trip leads from one of at most this many rooms to one of equally many other rooms."""
BLOCKED: Final = 0.22
"""Share of a grid's cells that are blocked."""

Cell = tuple[int, int]
Side = tuple[Cell, Cell]
"""Two neighbouring cells, (column, row): the left or lower one first."""


def maze(wish: Wish, dice: Random) -> Layout:
    """Return a maze: a perfect one with some more walls opened, so that it has loops."""
    width, height = size = wish.size_of(free=0.88)
    columns, rows = _counts(size, 1.1 * wish.lane + THICK)
    joined = _joined(columns, rows, LOOPS, dice)
    across, up = width / columns, height / rows
    walls: list[Ring] = []
    for column in range(1, columns):
        closed = [((column - 1, row), (column, row)) not in joined for row in range(rows)]
        walls += [
            _wall(size, column * across, y0 * up, column * across, y1 * up)
            for y0, y1 in _runs(closed)
        ]
    for row in range(1, rows):
        closed = [((column, row - 1), (column, row)) not in joined for column in range(columns)]
        walls += [
            _wall(size, x0 * across, row * up, x1 * across, row * up) for x0, x1 in _runs(closed)
        ]
    anywhere = Region(whole(size))
    return Layout(floor_of(size, walls), (Trip(anywhere, anywhere),), least_trip(size))


def rooms(wish: Wish, dice: Random) -> Layout:
    """Return rooms in rows, with doors between neighbours; some walls have no door."""
    width, height = size = wish.size_of(free=0.88)
    columns, rows = _counts(size, max(ROOM, 2.0 * wish.lane))
    joined = _joined(columns, rows, SECOND_DOORS, dice)
    across, up = width / columns, height / rows
    walls: list[Ring] = []
    for side in _sides(columns, rows):
        (column, row), (other, _) = side
        upright = other > column
        length = up if upright else across
        doors = [_door(wish, dice, length)] if side in joined else []
        x, y = (column + upright) * across, (row + (not upright)) * up
        for begin, end in _closed(length, doors):
            if upright:
                walls.append(_wall(size, x, y + begin, x, y + end))
            else:
                walls.append(_wall(size, x + begin, y, x + end, y))
    inside = [
        Box(column * across, row * up, (column + 1) * across, (row + 1) * up).grown(-THICK)
        for column in range(columns)
        for row in range(rows)
    ]
    dice.shuffle(inside)
    few = max(1, min(len(inside) // 2, FEW_ROOMS))
    around = inside * 3
    trips = tuple(
        Trip(Region(*around[at : at + few]), Region(*around[at + few : at + 2 * few]))
        for at in range(len(inside))
    )
    return Layout(floor_of(size, walls), trips, 0.5 * least_trip(size))


def grid(wish: Wish, dice: Random) -> Layout:
    """Return a grid of cells of which some are blocked.

    Blocked cells are rectangular obstacles; neighbouring ones share an edge or a corner.
    """
    width, height = size = wish.size_of(free=0.75)
    columns, rows = _counts(size, wish.door + 0.3)
    cells = [(column, row) for column in range(columns) for row in range(rows)]
    count = wish.chosen("blocked cells", round(BLOCKED * len(cells)), len(cells))
    across, up = width / columns, height / rows
    squares = [
        Box(column * across, row * up, (column + 1) * across, (row + 1) * up).ring
        for column, row in sorted(dice.sample(cells, count))
    ]
    anywhere = Region(whole(size))
    return Layout(floor_of(size, squares), (Trip(anywhere, anywhere),), least_trip(size))


def _counts(size: Size, side: float) -> tuple[int, int]:
    """Return the most columns and rows whose cells have at least this side [m]."""
    return max(1, int(size[0] / side)), max(1, int(size[1] / side))


def _sides(columns: int, rows: int) -> list[Side]:
    upright = [((c, r), (c + 1, r)) for c in range(columns - 1) for r in range(rows)]
    return upright + [((c, r), (c, r + 1)) for c in range(columns) for r in range(rows - 1)]


def _joined(columns: int, rows: int, extra: float, dice: Random) -> set[Side]:
    """Return the open sides: those of a random spanning tree, and a share `extra` of the others.

    The tree is found by a depth-first search.
    """
    here = dice.randrange(columns), dice.randrange(rows)
    seen, trail = {here}, [here]
    joined: set[Side] = set()
    while trail:
        here = trail[-1]
        near = [
            (here[0] + x, here[1] + y)
            for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1))
            if 0 <= here[0] + x < columns and 0 <= here[1] + y < rows
        ]
        fresh = [cell for cell in near if cell not in seen]
        if not fresh:
            trail.pop()
            continue
        there = dice.choice(fresh)
        joined.add((min(here, there), max(here, there)))
        seen.add(there)
        trail.append(there)
    shut = [side for side in _sides(columns, rows) if side not in joined]
    return joined | set(dice.sample(shut, round(extra * len(shut))))


def _runs(closed: Iterable[bool]) -> Iterator[tuple[int, int]]:
    """Yield begin and end of each stretch of closed sides."""
    for shut, stretch in itertools.groupby(enumerate(closed), key=lambda item: item[1]):
        places = [place for place, _ in stretch]
        if shut:
            yield places[0], places[-1] + 1


def _door(wish: Wish, dice: Random, length: float) -> tuple[float, float]:
    """Return begin and end [m] of a door in a wall of this length."""
    width = min(dice.uniform(wish.door, 0.8 * wish.lane), length - 2.0 * THICK)
    begin = dice.uniform(THICK, length - THICK - width)
    return begin, begin + width


def _closed(length: float, doors: Iterable[tuple[float, float]]) -> Iterator[tuple[float, float]]:
    """Yield begin and end [m] of the pieces of a wall between its doors."""
    begin = 0.0
    for door_begin, door_end in doors:
        yield begin, door_begin
        begin = door_end
    yield begin, length


def _wall(size: Size, x0: float, y0: float, x1: float, y1: float) -> Ring:
    """Return a wall along a line, extended by half its thickness on all sides, within the floor."""
    wall = Box(x0, y0, x1, y1).grown(THICK / 2.0)
    return Box(
        max(wall.x0, 0.0), max(wall.y0, 0.0), min(wall.x1, size[0]), min(wall.y1, size[1])
    ).ring
