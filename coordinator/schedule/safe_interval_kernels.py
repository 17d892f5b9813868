"""Compiled: the earliest motion of one robot on its path among times that others forbid.

Safe-interval path planning (Phillips and Likhachev 2011) in one dimension.  A state is a station
and an interval of time in which the robot may stand there.  A move leads from rest at one station
to rest at a later one without a stop on the way.

Decides: where and until when one robot waits.  Must not know: who should go first.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import allocation_free, compiled
from coordinator.base.heap_kernels import Heap, empty_heap, pop, push, wider_heap
from coordinator.curves.nurbs import Array
from coordinator.curves.nurbs_kernels import Indices
from coordinator.schedule.forbidden_interval_kernels import Known, Rows, Timetable, forbid
from coordinator.schedule.waiting_kernels import (
    BEGIN,
    CELL,
    END,
    PLACE,
    SOON,
    Closed,
    ForbiddenTimes,
    Ride,
    closed_departures,
    passing_time,
    safe_times,
)

STATION, DEPARTURE, OWNER = range(3)
"""Columns of rests (n, 3): the station, when the robot leaves it [s], and the number of the zone
because of which it waits there (-1: none)."""

_ROOM: Final = 1024
"""For how many states on the heap, and closed departures, there is room at first."""

_PER_STOP: Final = 0.02
"""By how much [s] one more stop must make a robot with limited acceleration arrive earlier."""


class Approach(NamedTuple):
    """The data that the search for one robot's waits reads.

    rows: where its zones forbid something, in the order of `Junctions.zones_of`; known: the last
    results for these zones, overwritten by every search; span (zones, 2) [m]: where the robot
    enters and leaves them; ride: its path with stations where it may wait; rest (stations,) [s]:
    the least time from each station to the goal.
    """

    rows: Rows
    known: Known
    span: Array
    ride: Ride
    rest: Array


class Departure(NamedTuple):
    """When a robot may leave its first station: from `release` to `leave_by` [s].

    It stands there from `since` on; by default it always has.  It is to arrive by `latest` [s].
    """

    release: float
    leave_by: float
    since: float = -math.inf
    latest: float = math.inf


class _States(NamedTuple):
    """The states (n,): those of station k are first[k] to first[k + 1] - 1, in order of time.

    times (n, 2) [s]: their intervals; best [s]: the earliest arrival found so far, with `stops`
    stops before; it comes from state `parent` (-1: none), which the robot left at `depart` [s];
    zone `owner` forbade it to leave earlier (-1: none did); done: no better arrival is possible.
    """

    first: Indices
    times: Array
    station: Indices
    best: Array
    stops: Indices
    parent: Indices
    depart: Array
    owner: Indices
    done: npt.NDArray[np.bool_]


class _Gaps(NamedTuple):
    """When robots may not leave for the moves looked at so far; what overlaps is one interval.

    The closed departures of a move are rows first[k] to last[k] - 1 of `closed`, in order and
    apart; k is the number of the move, and first[k] is -1 before it is looked at.
    """

    first: Indices
    last: Indices
    closed: Closed


class _Move(NamedTuple):
    """A move to station `to` that lasts `lasts` [s] and begins by `latest` [s].

    From there the robot needs at least `left` [s] to its goal.
    """

    to: int
    latest: float
    lasts: float
    left: float


@compiled
def search_among(
    approach: Approach,
    modes: Indices,
    table: Timetable,
    tau: float,
    departure: Departure,
    polite: bool,
) -> tuple[Array, float]:
    """Call `forbid` for the motions in `table`, then return what `search` returns.

    modes (zones,): what each zone demands.  A call from Python with so many arrays takes as long as
    a small search; this function makes one call out of two.
    """
    rows, known, span, ride, rest = approach
    low, high = forbid(rows, modes, table, ride.elapsed, tau, known)
    forbidden = ForbiddenTimes(rows.first, rows.cell, known.begin, known.end, low, high, span)
    return search(ride, forbidden, rest, departure, polite)


@compiled
def search(
    ride: Ride, forbidden: ForbiddenTimes, rest: Array, departure: Departure, polite: bool
) -> tuple[Array, float]:
    """Return the rests (n, 3) of the earliest motion, and its arrival [s]; infinite if none.

    rest (stations,) [s]: the least time from each station to the goal.  A polite robot never waits
    in a zone that the other robot has yet to pass.  A motion that arrives after `departure.latest`
    may be missed.
    """
    release, leave_by, _, until = departure
    first, times = _intervals(ride, forbidden, polite and not ride.at_once)
    start = _start(first, times, departure)
    if start < 0:
        return np.empty((0, 3)), math.inf
    states, goal = _unreached(first, times), len(ride.stations) - 1
    states.best[start] = release
    closed = _closed(len(forbidden.cell) + len(forbidden.low) + 1)
    moves = (goal + 1) if ride.at_once else (goal + 1) * (goal + 1)
    gaps, total = _Gaps(np.full(moves, -1), np.zeros(moves, np.int64), _closed(_ROOM)), 0
    extra = 0.0 if ride.at_once else _PER_STOP
    heap = empty_heap(_ROOM)
    push(heap, release + rest[0], 0, start)
    while heap.size[0] > 0:
        _, here = pop(heap)
        if states.done[here]:
            continue
        states.done[here] = True
        if here == len(times) - 1:
            return _rests(states, here), states.best[here]
        p = states.station[here]
        latest = times[here, END] if p > 0 else min(times[here, END], leave_by)
        if polite and ride.at_once and p > 0 and states.best[here] < _patience(ride, forbidden, p):
            latest = states.best[here]
        # Where stops cost no time, moves to the next station suffice, and the robot waits as far
        # along its path as it can.
        for q in range(min(p + 1, goal) if ride.at_once else goal, p, -1):
            lasts = passing_time(ride, p, q, ride.stations[q, PLACE], 0.0)
            soonest = states.best[here] + lasts + rest[q]
            bound = soonest + extra * states.stops[here]
            if soonest > until or bound > states.best[-1] + extra * states.stops[-1]:
                continue
            k = p if ride.at_once else p * (goal + 1) + q
            if gaps.first[k] < 0:
                count = closed_departures(ride, forbidden, p, q, closed)
                if total + count > len(gaps.closed.begins):
                    gaps = _Gaps(gaps.first, gaps.last, _wider(gaps.closed, total + count))
                order = np.argsort(closed.begins[:count])
                gaps.first[k], total = total, _joined(closed, order, gaps.closed, total)
                gaps.last[k] = total
            begin, end = gaps.first[k], gaps.last[k]
            while heap.size[0] + end - begin >= len(heap.keys):
                heap = wider_heap(heap)
            move = _Move(q, latest, lasts, rest[q])
            _reach(states, gaps.closed, (begin, end), here, move, extra, heap)
    return np.empty((0, 3)), math.inf


@compiled
def _intervals(ride: Ride, forbidden: ForbiddenTimes, polite: bool) -> tuple[Indices, Array]:
    """Return `first` and `times` of _States: when a robot may stand at each of its stations."""
    count = len(ride.stations)
    first, times = np.zeros(count + 1, np.int64), np.empty((count, 2))
    for k in range(count):
        place, cell = ride.stations[k, PLACE], int(ride.stations[k, CELL])
        safe = safe_times(forbidden, place, cell, polite and 0 < k < count - 1)
        while first[k] + len(safe) > len(times):
            times = np.concatenate((times, np.empty_like(times)))
        times[first[k] : first[k] + len(safe)] = safe
        first[k + 1] = first[k] + len(safe)
    return first, times[: first[count]]


@compiled
def _patience(ride: Ride, forbidden: ForbiddenTimes, p: int) -> float:
    """Return the time [s] from which a polite robot may wait at station p; infinite if never."""
    safe = safe_times(forbidden, ride.stations[p, PLACE], int(ride.stations[p, CELL]), True)
    return float(safe[0, BEGIN]) if len(safe) else math.inf


@allocation_free
def _start(first: Indices, times: Array, departure: Departure) -> int:
    """Return the interval in which a robot stands at its start until it may leave.

    -1 if others do not let it stand there for so long, or at its goal for ever.
    """
    release, _, since, _ = departure
    if first[-2] == first[-1] or times[-1, END] < math.inf:
        return -1
    for k in range(first[1]):
        if times[k, BEGIN] <= since and times[k, END] > release:
            return k
    return -1


@compiled
def _unreached(first: Indices, times: Array) -> _States:
    """Return the states of these intervals, none of them reached."""
    total = len(times)
    station = np.empty(total, np.int64)
    for k in range(len(first) - 1):
        station[first[k] : first[k + 1]] = k
    best, stops = np.full(total, math.inf), np.zeros(total, np.int64)
    parent, owner = np.full(total, -1), np.full(total, -1)
    done = np.zeros(total, np.bool_)
    return _States(first, times, station, best, stops, parent, np.zeros(total), owner, done)


@compiled
def _closed(room: int) -> Closed:
    """Return room for closed departures."""
    return Closed(np.empty(room), np.empty(room), np.empty(room, np.int64))


@compiled
def _wider(closed: Closed, least: int) -> Closed:
    """Return the same closed departures with room for at least so many, and for twice as many."""
    old = len(closed.begins)
    wider = _closed(max(2 * old, least))
    wider.begins[:old], wider.ends[:old] = closed.begins, closed.ends
    wider.owners[:old] = closed.owners
    return wider


@allocation_free
def _joined(closed: Closed, order: Indices, into: Closed, total: int) -> int:
    """Write closed departures behind the first `total` of others; return how many there are then.

    order: the closed departures by their begins.  Those that overlap, or nearly touch, become one;
    its owner is the zone that closes its end.
    """
    first = total
    for k in order:
        begin, end = closed.begins[k], closed.ends[k]
        if total > first and begin < into.ends[total - 1] + SOON:
            if end > into.ends[total - 1]:
                into.ends[total - 1], into.owners[total - 1] = end, closed.owners[k]
            continue
        into.begins[total], into.ends[total], into.owners[total] = begin, end, closed.owners[k]
        total += 1
    return total


@allocation_free
def _reach(
    states: _States,
    closed: Closed,
    rows: tuple[int, int],
    here: int,
    move: _Move,
    extra: float,
    heap: Heap,
) -> None:
    """Enter what a move from state `here` can reach into the states and the heap.

    The robot leaves as early as it can in every gap between the closed departures, which are
    rows[0] to rows[1] - 1; `extra` [s]: the penalty for one stop.
    """
    earliest = states.best[here]
    q, latest, lasts, left = move
    at, whose, k = earliest, -1, rows[0]
    while k < rows[1] and closed.begins[k] < at + SOON:
        if closed.ends[k] > at:
            at, whose = closed.ends[k], closed.owners[k]
        k += 1
    while at <= latest and at < math.inf:
        until = latest
        if k < rows[1]:
            until = min(closed.begins[k], latest)
        depart = _rounded(at, until) if at > earliest else at
        there = _interval_at(states, q, depart + lasts)
        stops = states.stops[here]
        if depart > earliest or (extra > 0.0 and states.parent[here] >= 0):
            stops += 1
        if there >= 0 and _is_better(states, there, depart + lasts, stops, extra):
            states.best[there], states.stops[there] = depart + lasts, stops
            states.parent[there], states.depart[there] = here, depart
            states.owner[there] = whose
            push(heap, depart + lasts + extra * stops + left, stops, there)
        if k == rows[1]:
            return
        at, whose = closed.ends[k], closed.owners[k]
        k += 1


@allocation_free
def _rounded(depart: float, latest: float) -> float:
    """Return a departure [s] rounded up to a millisecond if it is then still by `latest`."""
    later = math.ceil(depart * 1000.0) / 1000.0
    return later if later <= latest else depart


@allocation_free
def _interval_at(states: _States, q: int, at: float) -> int:
    """Return the state of station q whose interval contains the time `at` [s]; -1 if none does."""
    k = states.first[q + 1] - 1
    while k >= states.first[q] and states.times[k, BEGIN] > at + SOON:
        k -= 1
    return int(k) if k >= states.first[q] and at <= states.times[k, END] else -1


@allocation_free
def _is_better(states: _States, there: int, arrive: float, stops: int, extra: float) -> bool:
    """Tell whether a way to a state is better than the one known: earlier, or with fewer stops.

    `extra` [s]: the penalty for one stop.
    """
    if states.done[there]:
        return False
    gain = states.best[there] + extra * states.stops[there] - arrive - extra * stops
    return bool(gain > SOON or (gain > -SOON and stops < states.stops[there]))


@compiled
def _rests(states: _States, state: int) -> Array:
    """Return the rests (n, 3) on the way to a state, found by following the parents back."""
    count, at = 0, state
    while states.parent[at] >= 0:
        count, at = count + 1, states.parent[at]
    rests = np.empty((count, 3))
    at = state
    for k in range(count - 1, -1, -1):
        before = states.parent[at]
        waited = states.depart[at] > states.best[before]
        rests[k, STATION] = states.station[before]
        rests[k, DEPARTURE] = max(states.depart[at], states.best[before])
        rests[k, OWNER] = states.owner[at] if waited else -1
        at = before
    return rests
