"""All tracks of a fleet, the conflict zones between them, and where each robot may wait.

The rows that the search reads are computed once and cached; if there are threads, these compute
rows ahead of the search.

Decides: where a robot may wait: shortly before a zone.  Must not know: who goes first
(priority_order.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from copy import copy
from typing import Final

import numpy as np
import numpy.typing as npt

from coordinator.schedule.conflict_zones import Indices, Zones, find_zones
from coordinator.schedule.forbidden_interval_kernels import Known, Rows
from coordinator.schedule.safe_interval_kernels import Approach
from coordinator.schedule.track import CELL, Track
from coordinator.schedule.waiting_kernels import times_left
from coordinator.schedule.zone_kernels import CELL_NUMBER, HIGH, LOW, Polyline
from coordinator.schedule.zone_table_kernels import RobotZones, ZoneChords, robot_rows

_MOST_ROWS: Final = 20_000_000
"""Greatest number of rows, 40 bytes each, in the cache; beyond it, the cache is emptied."""

_FEW_ROWS: Final = 20_000
_ENOUGH_ROWS: Final = 3_000_000
_LONGEST_CELL: Final = 0.05
"""Bounds on the length of cells.  Cells are half as long as CELL if that makes fewer than _FEW_ROWS
rows.  They are longer, up to _LONGEST_CELL [m], to have no more than _ENOUGH_ROWS rows: in large
fleets, and in fleets that share lanes.  A robot waits at a zone for up to the time of two cells
longer than it needs."""

FEW: Final = 8
"""Fleets of up to this many robots get more places to wait at, and are scheduled zone by zone."""

_STEP: Final = 0.05
"""Distance [m] between places to wait at inside a zone, after `finer`, for robots without a limit
on acceleration."""

_PLACES: Final = 48
"""Greatest number of places where a robot may wait, chosen evenly: the search grows with its
square."""


class Junctions:
    """Tracks and the zones between them, for robots of radii (n,) [m], a margin [m] and tau [s].

    `among`: only the zones of these robots (indices).  `cell`: the length of cells [m]; by default
    they are as short as the number of rows allows.
    """

    def __init__(
        self,
        tracks: Sequence[Track],
        radii: Sequence[float],
        margin: float,
        tau: float,
        executor: Executor | None = None,
        among: Sequence[int] | None = None,
        cell: float | None = None,
    ) -> None:
        self.tracks = list(tracks)
        self.radii, self.margin, self.tau = np.array(radii, dtype=np.float64), margin, tau
        self.zones = self._find(executor, among)
        self._fine = False
        self._cell = _cell_for(self.zones) if cell is None else cell
        self.tracks = [track.with_cell(self._cell) for track in tracks]
        self._approaches: dict[tuple[int, bool], Approach] = {}
        self._rows: dict[int, tuple[Rows, Known]] = {}
        self._coming: dict[int, Future[tuple[Rows, Known]]] = {}
        self._kept = 0
        self._sort()
        if isinstance(executor, ThreadPoolExecutor) and len(tracks) > FEW:
            self._look_ahead(executor)

    def with_track(self, index: int, track: Track) -> Junctions:
        """Return new junctions in which one robot has another track; self does not change."""
        fresh = copy(self)
        fresh.tracks = list(self.tracks)
        fresh.tracks[index] = track.with_cell(self._cell)
        kept = np.flatnonzero((self.zones.a != index) & (self.zones.b != index))
        fresh.zones = _joined(_chosen(self.zones, kept), fresh._find(None, (index,)))
        fresh._sort()
        changed = {index, *self.near(index), *fresh.near(index)}
        fresh._approaches = {k: v for k, v in self._approaches.items() if k[0] not in changed}
        fresh._rows = {k: v for k, v in self._rows.items() if k not in changed}
        fresh._coming = {k: v for k, v in self._coming.items() if k not in changed}
        fresh._kept = sum(len(rows.cell) for rows, _ in fresh._rows.values())
        return fresh

    def finer(self) -> Junctions:
        """Return a copy with more places to wait at for robots without a limit on acceleration."""
        fresh = copy(self)
        fresh._fine, fresh._approaches = True, {}
        return fresh

    def in_fewer(self, index: int, rows: int, longest: float) -> Junctions:
        """Return the same, with a robot's path in cells so long that it has about `rows` rows.

        They are no longer than `longest` [m].
        """
        span = self.spans(index)
        cell = min(float((span[:, 1] - span[:, 0]).sum()) / rows, longest)
        if cell <= self.tracks[index].cell:
            return self
        fresh = copy(self)
        fresh.tracks = [*self.tracks]
        fresh.tracks[index] = self.tracks[index].with_cell(cell)
        fresh._approaches, fresh._rows, fresh._coming = {}, {}, {}
        return fresh

    def near(self, index: int) -> tuple[int, ...]:
        """Return the robots that a robot shares zones with, in increasing order."""
        if index not in self._near:
            zones = self.zones_of(index)
            others = self.zones.a[zones] + self.zones.b[zones] - index
            self._near[index] = tuple(np.unique(others).tolist())
        return self._near[index]

    def zones_of(self, index: int) -> Indices:
        """Return the numbers of a robot's zones."""
        return self._zones[self._first[index] : self._first[index + 1]]

    def lengths(self) -> list[float]:
        """Return the lengths [m] of all paths."""
        return [track.limits.length for track in self.tracks]

    def span(self, index: int, zones: Indices) -> npt.NDArray[np.float64]:
        """Return where a robot enters and leaves some of its zones, (m, 2) [m]."""
        mine = self.zones.a[zones] == index
        return np.where(mine[:, None], self.zones.extent[zones, :2], self.zones.extent[zones, 2:])

    def spans(self, index: int) -> npt.NDArray[np.float64]:
        """Return where a robot enters and leaves all its zones, (zones, 2) [m]."""
        if index not in self._spans:
            self._spans[index] = self.span(index, self.zones_of(index))
        return self._spans[index]

    def approach(self, index: int, anywhere: bool = True) -> Approach:
        """Return the data for the search for a robot's waits.

        With `anywhere` the robot may wait before every zone, even inside of other zones; without
        it, only at places outside of all zones.
        """
        key = (index, anywhere)
        if key not in self._approaches:
            track = self.tracks[index]
            places = [0.0, *self._places(index, anywhere), track.limits.length]
            ride = track.ride(places)
            self._approaches[key] = Approach(
                *self.rows_of(index), self.spans(index), ride, times_left(ride)
            )
        return self._approaches[key]

    def approach_from(self, index: int, begin: float, beyond: float, anywhere: bool) -> Approach:
        """Return the approach of a robot at rest at `begin`; it may stop only after `beyond` [m].

        The rows still contain what its zones forbid before `begin`; the caller skips that part.
        """
        track, (rows, known) = self.tracks[index], self.rows_of(index)
        nearest = max(begin + track.cell, beyond)
        places = [s for s in self._places(index, anywhere) if s > nearest]
        places = [begin, *places, track.limits.length]
        ride = track.ride(places)
        return Approach(rows, known, self.spans(index), ride, times_left(ride))

    def _places(self, index: int, anywhere: bool) -> list[float]:
        """Return where a robot may wait [m]: half a cell before the cells of its zones."""
        track = self.tracks[index]
        cells = np.floor(self.spans(index) / track.cell)
        at = np.unique(cells[:, 0]) - 1.0
        if self._fine and anywhere and np.isinf(track.limits.accel) and len(at):
            steps = [np.arange(low, high, _STEP / track.cell) for low, high in cells]
            at = np.unique(np.floor(np.concatenate([at, *steps])))
        if not anywhere:
            begun = np.searchsorted(np.sort(cells[:, 0]), at, side="right")
            ended = np.searchsorted(np.sort(cells[:, 1]), at, side="left")
            at = at[begun == ended]
        elif len(at) > _PLACES and len(self.tracks) > FEW:
            at = at[np.linspace(0, len(at) - 1, _PLACES).astype(int)]
        return [float(s) for s in (at[at > 0.0] + 0.5) * track.cell]

    def rows_of(self, index: int) -> tuple[Rows, Known]:
        """Return a robot's zones as rows, and arrays for the times that they forbid."""
        if index not in self._rows:
            if self._kept > _MOST_ROWS:
                self._rows.clear()
                self._approaches.clear()
                self._kept = 0
            coming = self._coming.pop(index, None)
            if coming is None or coming.cancel():
                self._rows[index] = self._find_rows(index)
            else:
                self._rows[index] = coming.result()
            self._kept += len(self._rows[index][0].cell)
        return self._rows[index]

    def _look_ahead(self, threads: ThreadPoolExecutor) -> None:
        """Let threads compute the rows of all robots, if the cache has room for all of them."""
        if _whole(self.zones) / self._cell < _MOST_ROWS:
            for index in range(len(self.tracks)):
                self._coming[index] = threads.submit(self._find_rows, index)

    def _find_rows(self, index: int) -> tuple[Rows, Known]:
        zones, track, mine = self.zones, self.tracks[index], self.zones_of(index)
        others = zones.a[mine] + zones.b[mine] - index
        reach = self.radii[index] + self.radii[others] + self.margin
        reach += self._errors[index] + self._errors[others]
        span = self.spans(index)
        room = int((span[:, 1] - span[:, 0]).sum() / track.cell) + 4 * len(mine)
        shared, chords = RobotZones(mine, others, reach), ZoneChords(zones.first, zones.pairs)
        first, rows = robot_rows(index, shared, chords, *self._lines, track.cell, room)
        cell = np.minimum(rows[:, CELL_NUMBER].astype(np.int64), track.cells - 1)
        begin, end = np.empty((2, len(cell)))
        entered, passed = np.empty((2, len(mine)))
        known = Known(begin, end, entered, passed, np.zeros(len(mine), np.int64))
        low, high = rows[:, LOW].copy(), rows[:, HIGH].copy()
        return Rows(first, cell, low, high, others, span[:, 0].copy()), known

    def _find(self, executor: Executor | None, among: Sequence[int] | None = None) -> Zones:
        chords = [track.chords for track in self.tracks]
        return find_zones(chords, self.radii, self.margin, executor, among)

    def _sort(self) -> None:
        """Sort the zones by robot, and concatenate the chords of all robots."""
        self._near: dict[int, tuple[int, ...]] = {}
        self._spans: dict[int, npt.NDArray[np.float64]] = {}
        chords = [track.chords for track in self.tracks]
        self._errors = np.array([path.error for path in chords])
        lines = Polyline(
            np.concatenate([path.s for path in chords]),
            np.concatenate([path.points for path in chords]),
        )
        self._lines = np.cumsum([0, *(len(path.s) for path in chords)]), lines
        robots = np.concatenate((self.zones.a, self.zones.b))
        order = np.argsort(robots, kind="stable")
        self._zones = order % max(len(self.zones.a), 1)
        self._first = np.searchsorted(robots[order], np.arange(len(self.tracks) + 1))


