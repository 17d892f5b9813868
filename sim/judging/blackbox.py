"""The robots' black boxes: where each robot truly was, and its estimates of the time.

Decides: what a black box file may hold.  Must not know: plans.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from coordinator.base.errors import InputError
from coordinator.curves.nurbs import Array
from coordinator.log.box_file import box_text

COLUMNS: Final = ("t", "x", "y", "heading", "s", "phase", "estimate")
_OLDER: Final = COLUMNS[:-1]
"""The columns of older programs, which wrote no estimate; their boxes can still be read."""

Row = tuple[float, float, float, float, float, str, float | None]
"""The values of COLUMNS in a row; an unknown estimate is None."""


@dataclass(frozen=True, eq=False)
class BlackBox:
    """One robot's recording: t (n,) [s since GO], places (n, 2) [m], s (n,) [m], phases (n).

    estimates (n,) [s]: the robot's own estimate of the time t, nan where it is not recorded.  If no
    row has an estimate, t may be the estimate itself.
    """

    t: Array
    places: Array
    s: Array
    phases: tuple[str, ...]
    estimates: Array | None = None

    def at(self, time: Array) -> Array:
        """Return the places (m, 2) at times (m,): linear between rows, constant outside of them."""
        return np.column_stack([np.interp(time, self.t, self.places[:, i]) for i in (0, 1)])

    def between(self, begin: float, end: float, zero: float) -> BlackBox:
        """Return the rows from `begin` to before `end`, with times counted from `zero`."""
        kept = (self.t >= begin) & (self.t < end)
        phases = tuple(p for p, keep in zip(self.phases, kept.tolist(), strict=True) if keep)
        estimates = None if self.estimates is None else self.estimates[kept] - zero
        return BlackBox(self.t[kept] - zero, self.places[kept], self.s[kept], phases, estimates)

    def during(self, begin: float, end: float) -> BlackBox:
        """Return the box with rows from `begin` to `end` only, and one at each of these times.

        Infinite times cut nothing off.
        """
        inside = (self.t > begin) & (self.t < end)
        cuts = [time for time in (begin, end) if math.isfinite(time)]
        if inside.all() and not cuts:
            return self
        t = np.concatenate((cuts[:1] if cuts[:1] == [begin] else [], self.t[inside]))
        t = np.concatenate((t, [end] if math.isfinite(end) else []))
        rows = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, None)
        estimates = None if self.estimates is None else self.estimates[rows] + t - self.t[rows]
        phases = tuple(self.phases[row] for row in rows.tolist())
        return BlackBox(t, self.at(t), self.s[rows], phases, estimates)

    def clock_error(self) -> float | None:
        """Return the greatest error [s] of the robot's estimates of the time; None if unknown."""
        if self.estimates is None or np.isnan(self.estimates).all():
            return None
        return float(np.nanmax(np.abs(self.estimates - self.t)))


def read_blackbox(
    path: Path, start_ns: int | None = None, earlier: Sequence[Path] = ()
) -> BlackBox:
    """Read a black box; a last line cut short by a kill is left out.

    start_ns: the first GO, by the logs; earlier: its files before this one, the oldest first.
    Raises InputError naming the file and the line.
    """
    table, phases = parse_blackbox(box_text(path, start_ns, earlier), str(path))
    return BlackBox(table[:, 0], table[:, 1:3], table[:, 4], phases, table[:, 5])


def parse_blackbox(text: str, path: str) -> tuple[Array, tuple[str, ...]]:
    """Return the numbers of a black box's rows and their phases; a last row cut short is left out.

    The numbers are (n, 6): t, x, y, heading, s, estimate; an estimate that is not recorded is nan.
    Raises InputError naming the line of `path`.
    """
    rows = list(csv.reader(text.splitlines()))
    if not rows or tuple(rows[0]) not in (COLUMNS, _OLDER):
        raise InputError([f"{path}: line 1: the columns are not {','.join(COLUMNS)}"])
    if len(rows) > 1 and not text.endswith("\n"):
        rows.pop()  # Cut short: the rest of its last number would be read as the whole number.
    numbers, phases = [], []
    for line, row in enumerate(rows[1:], start=2):
        try:
            if len(row) != len(rows[0]):
                raise ValueError
            numbers.append(_numbers(row))
        except ValueError:
            raise InputError(
                [f"{path}: line {line}: is not a row of numbers and a phase"]
            ) from None
        phases.append(row[5])
    table = np.array(numbers).reshape(-1, 6)
    if np.any(np.diff(table[:, 0]) < 0.0):
        raise InputError([f"{path}: time runs backwards"])
    return table, tuple(phases)


def blackbox_text(rows: Iterable[Row]) -> bytes:
    """Return the content of a black box file with these rows, as a robot's program writes it."""
    lines = [",".join(COLUMNS), *(",".join(map(_word, row)) for row in rows)]
    return "".join(f"{line}\n" for line in lines).encode("ascii")


def _word(value: float | str | None) -> str:
    return f"{value:.6f}" if isinstance(value, float) else value or ""


def _numbers(row: list[str]) -> list[float]:
    """Return t, x, y, heading, s and the estimate of a row; ValueError when one is not finite."""
    known = [float(value) for value in (*row[:5], *filter(None, row[6:]))]
    if not np.isfinite(known).all():
        raise ValueError
    return [*known, math.nan][:6]
