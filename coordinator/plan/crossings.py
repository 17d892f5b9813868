"""Where paths meet: the points at which they cross or touch, by arc length on both.

Crossings explain a plan to people; its safety depends on the conflict zones alone.  Stretches that
run on top of each other have no crossing points, only zones.

Decides: what is stated about a crossing.  Must not know: widths of robots, or times.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from coordinator.curves.crossing_kernels import PAIR, PLACE_X, U, V
from coordinator.curves.intersections import intersection_tables
from coordinator.curves.nurbs import Array, Nurbs

_SAME: Final = 1e-6
"""Curves nearer than this [m] run on top of each other: float32 cannot resolve less."""

_PART: Final = 5000
"""Pairs in one part of the work, unless the parts would be more than _MOST_PARTS."""

_FEWEST: Final = 500
"""From this many pairs on, the executor is used."""

_MOST_PARTS: Final = 8


@dataclass(frozen=True)
class Meeting:
    """One crossing point [m] and its arc length on both curves [m]."""

    x: float
    y: float
    s_a: float
    s_b: float


def find_crossings(a: Nurbs, b: Nurbs) -> list[Meeting]:
    """Return the points where two curves meet, in order along a.

    Raises ValueError as `crossing_table` does.
    """
    return find_all_crossings([a, b], [(0, 1)])[0]


def find_all_crossings(curves: Sequence[Nurbs], pairs: npt.ArrayLike) -> list[list[Meeting]]:
    """Return where curves meet, for pairs (m, 2) of their indices, in order along the first."""
    wanted = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    found: list[list[Meeting]] = [[] for _ in wanted]
    for pair, *row in crossing_table(curves, wanted).tolist():
        found[int(pair)].append(Meeting(*row))
    return found


def crossing_table(
    curves: Sequence[Nurbs], pairs: npt.NDArray[np.int64], executor: Executor | None = None
) -> Array:
    """Return a row (pair, x, y, s_a, s_b) [m] for each place where a pair (m, 2) of curves meets.

    Rows are in the order of the pairs, then along the pair's first curve.  Many pairs are given to
    the executor in parts.  Raises ValueError as intersections.find_all_intersections does.
    """
    return CrossingSearch(curves, pairs, executor).result()


class CrossingSearch:
    """A crossing table that the executor computes while the caller does something else."""

    def __init__(
        self, curves: Sequence[Nurbs], pairs: npt.NDArray[np.int64], executor: Executor | None
    ) -> None:
        self.curves, self.pairs = tuple(curves), pairs
        self._parts = np.array_split(pairs, min(max(len(pairs) // _PART, 1), _MOST_PARTS))
        self._found: list[Future[Array]] = []
        if executor is not None and len(pairs) >= _FEWEST:
            self._found = [executor.submit(_table, self.curves, part) for part in self._parts]

    def result(self) -> Array:
        """Wait for the table and return it; rows and errors are those of `crossing_table`."""
        if not self._found:
            return _table(self.curves, self.pairs)
        tables = [future.result() for future in self._found]
        for table, begin in zip(
            tables, np.cumsum([0, *map(len, self._parts)]).tolist(), strict=False
        ):
            table[:, 0] += begin
        return np.concatenate(tables)


def _table(curves: Sequence[Nurbs], pairs: npt.NDArray[np.int64]) -> Array:
    points = intersection_tables(curves, pairs, _SAME).points
    number, places = points[:, PAIR], points[:, PLACE_X:PAIR]
    a, b = pairs[number.astype(np.int64)].T
    s_a, s_b = _arcs(curves, a, points[:, U]), _arcs(curves, b, points[:, V])
    return np.column_stack((number, places, s_a, s_b))


def _arcs(curves: Sequence[Nurbs], whose: npt.NDArray[np.int64], u: Array) -> Array:
    """Return arc lengths (m,) at parameters u (m,), each on its own curve, one call per curve."""
    arcs = np.empty_like(u)
    order = np.argsort(whose, kind="stable")
    borders = np.flatnonzero(np.diff(whose[order])) + 1
    for its in np.split(order, borders) if len(order) else []:
        arcs[its] = curves[whose[its[0]]].arc_at(u[its])
    return arcs
