"""Reads the file of a black box, with its times counted from the fleet's first GO.

A robot's program counts from the first GO that it hears.  If the robot joined later, or the fleet
had stood still meanwhile, that is another instant; the file ROBOT.csv.start holds it.  A program
that was started again when another coordinator led has kept the box so far as ROBOT.csv.1,
ROBOT.csv.2, ...

Decides: which instant a box counts from, and which files belong to one run.  Must not know: what is
in its rows besides times.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from functools import reduce
from itertools import count, takewhile
from pathlib import Path
from typing import Final

from coordinator.base.errors import InputError
from protocol.timing import SECOND

_T: Final = 0
_ESTIMATE: Final = 6


def start_of_box(path: Path) -> int | None:
    """Return the start [ns] that a box counts from; None if it is not known."""
    try:
        began = path.with_name(f"{path.name}.start").read_text(encoding="ascii").split()
        return int(began[-1])
    except (OSError, ValueError, IndexError):
        return None


def boxes_of_run(path: Path, starts: Collection[int]) -> list[Path]:
    """Return the files of a robot's box that are of a run, the oldest first.

    starts: every time zero [ns] of the run; if none is known, the newest file is taken to be of it.
    So is one whose start is not known.
    """
    kept = (path.with_name(f"{path.name}.{number}") for number in count(1))
    every = [*takewhile(Path.is_file, kept), path]
    if not starts or start_of_box(path) is None:
        return [path]
    return [one for one in every if start_of_box(one) in starts]


def box_text(path: Path, start_ns: int | None, earlier: Sequence[Path] = ()) -> str:
    """Return a box's text with times from `start_ns` on, which is unknown if None.

    earlier: its files before this one, the oldest first.  Raises InputError if one cannot be read.
    """
    return reduce(_joined, (_one_text(one, start_ns) for one in (*earlier, path)))


def _joined(before: str, text: str) -> str:
    """Return a text with the rows of an earlier one first, if they are all from before it."""
    head, *rows = text.splitlines(keepends=True)
    earlier = before[: before.rfind("\n") + 1].splitlines(keepends=True)
    if earlier[:1] != [head]:
        return text
    if rows and earlier[1:] and not _time(earlier[-1]) <= _time(rows[0]):
        return text
    return "".join([*earlier, *rows])


def _time(row: str) -> float:
    try:
        return float(row.split(",")[_T])
    except ValueError:
        return math.nan


def _one_text(path: Path, start_ns: int | None) -> str:
    """Return the text of one file, with times from `start_ns` on."""
    try:
        text = path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError([f"{path}: {error}"]) from None
    own_ns = start_of_box(path)
    if start_ns is None or own_ns is None or own_ns == start_ns:
        return text
    head, *rows = text.splitlines(keepends=True)
    later = (own_ns - start_ns) / SECOND
    return "".join([head, *(_later(row, later) for row in rows)])


def _later(row: str, later: float) -> str:
    """Return a row with its times moved; a row that is no row of numbers stays as it is."""
    cells = row.rstrip("\n").split(",")
    try:
        for cell in (_T, _ESTIMATE):
            if cells[cell : cell + 1] not in ([], [""]):
                cells[cell] = f"{float(cells[cell]) + later:.6f}"
    except ValueError:
        return row
    return ",".join(cells) + row[len(row.rstrip("\n")) :]
