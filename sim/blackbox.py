"""Reading the robots' black boxes: where each robot truly was.

Decides: what a black box file may hold.  Must not know: plans.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from coordinator.errors import InputError
from coordinator.nurbs import Array

COLUMNS: Final = ("t", "x", "y", "heading", "s", "phase")


@dataclass(frozen=True, eq=False)
class BlackBox:
    """One robot's recording: t (n,) [s since GO], places (n, 2) [m], s (n,) [m], phases (n)."""

    t: Array
    places: Array
    s: Array
    phases: tuple[str, ...]

    def at(self, time: Array) -> Array:
        """Return the places (m, 2) at times (m,): linear between rows, at rest outside of them."""
        return np.column_stack([np.interp(time, self.t, self.places[:, i]) for i in (0, 1)])

    def between(self, begin: float, end: float, zero: float) -> BlackBox:
        """Return the rows from `begin` to before `end`, with times counted from `zero`."""
        kept = (self.t >= begin) & (self.t < end)
        phases = tuple(p for p, keep in zip(self.phases, kept.tolist(), strict=True) if keep)
        return BlackBox(self.t[kept] - zero, self.places[kept], self.s[kept], phases)


def read_blackbox(path: Path) -> BlackBox:
    """Read a black box; a last line cut short by a kill is left out.

    Raises InputError naming the file and the line.
    """
    try:
        text = path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError([f"{path}: {error}"]) from None
    table, phases = parse_blackbox(text, str(path))
    return BlackBox(table[:, 0], table[:, 1:3], table[:, 4], phases)


def parse_blackbox(text: str, path: str) -> tuple[Array, tuple[str, ...]]:
    """Return the numbers of a black box's rows, (n, 5): t, x, y, heading, s, and their phases.

    Raises InputError naming the line of `path`.
    """
    rows = list(csv.reader(text.splitlines()))
    if not rows or tuple(rows[0]) != COLUMNS:
        raise InputError([f"{path}: line 1: the columns are not {','.join(COLUMNS)}"])
    numbers, phases = [], []
    for line, row in enumerate(rows[1:], start=2):
        try:
            values = [float(value) for value in row[:5]]
            if len(row) != len(COLUMNS) or not np.isfinite(values).all():
                raise ValueError
        except ValueError:
            if line == len(rows):
                break
            raise InputError(
                [f"{path}: line {line}: is not a row of numbers and a phase"]
            ) from None
        numbers.append(values)
        phases.append(row[5])
    table = np.array(numbers).reshape(-1, 5)
    if np.any(np.diff(table[:, 0]) < 0.0):
        raise InputError([f"{path}: time runs backwards"])
    return table, tuple(phases)
