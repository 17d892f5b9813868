"""Compiled: when a robot may stand at a place or leave one, among times that others forbid.

Decides: which times a rest and a move must not have.  Must not know: how waits are searched.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from coordinator.base.compiled import allocation_free, compiled
from coordinator.curves.nurbs import Array
from coordinator.curves.nurbs_kernels import Indices

PLACE, LOW, TO_LOW, AT_LOW, HIGH, FROM_HIGH, AT_HIGH, CELL = range(8)
"""Columns of stations: the place [m]; where the ramp up from rest there meets the ceiling [m], how
long that ramp takes [s], and `elapsed` where it meets it; the same three for the ramp down to rest
there; the cell of the place."""

BEGIN, END = range(2)
"""Columns of intervals (n, 2) of times [s] or arc lengths [m]."""

KNOT_S, KNOT_W = range(2)
"""Columns of a ceiling: s [m] and the greatest v^2 there."""

SOON: Final = 1e-9
"""Times nearer to each other [s] are the same."""


class Ride(NamedTuple):
    """What the search for one robot's waits reads of its path and speed limits.

    stations (n, 8): the places where the robot may stop, start and goal included.  elapsed
    (cells + 1,) [s]: when a robot that never stops passes the borders of the cells, which are
    `cell` [m] long.  ceiling (m, 2): the greatest v^2, a polyline over s.  `ramp` [m/s^2]: the
    acceleration.  `at_once`: the acceleration is unlimited, so stops cost no time.
    """

    stations: Array
    elapsed: Array
    ceiling: Array
    cell: float
    ramp: float
    at_once: bool


class ForbiddenTimes(NamedTuple):
    """What others forbid, zone after zone: rows first[z] to first[z + 1] - 1 belong to zone z.

    The robot must not be in cell[r] between begin[r] and end[r] [s].  A zone with low[z] >= high[z]
    forbids nothing, whatever its rows say.  A robot that passes a whole zone at the ceiling moves
    there as if it had left its start at some time t and never stopped; t must not be between low[z]
    and high[z] [s].  span (zones, 2) [m]: where the robot enters and leaves each zone; the cells of
    its rows extend a little beyond.
    """

    first: Indices
    cell: Indices
    begin: Array
    end: Array
    low: Array
    high: Array
    span: Array


class Closed(NamedTuple):
    """Departures that a move must not have: open intervals (n,) [s], and the zones that forbid."""

    begins: Array
    ends: Array
    owners: Indices


class _Move(NamedTuple):
    """A move from rest at one station to rest at another, as fast as the ceiling allows.

    From `begin` to `end` [m].  It is at the ceiling from `low` to `high` [m], if low < high: it
    takes `to_low` [s] to get there, `cruise` [s] more than `elapsed` says behind that, and
    `from_high` [s] down to rest.  Otherwise it takes `climb` [s] for each `half` [m] of its way.
    """

    begin: float
    end: float
    low: float
    to_low: float
    cruise: float
    high: float
    from_high: float
    at_high: float
    half: float
    climb: float


@allocation_free
def _move(ride: Ride, p: int, q: int) -> _Move:
    """Return the move from station p to station q."""
    at = ride.stations
    begin, end, low, high = at[p, PLACE], at[q, PLACE], at[p, LOW], at[q, HIGH]
    half, climb = 0.5 * (end - begin), 0.0
    if low >= high and half > 0.0:
        peak = min(2.0 * half * ride.ramp, _height(ride.ceiling, begin + half))
        climb = 2.0 * half / math.sqrt(peak)
    to_low, from_high = at[p, TO_LOW], at[q, FROM_HIGH]
    cruise = to_low - at[p, AT_LOW]
    return _Move(begin, end, low, to_low, cruise, high, from_high, at[q, AT_HIGH], half, climb)


@allocation_free
def _passed(move: _Move, s: float, elapsed: float) -> float:
    """Return how long after its begin a move passes s [m]; `elapsed` as in `passing_time`."""
    if move.low < move.high:
        if s <= move.low:
            whole = move.low - move.begin
            part = max(s - move.begin, 0.0) / whole if whole > 0.0 else 0.0
            return float(move.to_low * math.sqrt(part))
        if s < move.high:
            return float(move.cruise + elapsed)
        whole = move.end - move.high
        left = move.from_high * math.sqrt(max(move.end - s, 0.0) / whole) if whole > 0.0 else 0.0
        return float(move.cruise + move.at_high + move.from_high - left)
    if move.half <= 0.0:
        return 0.0
    part = (s - move.begin) / move.half
    if part <= 1.0:
        return float(move.climb * math.sqrt(max(part, 0.0)))
    return float(move.climb * (2.0 - math.sqrt(max(2.0 - part, 0.0))))


@allocation_free
def passing_time(ride: Ride, p: int, q: int, s: float, elapsed: float) -> float:
    """Return how long after leaving station p for a rest at q the robot passes s [m].

    `elapsed` [s]: Ride.elapsed at s; it matters only where the robot drives at the ceiling.
    """
    return _passed(_move(ride, p, q), s, elapsed)


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


@allocation_free
def _height(ceiling: Array, s: float) -> float:
    """Return the ceiling's v^2 at s [m]."""
    k, last = 1, len(ceiling) - 1
    while k < last:
        middle = (k + last) // 2
        if ceiling[middle, KNOT_S] < s:
            k = middle + 1
        else:
            last = middle
    low, high = ceiling[k - 1, KNOT_S], ceiling[k, KNOT_S]
    part = min(max((s - low) / (high - low), 0.0), 1.0) if high > low else 0.0
    before, after = ceiling[k - 1, KNOT_W], ceiling[k, KNOT_W]
    return float(before + part * (after - before))


