"""Compiled: when a robot may stand at a place or leave one, among times that others forbid.

A `ride` is what the search needs to know of a path: `stations` (n, 8) as in track.py; `elapsed`
(cells + 1,), the time [s] at which a robot that never stops passes each border of a cell;
`ceiling` (m, 2), the knots of the greatest v^2; the cell size [m].

Decides: which times a rest and a move must not have.  Must not know: how waits are searched.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from coordinator.base.compiled import compiled
from coordinator.curves.nurbs import Array
from coordinator.curves.nurbs_kernels import Indices

PLACE: Final = 0
LOW: Final = 1
TO_LOW: Final = 2
AT_LOW: Final = 3
HIGH: Final = 4
FROM_HIGH: Final = 5
AT_HIGH: Final = 6
CELL: Final = 7
"""Columns of stations: its place [m]; where a ramp from rest there reaches the ceiling [m], after
how long [s], and `elapsed` there; the same for the ramp down to it; its cell."""

SOON: Final = 1e-9
"""Times nearer to each other [s] are the same."""


class Ride(NamedTuple):
    """One robot's path as data for the search; `ramp` [m/s^2]; `at_once`: stops cost no time."""

    stations: Array
    elapsed: Array
    ceiling: Array
    cell: float
    ramp: float
    at_once: bool


class Bans(NamedTuple):
    """What others forbid, zone after zone: rows first[z] to first[z + 1] belong to zone z.

    In cell[r] the robot must not be between begin[r] and end[r] [s], unless its zone asks nothing:
    low[z] is not below high[z].  A robot that does not stop in a zone, and would have left its
    start at t had it never stopped, must not have t between low[z] and high[z].  span (zones, 2)
    [m]: where it enters and leaves each zone; cells reach a little farther.
    """

    first: Indices
    cell: Indices
    begin: Array
    end: Array
    low: Array
    high: Array
    span: Array


@compiled
def passing_time(ride: Ride, p: int, q: int, s: float, elapsed: float) -> float:
    """Return when s [m] is passed after leaving station p for a rest at q; `elapsed` at s [s]."""
    a, b = ride.stations[p], ride.stations[q]
    if a[LOW] < b[HIGH]:
        if s <= a[LOW]:
            whole = a[LOW] - a[PLACE]
            part = max(s - a[PLACE], 0.0) / whole if whole > 0.0 else 0.0
            return float(a[TO_LOW] * math.sqrt(part))
        cruise = a[TO_LOW] - a[AT_LOW]
        if s < b[HIGH]:
            return float(cruise + elapsed)
        whole = b[PLACE] - b[HIGH]
        left = b[FROM_HIGH] * math.sqrt(max(b[PLACE] - s, 0.0) / whole) if whole > 0.0 else 0.0
        return float(cruise + b[AT_HIGH] + b[FROM_HIGH] - left)
    half = 0.5 * (b[PLACE] - a[PLACE])
    if half <= 0.0:
        return 0.0
    peak = min(2.0 * half * ride.ramp, _height(ride.ceiling, a[PLACE] + half))
    climb, part = 2.0 * half / math.sqrt(peak), (s - a[PLACE]) / half
    if part <= 1.0:
        return float(climb * math.sqrt(max(part, 0.0)))
    return float(climb * (2.0 - math.sqrt(max(2.0 - part, 0.0))))


@compiled
def times_left(ride: Ride) -> Array:
    """Return the least times [s] from rest at each station to rest at the last one (stations,)."""
    last = len(ride.stations) - 1
    goal = ride.stations[last, PLACE]
    found = np.zeros(last + 1)
    for p in range(last):
        if ride.stations[p, PLACE] < goal:
            found[p] = passing_time(ride, p, last, goal, 0.0)
    return found


@compiled
def _height(ceiling: Array, s: float) -> float:
    """Return the ceiling's v^2 at s [m]."""
    k = min(max(int(np.searchsorted(ceiling[:, 0], s)), 1), len(ceiling) - 1)
    low, high = ceiling[k - 1, 0], ceiling[k, 0]
    part = min(max((s - low) / (high - low), 0.0), 1.0) if high > low else 0.0
    return float(ceiling[k - 1, 1] + part * (ceiling[k, 1] - ceiling[k - 1, 1]))


@compiled
def _border(ride: Ride, p: int, q: int, k: int) -> float:
    """Return when the border before cell k is passed on the move from p to q, ends included."""
    begin, end = ride.stations[p, PLACE], ride.stations[q, PLACE]
    s = k * ride.cell
    if s <= begin:
        return 0.0
    if s >= end:
        return passing_time(ride, p, q, end, 0.0)
    return passing_time(ride, p, q, s, ride.elapsed[k])


