"""The arguments and results that all map readers share, and how they open files.

Decides: the form of a map once it has been read, the sentence that reports how exact it is, and
which files are opened at all.  Must not know: any format.
"""

from __future__ import annotations

import math
import stat
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from coordinator.base.errors import InputError
from coordinator.scenario.checks import printable
from coordinator.scenario.model import Point


class FloorMap(NamedTuple):
    """A map as polygons [m]: the floor's outline, counter-clockwise, and what stands on it.

    Obstacles are simple polygons without holes; they may touch and overlap.  `note` is one
    sentence for the report: what was read and by how much obstacles were enlarged.
    """

    boundary: tuple[Point, ...]
    obstacles: tuple[tuple[Point, ...], ...]
    note: str


class MapOptions(NamedTuple):
    """What a scenario says about its map; "" and None mean the default of the format.

    `layer`, `boundary_layer`: layers of a drawing; `cell`: size of a cell [m] if the file does
    not state it; `map_error`: how far [m] obstacles may be enlarged to save corners.
    """

    layer: str = ""
    boundary_layer: str = ""
    cell: float | None = None
    map_error: float | None = None


def describe(path: Path, what: str, obstacles: Sequence[Sequence[Point]], growth: float) -> str:
    """Return the note about a map; `growth` [m] is reported rounded up to 0.1 mm."""
    corners = sum(map(len, obstacles))
    added = f"at most {math.ceil(growth * 1e4) / 1e4:g} m added" if growth > 0.0 else "none added"
    return (
        f"map {printable(path.name)}: {what}, {len(obstacles)} obstacles with {corners} corners, "
        f"nothing uncovered, {added}"
    )


def fail(path: Path, problems: Iterable[str]) -> InputError:
    """Return the error for what is wrong with a file, one line each."""
    return InputError([f"{printable(path.name or str(path))}: {problem}" for problem in problems])


def check_file(path: Path, most: int) -> None:
    """Raise InputError unless the path leads to a regular file of at most `most` bytes."""
    try:
        status = path.stat()
    except (OSError, ValueError) as error:
        raise fail(path, [_reason(error)]) from None
    if not stat.S_ISREG(status.st_mode):
        raise fail(path, ["is not a file"])
    if status.st_size > most:
        raise fail(path, [f"{status.st_size} bytes are more than {most}"])


def read_bytes(path: Path, most: int) -> bytes:
    """Read a regular file of at most `most` bytes; raises InputError if that is impossible."""
    check_file(path, most)
    try:
        return path.read_bytes()
    except OSError as error:
        raise fail(path, [_reason(error)]) from None


def _reason(error: OSError | ValueError) -> str:
    return getattr(error, "strerror", None) or "is not the name of a file"
