"""Conflict zones: all (s_a, s_b) at which two robots would be nearer than they may be.

Paths are cut into short cells.  Two cells conflict when their centres are nearer than the need
plus half of both lengths: nothing is missed, and nothing in a zone is farther apart than the need
plus twice the cell length (1 cm on paths up to 20 m).
Decides: where the order of two robots matters.  Must not know: times.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from coordinator.nurbs import Array, Nurbs

Indices = npt.NDArray[np.intp]

_CELL: Final = 0.005
_LONGEST_CELL: Final = 0.05
_CELLS: Final = 4000


@dataclass(frozen=True, eq=False)
class Cells:
    """One path cut into cells of equal length: borders (n + 1,) [m] and centres (n, 2) [m]."""

    borders: Array
    centers: Array

    @property
    def size(self) -> float:
        """Length of a cell [m]."""
        return float(self.borders[1] - self.borders[0])

    @cached_property
    def tree(self) -> cKDTree:
        """The centres in a k-d tree."""
        return cKDTree(self.centers)

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Lower and upper corner of the centres."""
        return self.centers.min(axis=0), self.centers.max(axis=0)

    def at(self, s: float) -> int:
        """Return the cell that contains arc length s [m]."""
        cell = int(np.searchsorted(self.borders, s, side="right")) - 1
        return min(max(cell, 0), len(self.centers) - 1)


def cut(curve: Nurbs) -> Cells:
    """Cut a curve into cells."""
    size = min(max(curve.length / _CELLS, _CELL), _LONGEST_CELL)
    borders = np.linspace(0.0, curve.length, 1 + max(2, round(curve.length / size + 0.5)))
    return Cells(borders, curve.at_arc(0.5 * (borders[:-1] + borders[1:])))


@dataclass(frozen=True)
class Zone:
    """One connected conflict zone as its extent on both paths [m]."""

    a0: float
    a1: float
    b0: float
    b1: float


@dataclass(frozen=True, eq=False)
class Runs:
    """Per cell of one robot the ranges [low, high] of the other robot's cells in conflict."""

    cell: Indices
    low: Indices
    high: Indices


@dataclass(frozen=True, eq=False)
class Conflict:
    """The conflict of a pair: the runs seen from each side, and the zones."""

    of_a: Runs
    of_b: Runs
    zones: tuple[Zone, ...]


def find_conflict(a: Cells, b: Cells, need: float) -> Conflict | None:
    """Return where robots on two paths are nearer than `need` [m]; None when nowhere."""
    reach = need + 0.5 * (a.size + b.size)
    if np.any(a.box[0] > b.box[1] + reach) or np.any(b.box[0] > a.box[1] + reach):
        return None
    near = a.tree.sparse_distance_matrix(b.tree, reach, output_type="ndarray")
    if len(near) == 0:
        return None
    rows, columns = near["i"].astype(np.intp), near["j"].astype(np.intp)
    of_a = _runs(rows, columns)
    return Conflict(of_a, _runs(columns, rows), _zones(of_a, a, b))


def _runs(cells: Indices, others: Indices) -> Runs:
    """Gather pairs of cells into runs of neighbouring other cells."""
    order = np.lexsort((others, cells))
    cells, others = cells[order], others[order]
    new = np.flatnonzero((np.diff(cells) != 0) | (np.diff(others) != 1)) + 1
    first = np.concatenate(([0], new))
    last = np.append(new - 1, len(cells) - 1)
    return Runs(cells[first], others[first], others[last])


def _zones(runs: Runs, a: Cells, b: Cells) -> tuple[Zone, ...]:
    """Join runs of neighbouring cells that touch into zones, by their first place on a."""
    width = len(b.centers) + 3
    lows, highs = runs.cell * width + runs.low, runs.cell * width + runs.high
    first = np.searchsorted(highs, lows + width - 1, side="left")
    end = np.searchsorted(lows, highs + width + 1, side="right")
    count = np.maximum(end - first, 0)
    source = np.repeat(np.arange(len(lows)), count)
    offset = np.arange(len(source)) - np.repeat(np.cumsum(count) - count, count)
    target = first[source] + offset
    graph = coo_array((np.ones(len(source)), (source, target)), shape=(len(lows), len(lows)))
    total, label = connected_components(graph, directed=False)
    found = []
    for zone in range(total):
        mine = label == zone
        found.append(
            Zone(
                float(a.borders[runs.cell[mine].min()]),
                float(a.borders[runs.cell[mine].max() + 1]),
                float(b.borders[runs.low[mine].min()]),
                float(b.borders[runs.high[mine].max() + 1]),
            )
        )
    return tuple(sorted(found, key=lambda zone: (zone.a0, zone.b0)))
