"""The workspace table of a scenario file: outlines, obstacles and the map, made into polygons.

Decides: which keys the table may have and how the polygons of a map and of the table are combined.
Must not know: map formats (scenario_files/maps/map_reader.py), ranges and geometry
(scenario/checks.py).  The result no longer depends on the map file: logs, plans and replays carry
the polygons.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Final, cast

import msgspec

from coordinator.base.errors import InputError
from coordinator.scenario.checks import LEAST, Quantity, printable, show
from coordinator.scenario.model import MapPart, Point, Workspace
from coordinator.scenario.obstacle_names import note_outside
from coordinator.scenario_files.maps.floor_map import FloorMap, MapOptions
from coordinator.scenario_files.table_reader import Table, read_place

OUTLINES: Final = ("bounds", "boundary")
MAP_QUANTITIES: Final = {
    "cell": Quantity("m", least=LEAST, from_least=True),
    "map_error": Quantity("m", from_least=True),
}
MAP_TEXTS: Final = ("layer", "boundary_layer")
KEYS: Final = (*OUTLINES, "obstacles", "map", *MAP_TEXTS, *MAP_QUANTITIES, "notes", "from_map")
MOST_NOTES: Final = 100


def read_workspace(value: object, folder: Path, problems: list[str]) -> Workspace:
    """Return the workspace that a table describes; the path of a map is relative to `folder`.

    Obstacles listed in the table come before those of the map.  One line for each problem, in the
    table or in the map file, is appended to `problems`.
    """
    table = Table(value, "workspace", KEYS, (), problems)
    given = table.values.keys()
    if given >= set(OUTLINES):
        problems.append("workspace: bounds and boundary are both given, only one may be")
    elif not {*OUTLINES, "map"} & (given | table.excused):
        problems.append("workspace: bounds or boundary is missing, the floor needs an outline")
    floor_map = _map(table, folder)
    boundary = floor_map.boundary
    if "boundary" in given:
        boundary = _polygon(table.values["boundary"], "workspace.boundary", problems)
    elif "bounds" in given:
        boundary = _box(table)
    obstacles = enumerate(table.items("obstacles", "polygons [[[x, y], ...], ...]"))
    polygons = tuple(_polygon(o, f"workspace.obstacles[{i}]", problems) for i, o in obstacles)
    part = _part(table)
    if floor_map.obstacles:
        part = MapPart(file=printable(Path(table.text("map")).name), first=len(polygons))
    every = (*polygons, *floor_map.obstacles)
    notes = (*_notes(table), floor_map.note, note_outside(boundary, every, part))
    return Workspace(
        boundary=boundary if _signed_area(boundary) >= 0.0 else (boundary[0], *boundary[:0:-1]),
        obstacles=every,
        notes=tuple(dict.fromkeys(filter(None, notes))),
        from_map=part,
    )


def _part(table: Table) -> MapPart | None:
    """Return which obstacles came from a map; only scenarios written by `run` have this entry."""
    if "from_map" not in table.values:
        return None
    try:
        part = msgspec.convert(table.values["from_map"], MapPart)
    except msgspec.ValidationError:
        part = MapPart(file="", first=-1)
    if part.first >= 0 and part.file.isprintable():
        return part
    table.note("from_map", "is not the name of a file and the index of its first obstacle")
    return None


def _map(table: Table, folder: Path) -> FloorMap:
    """Return the map that the table names; an empty one when there is none or it is unreadable."""
    nothing = FloorMap((), (), "")
    numbers = table.numbers(MAP_QUANTITIES)
    layer, boundary_layer = (table.text(key) for key in MAP_TEXTS)
    if "map" not in table.values:
        for key in [key for key in (*MAP_TEXTS, *MAP_QUANTITIES) if key in table.values]:
            table.note(key, "is for maps, and workspace.map is not given")
        return nothing
    name = table.text("map")
    if not name:
        return nothing
    sound = {key: number for key, number in numbers.items() if not math.isnan(number)}
    from coordinator.scenario_files.maps.map_reader import read_map

    try:
        found = read_map(folder / name, MapOptions(layer, boundary_layer, **sound))
    except InputError as error:
        for problem in error.problems:
            table.note("map", problem)
        return nothing
    # Polygons of another scale than the file wants would make further problems.
    return found if len(sound) == len(numbers) else nothing


def _notes(table: Table) -> tuple[str, ...]:
    """Return the notes made when a map was read; only scenarios written by `run` contain them."""
    notes = table.items("notes", "texts")[:MOST_NOTES]
    for index, note in enumerate(notes):
        if not isinstance(note, str) or not note.isprintable():
            table.note("notes", f"[{index}] is {show(note)}, not a text of one line")
            return ()
    return cast(tuple[str, ...], tuple(notes))


def _box(table: Table) -> tuple[Point, ...]:
    x0, y0, x1, y1 = table.place("bounds", 4)
    for axis, low, high in (("x", x0, x1), ("y", y0, y1)):
        if low >= high:
            table.note("bounds", f"{axis}0 = {low:g} m is not below {axis}1 = {high:g} m")
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1)) if x0 < x1 and y0 < y1 else ()


def _polygon(value: object, where: str, problems: list[str]) -> tuple[Point, ...]:
    """Return the corners without repetitions (nor a closing corner); empty if they are invalid."""
    if not isinstance(value, list):
        problems.append(f"{where}: {show(value)} is not a list of corners [[x, y], ...]")
        return ()
    corners = [
        read_place(corner, f"{where}[{i}]", (2,), problems) for i, corner in enumerate(value)
    ]
    if any(math.isnan(corner[0]) for corner in corners):
        return ()
    kept = [a for a, b in itertools.pairwise([*corners, *corners[:1]]) if a != b]
    if len(kept) < 3:
        problems.append(f"{where}: {len(kept)} different corners, a polygon needs at least 3")
        return ()
    return cast(tuple[Point, ...], tuple(kept))


def _signed_area(corners: Sequence[Point]) -> float:
    """Return twice the area [m^2], positive when the corners run counter-clockwise."""
    shifted = [(x - corners[0][0], y - corners[0][1]) for x, y in corners]
    return sum(a[0] * b[1] - b[0] * a[1] for a, b in itertools.pairwise(shifted))