@compiled
def _rows_between(cells: Indices, begin: int, end: int, first: int, last: int) -> tuple[int, int]:
    """Return where rows begin..end - 1, in order of their cells, lie in cells first to last."""
    low = begin + int(np.searchsorted(cells[begin:end], first))
    return low, begin + int(np.searchsorted(cells[begin:end], last + 1))


@compiled
def safe_times(bans: Bans, s: float, cell: int, polite: bool) -> Array:
    """Return the intervals (n, 2) [s] in which a robot may stand at s [m], in increasing order.

    A polite robot stands in a zone only once the other one has passed it.
    """
    zones = len(bans.low)
    begins, ends = np.empty(len(bans.cell)), np.empty(len(bans.cell))
    count = 0
    for z in range(zones):
        begin, end = bans.first[z], bans.first[z + 1]
        if bans.span[z, 0] > s + SOON or bans.span[z, 1] < s - SOON:
            continue
        if bans.low[z] >= bans.high[z]:
            if polite and bans.high[z] == math.inf:
                return np.empty((0, 2))
            continue
        low, high = _rows_between(bans.cell, begin, end, cell, cell)
        for r in range(low, high):
            if bans.begin[r] < bans.end[r]:
                begins[count] = -math.inf if polite else bans.begin[r]
                ends[count] = bans.end[r]
                count += 1
    found = np.empty((count + 1, 2))
    total, now = 0, -math.inf
    for k in np.argsort(begins[:count]):
        if begins[k] > now:
            found[total, 0], found[total, 1] = now, begins[k]
            total += 1
        now = max(now, ends[k])
    if now < math.inf:
        found[total, 0], found[total, 1] = now, math.inf
        total += 1
    return found[:total]


@compiled
def forbidden(
    ride: Ride, bans: Bans, p: int, q: int, begins: Array, ends: Array, owners: Indices
) -> int:
    """Write the departures (open intervals) that a move from p to q must not have; how many."""
    a, b = ride.stations[p], ride.stations[q]
    first, last, count = int(a[CELL]), int(b[CELL]), 0
    cruise = a[TO_LOW] - a[AT_LOW]
    for z in range(len(bans.low)):
        begin, end = bans.first[z], bans.first[z + 1]
        if bans.low[z] >= bans.high[z] or bans.cell[begin] > last or bans.cell[end - 1] < first:
            continue
        if _cruises(ride, p, q, bans.cell[begin], bans.cell[end - 1]):
            begins[count], ends[count] = bans.low[z] - cruise, bans.high[z] - cruise
            owners[count] = z
            count += 1
            continue
        begin, end = _rows_between(bans.cell, begin, end, first, last)
        more = _forbidden_by(ride, bans, p, q, begin, end, begins[count:], ends[count:])
        owners[count : count + more] = z
        count += more
    return count


@compiled
def _cruises(ride: Ride, p: int, q: int, first: int, last: int) -> bool:
    """Tell whether a move from p to q is on the ceiling from cell `first` to cell `last`."""
    low, high = ride.stations[p, LOW], ride.stations[q, HIGH]
    return bool(low < high and first * ride.cell >= low and (last + 1) * ride.cell <= high)


@compiled
def _forbidden_by(
    ride: Ride, bans: Bans, p: int, q: int, first: int, past: int, begins: Array, ends: Array
) -> int:
    """Write the departures that rows first..past - 1 of one zone forbid; how many.

    Rows that follow each other forbid times that overlap, and are told as one.
    """
    cruise, count = ride.stations[p, TO_LOW] - ride.stations[p, AT_LOW], 0
    earliest, latest = math.inf, -math.inf
    for r in range(first, past):
        if bans.begin[r] >= bans.end[r]:
            continue
        cell = bans.cell[r]
        if _cruises(ride, p, q, cell, cell):
            enters, leaves = cruise + ride.elapsed[cell], cruise + ride.elapsed[cell + 1]
        else:
            enters, leaves = _border(ride, p, q, cell), _border(ride, p, q, cell + 1)
        low, high = bans.begin[r] - leaves, bans.end[r] - enters
        if low < latest and high > earliest:
            earliest, latest = min(earliest, low), max(latest, high)
            continue
        if earliest < latest:
            begins[count], ends[count] = earliest, latest
            count += 1
        earliest, latest = low, high
    if earliest < latest:
        begins[count], ends[count] = earliest, latest
        count += 1
    return count