def _cell_for(zones: Zones) -> float:
    """Return the length of cells [m], long enough to bound the number of rows of all zones."""
    whole = _whole(zones)
    finest = 0.5 * CELL if whole < _FEW_ROWS * CELL else CELL
    return min(max(finest, whole / _ENOUGH_ROWS), _LONGEST_CELL)


def _whole(zones: Zones) -> float:
    """Return the sum of the lengths [m] that robots drive within zones."""
    return float((zones.extent[:, 1::2] - zones.extent[:, ::2]).sum())


def _chosen(zones: Zones, kept: Indices) -> Zones:
    """Return some of the zones, by increasing number."""
    sizes = np.diff(zones.first)[kept]
    first = np.append(0, np.cumsum(sizes))
    at = np.arange(first[-1]) + np.repeat(zones.first[kept] - first[:-1], sizes)
    return Zones(zones.a[kept], zones.b[kept], zones.extent[kept], first, zones.pairs[at])


def _joined(one: Zones, two: Zones) -> Zones:
    """Return the zones of both, in order."""
    both = Zones(
        np.concatenate((one.a, two.a)),
        np.concatenate((one.b, two.b)),
        np.concatenate((one.extent, two.extent)),
        np.concatenate((one.first, one.first[-1] + two.first[1:])),
        np.concatenate((one.pairs, two.pairs)),
    )
    return _chosen(both, np.lexsort((both.b, both.a)))
