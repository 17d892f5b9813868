"""Reads the file of a black box, with its times counted from the fleet's first GO.

A robot's program counts from the first GO that it hears.  If the robot joined later, or the fleet
had stood still meanwhile, that is another instant; the file ROBOT.csv.start holds it.

Decides: which instant a box counts from.  Must not know: what is in its rows besides times.
"""

from __future__ import annotations

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


def box_text(path: Path, start_ns: int | None) -> str:
    """Return a box's text with times from `start_ns` on, which is unknown if None.

    Raises InputError if the file cannot be read.
    """
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
