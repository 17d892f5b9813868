"""The rows of a robot's black box in virtual time, as compact arrays.

Decides: which rows are kept.  Must not know: when a row is due.
"""

from __future__ import annotations

import math
from array import array
from typing import Final

import numpy as np

from protocol.phases import PHASE_NAMES
from protocol.timing import MILLISECOND, SECOND
from sim.judging.blackbox import BlackBox, Row

_SAME_ERROR: Final = MILLISECOND / SECOND
"""Clock errors that differ by less [s] count as the same."""

_NUMBERS: Final = 6
"""How many numbers a row has: t, x, y, heading, s, estimate (nan where it is unknown)."""


Noted = tuple[float, float, float, float, float, int, float | None]
"""The values of COLUMNS in a row, with the phase as a number."""

_NOTHING: Final[Noted] = (0.0, math.nan, 0.0, 0.0, 0.0, -1, None)


class Recording:
    """The rows of one robot.

    Of the rows while a robot stands with an unchanged clock error, only the first and the last are
    kept.
    """

    def __init__(self) -> None:
        self._numbers = array("d")
        self._phases = bytearray()
        self._before, self._last = _NOTHING, _NOTHING

    def add(self, row: Noted) -> None:
        """Add a row."""
        last = self._last
        t, x, y, heading, s, phase, estimate = row
        known = math.nan if estimate is None else estimate
        if last[1] == x and _is_alike(last, row) and _is_alike(self._before, row):
            self._numbers[-_NUMBERS], self._numbers[-1] = t, known
        else:
            self._numbers.extend((t, x, y, heading, s, known))
            self._phases.append(phase)
            self._before = last
        self._last = row

    @property
    def last_phase(self) -> int:
        """The phase of the last row; -1 while there is none."""
        return self._last[5]

    def rows(self) -> list[Row]:
        """Return all rows."""
        found: list[Row] = []
        for (*numbers, estimate), phase in zip(self._table().tolist(), self._phases, strict=True):
            t, x, y, heading, s = numbers
            known = None if estimate != estimate else estimate
            found.append((t, x, y, heading, s, PHASE_NAMES[phase], known))
        return found

    def blackbox(self) -> BlackBox:
        """Return the rows as a black box."""
        table, phases = self._table(), tuple(PHASE_NAMES[phase] for phase in self._phases)
        return BlackBox(table[:, 0], table[:, 1:3], table[:, 4], phases, table[:, 5])

    def _table(self) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        return np.array(self._numbers).reshape(-1, _NUMBERS)


def _is_alike(before: Noted, row: Noted) -> bool:
    """Return whether two rows differ only in their times."""
    if before[1:6] != row[1:6]:
        return False
    one, other = before[6], row[6]
    if one is None or other is None:
        return one is other
    return abs((one - before[0]) - (other - row[0])) < _SAME_ERROR
