"""Maps and agents of the kinds and sizes of MovingAI's multi-agent benchmark, drawn from a seed.

The names are those of the benchmark's maps whose kind and size a map has; the maps differ.

Decides: where cells are blocked and agents start and end.  Must not know: how they are planned.
"""

from __future__ import annotations

from collections import deque
from random import Random
from typing import Final

Rows = list[list[bool]]
"""Which cells block, from the top row down."""
Cell = tuple[int, int]
"""Column and row, from the top left."""

NAMES: Final = ("random-32-32-20", "room-32-32-4", "maze-32-32-2", "warehouse-10-20-10-2-1")
_BLOCKED: Final = 0.2
_DOORS: Final = 0.9
"""The share of walls with a door between rooms, beside those that connect all rooms."""


def drawn(name: str, agents: int, seed: int) -> tuple[str, str]:
    """Return the text of a .map and a .scen file; starts differ from each other, and so do goals.

    All agents are on the largest part of the map that is connected.
    """
    dice = Random(f"{name}-{seed}")
    rows = {
        "random-32-32-20": lambda: _random(dice),
        "room-32-32-4": lambda: _rooms(3, _DOORS, 1, dice),
        "maze-32-32-2": lambda: _rooms(2, 0.0, 2, dice),
        "warehouse-10-20-10-2-1": _warehouse,
    }[name]()
    height, width = len(rows), len(rows[0])
    cells = "\n".join("".join("@" if blocked else "." for blocked in row) for row in rows)
    floor = _largest_part(rows)
    starts, goals = dice.sample(floor, agents), dice.sample(floor, agents)
    lines = ["version 1"]
    for start, goal in zip(starts, goals, strict=True):
        far = _steps_from(start, rows)[goal]
        fields = (far // 4, f"{name}.map", width, height, *start, *goal, far)
        lines.append("\t".join(map(str, fields)))
    return f"type octile\nheight {height}\nwidth {width}\nmap\n{cells}\n", "\n".join(lines) + "\n"


def _random(dice: Random) -> Rows:
    size = 32
    blocked = set(dice.sample(range(size * size), int(_BLOCKED * size * size)))
    return [[size * y + x in blocked for x in range(size)] for y in range(size)]


def _rooms(side: int, share: float, door: int, dice: Random) -> Rows:
    """Return rooms with walls of one cell; doors connect all, and a share of other neighbours."""
    size = 32
    count = (size + side) // (side + 1)
    rows = [[side in (x % (side + 1), y % (side + 1)) for x in range(size)] for y in range(size)]
    walls = [((x, y), (x + 1, y)) for y in range(count) for x in range(count - 1)]
    walls += [((x, y), (x, y + 1)) for y in range(count - 1) for x in range(count)]
    dice.shuffle(walls)
    part = {(x, y): (x, y) for x in range(count) for y in range(count)}
    for (x, y), there in walls:
        one, other = part[x, y], part[there]
        if one == other and dice.random() >= share:
            continue
        part = {room: one if of == other else of for room, of in part.items()}
        begin = dice.randrange(side - door + 1)
        for k in range(begin, begin + door):
            across = there[0] > x
            column = x * (side + 1) + (side if across else k)
            row = y * (side + 1) + (k if across else side)
            rows[min(row, size - 1)][min(column, size - 1)] = False
    return rows


def _warehouse() -> Rows:
    """Return 20 rows of 10 shelves of 10 by 2 cells, aisles of one cell, and room beside them."""
    width, height = 161, 63
    rows = [[y in (0, 62) or x in (0, 160) for x in range(width)] for y in range(height)]
    for row in range(20):
        for column in range(10):
            for y in range(2 + 3 * row, 4 + 3 * row):
                for x in range(26 + 11 * column, 36 + 11 * column):
                    rows[y][x] = True
    return rows


def _largest_part(rows: Rows) -> list[Cell]:
    """Return the cells of the largest connected part."""
    left = {(x, y) for y, row in enumerate(rows) for x, wall in enumerate(row) if not wall}
    parts: list[dict[Cell, int]] = []
    while left:
        parts.append(_steps_from(min(left), rows))
        left -= parts[-1].keys()
    sizes = [len(part) for part in parts]
    return sorted(parts[sizes.index(max(sizes))])


def _steps_from(start: Cell, rows: Rows) -> dict[Cell, int]:
    """Return how many steps to a neighbouring cell it takes to get to each cell."""
    steps, queue = {start: 0}, deque([start])
    while queue:
        x, y = here = queue.popleft()
        for there in ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)):
            free = 0 <= there[1] < len(rows) and 0 <= there[0] < len(rows[0])
            if free and there not in steps and not rows[there[1]][there[0]]:
                steps[there] = steps[here] + 1
                queue.append(there)
    return steps
