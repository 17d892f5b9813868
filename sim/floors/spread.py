"""Discs spread over a floor, indexed by cells: a search costs the same on a floor of any size.

Decides: whether one more disc has room.  Must not know: what the discs represent.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator


class Spread:
    """Discs [m] in square cells; `widest` is the largest sum of two radii that will occur."""

    def __init__(self, widest: float) -> None:
        self._cell = widest
        self._cells: defaultdict[tuple[int, int], list[tuple[float, float, float]]] = defaultdict(
            list
        )

    def fits(self, x: float, y: float, radius: float) -> bool:
        """Return whether a disc would overlap none of the discs."""
        return all(
            math.hypot(x - other_x, y - other_y) >= radius + other_radius
            for other_x, other_y, other_radius in self._near(x, y)
        )

    def add(self, x: float, y: float, radius: float) -> None:
        """Add a disc, without a check whether it overlaps others."""
        self._cells[self._key(x, y)].append((x, y, radius))

    def remove(self, x: float, y: float, radius: float) -> None:
        """Remove a disc that was added with exactly these numbers."""
        self._cells[self._key(x, y)].remove((x, y, radius))

    def _key(self, x: float, y: float) -> tuple[int, int]:
        return math.floor(x / self._cell), math.floor(y / self._cell)

    def _near(self, x: float, y: float) -> Iterator[tuple[float, float, float]]:
        column, row = self._key(x, y)
        for i in (column - 1, column, column + 1):
            for j in (row - 1, row, row + 1):
                yield from self._cells.get((i, j), ())
