"""Conflict zones of a whole fleet: all (s_a, s_b) at which two robots are too near.

Decides: where the order of two robots matters, for every pair.  Must not know: times.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from coordinator.base.bounds import bounds_of
from coordinator.curves.chords import Chords
from coordinator.curves.nurbs import Array
from coordinator.schedule.broad_phase_kernels import ROBOT, Frame, lay_out, stretches_of
from coordinator.schedule.fleet_zone_kernels import (
    ROBOT_A,
    ROBOT_B,
    SIZE,
    Fleet,
    FleetZones,
    zones_of,
)
from coordinator.schedule.zone_kernels import Polyline

Indices = npt.NDArray[np.int64]

_TASKS: Final = 12
_MANY: Final = 4000
"""From this many chords on, several threads are used."""
_STRETCH: Final = 3.0
"""Length of a stretch, as a multiple of the largest need."""
_CELL: Final = 3.0
"""Size of a cell of the grid, as a multiple of the largest need."""


@dataclass(frozen=True, eq=False)
class Zones:
    """All conflict zones of a fleet, in order of (a, b, extent).

    a, b (n,): the robots, a < b.  extent (n, 4) [m]: a0, a1, b0, b1, the arc lengths where the
    zone begins and ends on both paths.  first (n + 1,), pairs (m, 2): zone k
    lies on the pairs of chords pairs[first[k] : first[k + 1]], chord of a and chord of b, in
    increasing order.
    """

    a: Indices
    b: Indices
    extent: Array
    first: Indices
    pairs: Indices


def find_zones(
    chords: Sequence[Chords],
    radii: npt.ArrayLike,
    margin: float,
    executor: Executor | None = None,
    among: Sequence[int] | None = None,
) -> Zones:
    """Return where robots on their paths are nearer than radii[a] + radii[b] + margin [m].

    No conflict is missed, and places in a zone are no farther apart than that distance plus twice
    the errors of both paths.  `among`: only pairs with at least one of these robots.  The executor
    gets tasks of plain arrays; the result does not depend on the executor.
    """
    if not chords:
        none = np.zeros(0, np.int64)
        return Zones(
            none, none, np.zeros((0, 4)), np.zeros(1, np.int64), np.zeros((0, 2), np.int64)
        )
    fleet = _gather(chords, np.asarray(radii, dtype=np.float64), margin, among)
    tasks = _tasks(fleet)
    if len(fleet.line.s) < _MANY or (executor is None and among is not None):
        return _together(fleet, [zones_of(fleet, (0, len(chords)))])
    if executor is not None:
        return _together(fleet, _run(executor, fleet, tasks))
    with ThreadPoolExecutor(min(os.cpu_count() or 1, len(tasks))) as threads:
        return _together(fleet, _run(threads, fleet, tasks))


def _gather(
    chords: Sequence[Chords], radii: Array, margin: float, among: Sequence[int] | None
) -> Fleet:
    """Return a fleet as arrays, its stretches laid out on a grid."""
    if len(radii) != len(chords):
        raise ValueError(f"{len(radii)} radii do not fit {len(chords)} paths")
    errors = np.array([path.error for path in chords])
    half = radii + 0.5 * margin + errors
    first = np.zeros(len(chords) + 1, np.int64)
    np.cumsum([len(path.s) for path in chords], out=first[1:])
    points = np.concatenate([path.points for path in chords])
    line = Polyline(np.concatenate([path.s for path in chords]), points)
    asked = np.ones(len(chords), np.int64)
    if among is not None:
        asked[:] = 0
        asked[np.asarray(among, dtype=np.int64)] = 1
    need = max(2.0 * float(half.max()), 1e-6)
    stretches, shapes = stretches_of(first, points, half, _STRETCH * need)
    low, high = bounds_of(points)
    size = max(_CELL * need, float(np.sqrt(np.prod(high - low + need) / (4 * len(stretches) + 64))))
    columns, rows = (np.floor((high - low) / size).astype(int) + 1).tolist()
    frame = Frame(float(low[0]), float(low[1]), size, columns, rows)
    grid = lay_out(points, stretches, shapes, asked, frame)
    middles = np.concatenate([path.middles for path in chords])
    return Fleet(asked, first, line, middles, half, grid)


def _tasks(fleet: Fleet) -> list[tuple[int, int]]:
    """Return ranges of robots with about equal work: own stretches times those of later robots."""
    count = len(fleet.half)
    own = np.bincount(fleet.grid.stretches[:, ROBOT], minlength=count)
    work = np.cumsum(own * (own[::-1].cumsum()[::-1] + 1) * fleet.asked)
    cuts = np.searchsorted(work, work[-1] * np.arange(1, _TASKS) / _TASKS) + 1
    borders = np.unique(np.concatenate(([0], np.minimum(cuts, count), [count]))).tolist()
    return list(itertools.pairwise(borders))


def find_some(fleet: Fleet, task: tuple[int, int]) -> FleetZones:
    """Return the result of zones_of for one task; an executor's process can call this function."""
    return zones_of(fleet, task)


def _run(executor: Executor, fleet: Fleet, tasks: list[tuple[int, int]]) -> list[FleetZones]:
    """Return the answers of all tasks, in their order."""
    waiting = [executor.submit(find_some, fleet, task) for task in tasks]
    return [future.result() for future in waiting]


def _together(fleet: Fleet, found: list[FleetZones]) -> Zones:
    """Return all zones in order; each robot's chords are counted from 0."""
    zones = np.concatenate([part.zones for part in found])
    extent = np.concatenate([part.extents for part in found])
    pairs = np.concatenate([part.members for part in found], dtype=np.int64)
    first = np.append(0, np.cumsum(zones[:, SIZE]))
    order = np.lexsort((zones[:, ROBOT_B], zones[:, ROBOT_A]))
    if np.any(order[:-1] > order[1:]):
        sizes = zones[order, SIZE]
        moved = np.append(0, np.cumsum(sizes))
        pairs = pairs[np.arange(len(pairs)) + np.repeat(first[order] - moved[:-1], sizes)]
        zones, extent, first = zones[order], extent[order], moved
    pairs -= np.repeat(fleet.first[zones[:, [ROBOT_A, ROBOT_B]]], zones[:, SIZE], axis=0)
    return Zones(zones[:, ROBOT_A].copy(), zones[:, ROBOT_B].copy(), extent, first, pairs)