@allocation_free
def _border(ride: Ride, move: _Move, k: int) -> float:
    """Return how long after its begin a move passes the border before cell k.

    A border before its begin counts as that, one beyond its end as its end.
    """
    s = k * ride.cell
    if s <= move.begin:
        return 0.0
    if s >= move.end:
        return _passed(move, move.end, 0.0)
    return _passed(move, s, ride.elapsed[k])


@allocation_free
def _rows_between(cells: Indices, begin: int, end: int, first: int, last: int) -> tuple[int, int]:
    """Return which of rows begin..end - 1 have cells from first to last, as a half-open range.

    The rows are in order of their cells.
    """
    low = _row_at_least(cells, begin, end, first)
    return low, _row_at_least(cells, low, end, last + 1)


@allocation_free
def _row_at_least(cells: Indices, begin: int, end: int, cell: int) -> int:
    """Return the first of rows begin..end - 1 whose cell is not below `cell`; `end` if none."""
    while begin < end:
        middle = (begin + end) // 2
        if cells[middle] < cell:
            begin = middle + 1
        else:
            end = middle
    return begin


@compiled
def safe_times(forbidden: ForbiddenTimes, s: float, cell: int, polite: bool) -> Array:
    """Return the intervals (n, 2) [s] in which a robot may stand at s [m], in increasing order.

    A polite robot does not stand in a zone before the other one has passed it.
    """
    zones = len(forbidden.low)
    begins, ends = np.empty(len(forbidden.cell)), np.empty(len(forbidden.cell))
    count = 0
    for z in range(zones):
        begin, end = forbidden.first[z], forbidden.first[z + 1]
        if forbidden.span[z, BEGIN] > s + SOON or forbidden.span[z, END] < s - SOON:
            continue
        if forbidden.low[z] >= forbidden.high[z]:
            if polite and forbidden.high[z] == math.inf:
                return np.empty((0, 2))
            continue
        low, high = _rows_between(forbidden.cell, begin, end, cell, cell)
        for r in range(low, high):
            if forbidden.begin[r] < forbidden.end[r]:
                begins[count] = -math.inf if polite else forbidden.begin[r]
                ends[count] = forbidden.end[r]
                count += 1
    found = np.empty((count + 1, 2))
    total, now = 0, -math.inf
    for k in np.argsort(begins[:count]):
        if begins[k] > now:
            found[total, BEGIN], found[total, END] = now, begins[k]
            total += 1
        now = max(now, ends[k])
    if now < math.inf:
        found[total, BEGIN], found[total, END] = now, math.inf
        total += 1
    return found[:total]


@allocation_free
def closed_departures(ride: Ride, forbidden: ForbiddenTimes, p: int, q: int, closed: Closed) -> int:
    """Write the departures that a move from p to q must not have; return how many intervals."""
    first, last = int(ride.stations[p, CELL]), int(ride.stations[q, CELL])
    move, count = _move(ride, p, q), 0
    for z in range(len(forbidden.low)):
        begin, end = forbidden.first[z], forbidden.first[z + 1]
        if (
            forbidden.low[z] >= forbidden.high[z]
            or forbidden.cell[begin] > last
            or forbidden.cell[end - 1] < first
        ):
            continue
        if _cruises(ride, move, forbidden.cell[begin], forbidden.cell[end - 1]):
            closed.begins[count] = forbidden.low[z] - move.cruise
            closed.ends[count] = forbidden.high[z] - move.cruise
            closed.owners[count] = z
            count += 1
            continue
        rows = _rows_between(forbidden.cell, begin, end, first, last)
        before, count = count, _forbidden_by(ride, forbidden, move, rows, closed, count)
        for k in range(before, count):
            closed.owners[k] = z
    return count


@allocation_free
def _cruises(ride: Ride, move: _Move, first: int, last: int) -> bool:
    """Tell whether a move is at the ceiling from cell `first` to cell `last`."""
    low, high = move.low, move.high
    return bool(low < high and first * ride.cell >= low and (last + 1) * ride.cell <= high)


@allocation_free
def _forbidden_by(
    ride: Ride,
    forbidden: ForbiddenTimes,
    move: _Move,
    rows: tuple[int, int],
    closed: Closed,
    count: int,
) -> int:
    """Append to `count` intervals what rows[0] to rows[1] - 1 of a zone forbid; return how many.

    What consecutive rows forbid mostly overlaps and becomes one interval.
    """
    begins, ends = closed.begins, closed.ends
    earliest, latest = math.inf, -math.inf
    border, passed = -1, 0.0
    for r in range(rows[0], rows[1]):
        if forbidden.begin[r] >= forbidden.end[r]:
            continue
        cell = forbidden.cell[r]
        if _cruises(ride, move, cell, cell):
            enters, leaves = move.cruise + ride.elapsed[cell], move.cruise + ride.elapsed[cell + 1]
        else:
            enters = passed if cell == border else _border(ride, move, cell)
            leaves = _border(ride, move, cell + 1)
            border, passed = cell + 1, leaves
        low, high = forbidden.begin[r] - leaves, forbidden.end[r] - enters
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
