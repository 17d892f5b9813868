"""MovingAI grid maps (`type octile`) as polygons.

Decides: which characters block, and the wording of each fault.  Must not know: how cells become
polygons.  Format: https://movingai.com/benchmarks/formats.html.  The first line of cells is the top
row.  Swamp can be entered from ordinary ground, water cannot.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import numpy as np

from coordinator.scenario.checks import FARTHEST, show
from coordinator.scenario_files.maps.cells import MOST_CELLS, Cells, Grid, TooManyCornersError
from coordinator.scenario_files.maps.floor_map import (
    FloorMap,
    MapOptions,
    describe,
    fail,
    read_bytes,
)

FREE: Final = b".GS"
BLOCKED: Final = b"@OTW"
MOST_FAULTS: Final = 20
"""At most this many faults are listed one by one."""
_SIZE: Final = re.compile(rb"(height|width)\s+(\d{1,9})")
_BAD: Final = re.compile(rb"[^.GS@OTW]")


def read_movingai_map(path: Path, options: MapOptions) -> FloorMap:
    """Read a .map file; cells are 1 m wide and outlines exact unless the options say otherwise.

    Raises InputError with every problem, as `FILE: line, column: what is wrong`.
    """
    grid = read_movingai_grid(path, 1.0 if options.cell is None else options.cell)
    return floor_map_of(path, grid, options.map_error or 0.0)


def floor_map_of(path: Path, grid: Grid, map_error: float) -> FloorMap:
    """Return the cells of a .map file as polygons that are grown by up to `map_error` [m]."""
    height, width = grid.occupied.shape
    try:
        obstacles, growth = grid.obstacles(map_error)
    except TooManyCornersError as error:
        raise fail(path, [str(error)]) from None
    what = f"{width} x {height} cells of {grid.cell:g} m"
    return FloorMap(grid.boundary(), obstacles, describe(path, what, obstacles, growth))


def read_movingai_grid(path: Path, cell: float) -> Grid:
    """Read the cells of a .map file, which are `cell` [m] wide; raises as read_movingai_map."""
    lines = read_bytes(path, 2 * MOST_CELLS).replace(b"\r\n", b"\n").split(b"\n")
    problems: list[str] = []
    height, width = _sizes(lines, problems)
    if problems:
        raise fail(path, problems)
    rows = lines[4 : 4 + height]
    problems += _row_faults(rows, lines[4 + height :], height, width)
    if max(height, width) * cell > FARTHEST:
        reach = f"{max(height, width) * cell:g} m wide with cells of {cell:g} m"
        problems.append(f"the map is {reach}, at most {FARTHEST:g} m are allowed")
    if problems:
        raise fail(path, problems)
    return Grid(_cells(rows, height, width), cell)


def _sizes(lines: list[bytes], problems: list[str]) -> tuple[int, int]:
    """Return height and width from the four lines of the head."""
    head = [line.strip() for line in lines[:4]] + [b""] * (4 - len(lines))
    found = [match for line in head[1:3] if (match := _SIZE.fullmatch(line))]
    sizes: dict[bytes, bytes] = {match[1]: match[2] for match in found}
    expected = ["type octile", "height N", "width N", "map"]
    sound = [head[0] == b"type octile", b"height" in sizes, b"width" in sizes, head[3] == b"map"]
    for number, (text, line) in enumerate(zip(expected, head, strict=True), start=1):
        if not sound[number - 1]:
            problems.append(f"line {number}: {show(_text(line))} is not '{text}'")
    height, width = (int(sizes.get(key, 1)) for key in (b"height", b"width"))
    if height == 0 or width == 0:
        problems.append(f"line 2: {width} x {height} cells are not a map")
    elif height * width > MOST_CELLS:
        problems.append(f"line 2: {width} x {height} cells are more than {MOST_CELLS}")
    return height, width


def _row_faults(rows: list[bytes], rest: list[bytes], height: int, width: int) -> list[str]:
    faults = []
    for number, row in enumerate(rows, start=5):
        for bad in _BAD.finditer(row[:width]):
            char = show(_text(bad[0]))
            faults.append(
                f"line {number}, column {bad.start() + 1}: {char} is not one of . G S @ O T W"
            )
        if len(row.rstrip()) != width and (len(row) < width or row[width:].strip()):
            faults.append(f"line {number}: {len(row)} cells, but the width is {width}")
    if len(rows) < height:
        faults.append(f"line {4 + len(rows)}: the file ends after {len(rows)} of {height} rows")
    for number, line in enumerate(rest, start=5 + height):
        if line.strip():
            faults.append(f"line {number}: {show(_text(line))} comes after the last row")
    if len(faults) > MOST_FAULTS:
        faults[MOST_FAULTS:] = [f"and {len(faults) - MOST_FAULTS} more faults of this kind"]
    return faults


def _cells(rows: list[bytes], height: int, width: int) -> Cells:
    """Return which cells block, lowest row first."""
    table = np.zeros(256, np.bool_)
    table[list(BLOCKED)] = True
    text = b"".join(row[:width] for row in rows)
    return table[np.frombuffer(text, np.uint8).reshape(height, width)][::-1]


def _text(line: bytes) -> str:
    return line[:60].decode("ascii", "backslashreplace")
