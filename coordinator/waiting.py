"""One robot among others whose motions are known: the earliest motion with waits.

A safe-interval search on a fixed path: states are (waiting place, interval of time in which it may
be stood at), moves run from rest to rest without a stop between.  A place and a time are banned
when another robot comes nearer than the need within tau of that time.
Decides: where and until when one robot waits.  Must not know: who should go first (schedule.py).
"""

from __future__ import annotations

import heapq
import math
from bisect import bisect_right
from dataclasses import dataclass, field

import numpy as np

from coordinator.motion import Motion, SpeedLimits, Wait, speed_knots, times_at
from coordinator.nurbs import Array
from coordinator.zones import Cells, Indices, Runs

Interval = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Piece:
    """A move from rest to rest: when each cell is entered and left [s after the departure]."""

    first: int
    entered: Array
    left: Array

    @property
    def duration(self) -> float:
        """Time from departure to arrival [s]."""
        return float(self.left[-1])


@dataclass(eq=False)
class Track:
    """What the search needs to know of one robot: its path's cells and its speed limits."""

    limits: SpeedLimits
    cells: Cells
    harmless: list[float] = field(default_factory=list)
    """Waiting places [m] outside of every zone, in order."""
    anywhere: list[float] = field(default_factory=list)
    """Waiting places [m] before every zone, inside of others too, in order."""
    _pieces: dict[tuple[float, float], Piece] = field(default_factory=dict)

    def piece(self, begin: float, end: float) -> Piece:
        """Return the move from rest at `begin` to rest at `end` [m]."""
        key = (begin, end)
        if key not in self._pieces:
            first, last = self.cells.at(begin), self.cells.at(end)
            borders = np.clip(self.cells.borders[first : last + 2], begin, end)
            time = times_at(*speed_knots(self.limits, begin, end), borders)
            self._pieces[key] = Piece(first, time[:-1], time[1:])
        return self._pieces[key]


@dataclass(frozen=True, eq=False)
class Bans:
    """Banned (cell, open time interval) for one robot, sorted by cell; owner: who forbids it."""

    cell: Indices
    begin: Array
    end: Array
    owner: Indices

    def within(self, first: int, last: int) -> slice:
        """Return the slice of bans on cells first to last."""
        return slice(
            int(np.searchsorted(self.cell, first, side="left")),
            int(np.searchsorted(self.cell, last, side="right")),
        )

    def safe(self, cell: int) -> list[Interval]:
        """Return the intervals in which the robot may stand in a cell, in order."""
        part = self.within(cell, cell)
        return [(low, high) for low, high, _ in _gaps(self, part, 0.0, 0.0)]


def collect_bans(others: list[tuple[int, Runs, Cells, Motion]], tau: float) -> Bans:
    """Return what robots with known motions forbid: (index, runs from our side, cells, motion)."""
    cells, begins, ends, owners = [], [], [], []
    for index, runs, their_cells, motion in others:
        cells.append(runs.cell)
        begins.append(motion.reached(their_cells.borders[runs.low]) - tau)
        ends.append(motion.left(their_cells.borders[runs.high + 1]) + tau)
        owners.append(np.full(len(runs.cell), index, dtype=np.intp))
    if not cells:
        none = np.empty(0, dtype=np.intp)
        return Bans(none, np.empty(0), np.empty(0), none)
    cell = np.concatenate(cells)
    order = np.argsort(cell, kind="stable")
    return Bans(
        cell[order],
        np.concatenate(begins)[order],
        np.concatenate(ends)[order],
        np.concatenate(owners)[order],
    )


@dataclass(frozen=True)
class _Arrival:
    """How a state was reached first: when, from which state, and when that one was left."""

    time: float
    stops: int
    parent: tuple[int, int] | None = None
    depart: float = 0.0
    owner: int = -1


def earliest_motion(track: Track, bans: Bans, places: list[float]) -> Motion | None:
    """Return the motion that reaches the goal first, waiting only at `places`; None if none."""
    stations = [0.0, *places, track.limits.length]
    goal = len(stations) - 1
    safe = [bans.safe(track.cells.at(s)) for s in stations]
    if not _stays_safe(safe[0], 0, 0) or not _stays_safe(safe[goal], -1, 1):
        return None
    rest = [
        track.piece(s, stations[-1]).duration if i < goal else 0.0 for i, s in enumerate(stations)
    ]
    best = {(0, 0): _Arrival(0.0, 0)}
    heap = [(rest[0], 0, (0, 0))]
    done: set[tuple[int, int]] = set()
    while heap:
        _, _, state = heapq.heappop(heap)
        if state in done:
            continue
        done.add(state)
        if state == (goal, len(safe[goal]) - 1):
            return _motion(track, stations, best, state)
        here = best[state]
        window = (here.time, safe[state[0]][state[1]][1])
        for there in range(state[0] + 1, goal + 1):
            piece = track.piece(stations[state[0]], stations[there])
            for depart, owner in _departures(bans, piece, window):
                time = depart + piece.duration
                interval = bisect_right(safe[there], (time + 1e-9, math.inf)) - 1
                target = (there, interval)
                reached = _Arrival(time, here.stops + 1, state, depart, owner)
                if target in done or interval < 0 or time > safe[there][interval][1]:
                    continue
                if target not in best or (time, reached.stops) < (
                    best[target].time,
                    best[target].stops,
                ):
                    best[target] = reached
                    heapq.heappush(heap, (time + rest[there], reached.stops, target))
    return None


def _stays_safe(intervals: list[Interval], which: int, side: int) -> bool:
    """Tell whether the first interval goes back for ever, or the last one goes on for ever."""
    return bool(intervals) and math.isinf(intervals[which][side])


def _departures(bans: Bans, piece: Piece, window: Interval) -> list[tuple[float, int]]:
    """Return the earliest departure in each gap of the window, and who made it so late."""
    part = bans.within(piece.first, piece.first + len(piece.left) - 1)
    cell = bans.cell[part] - piece.first
    found = []
    for low, high, owner in _gaps(bans, part, piece.left[cell], piece.entered[cell]):
        depart = max(low, window[0])
        if depart > min(high, window[1]):
            continue
        rounded = math.ceil(depart * 1000.0) / 1000.0
        if low > window[0] and rounded <= min(high, window[1]):
            depart = rounded
        found.append((depart, owner if low > window[0] else -1))
    return found


def _gaps(
    bans: Bans, part: slice, lead: Array | float, lag: Array | float
) -> list[tuple[float, float, int]]:
    """Return the times not covered by (begin - lead, end - lag): (low, high, who ends it)."""
    begin, end = bans.begin[part] - lead, bans.end[part] - lag
    if len(begin) == 0:
        return [(-math.inf, math.inf, -1)]
    order = np.argsort(begin, kind="stable")
    begin, end = begin[order], end[order]
    covered = np.maximum.accumulate(end)
    last = np.flatnonzero(np.append(begin[1:] >= covered[:-1], True))
    lows = np.concatenate(([-np.inf], covered[last]))
    highs = np.append(begin[np.append(0, last[:-1] + 1)], np.inf)
    gaps = []
    for i, (low, high) in enumerate(zip(lows.tolist(), highs.tolist(), strict=True)):
        if low <= high and low < math.inf and high > -math.inf:
            owner = -1
            if i:
                group = end[: last[i - 1] + 1]
                owner = int(bans.owner[part][order[int(np.argmax(group == low))]])
            gaps.append((low, high, owner))
    return gaps


def _motion(
    track: Track,
    stations: list[float],
    best: dict[tuple[int, int], _Arrival],
    state: tuple[int, int],
) -> Motion:
    """Follow the parents back and return the motion with its waits."""
    waits = []
    at_once = math.isinf(track.limits.accel)
    while (reached := best[state]).parent is not None:
        state = reached.parent
        s, arrived = stations[state[0]], best[state].time
        if reached.depart > arrived or (s > 0.0 and not at_once):
            waits.append(Wait(s, max(reached.depart, arrived), reached.owner))
    return Motion(track.limits, waits[::-1])
