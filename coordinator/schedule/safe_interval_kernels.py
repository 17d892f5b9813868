"""Compiled: the earliest motion of one robot on its path among times that others forbid.

A safe-interval search in one dimension.  States are (station, interval of time in which it may be
stood at); moves lead from rest at one station to rest at a later one without a stop between.

Decides: where and until when one robot waits.  Must not know: who should go first.
"""

from __future__ import annotations

import heapq
import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import compiled
from coordinator.curves.nurbs import Array
from coordinator.curves.nurbs_kernels import Indices
from coordinator.schedule.forbidden_interval_kernels import Known, Rows, Timetable, forbid
from coordinator.schedule.waiting_kernels import (
    CELL,
    PLACE,
    SOON,
    Bans,
    Ride,
    forbidden,
    passing_time,
    safe_times,
)

_PER_STOP: Final = 0.02
"""A stop more has to bring a robot with an acceleration to its goal earlier by this [s]."""


class _States(NamedTuple):
    """States in order of station and time: first[k] to first[k + 1] are those of station k.

    times (n, 2) [s]: when each may be stood at; best [s]: the earliest arrival known, after `stops`
    stops; it comes from state `parent` (-1: none), left at `depart` [s] for the sake of zone
    `owner` (-1: none).
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


class _Closed(NamedTuple):
    """Departures that a move must not have, open intervals [s]; whose; in order of begins."""

    begins: Array
    ends: Array
    owners: Indices
    order: Indices


@compiled
def search_among(
    rows: Rows,
    known: Known,
    span: Array,
    ride: Ride,
    rest: Array,
    modes: Indices,
    table: Timetable,
    tau: float,
    release: float,
    polite: bool,
    leave_by: float,
) -> tuple[Array, float]:
    """Search among motions that are known, with what zones ask: `forbid`, then `search`.

    One call in place of two: passing arrays to compiled code takes as long as small searches do.
    """
    low, high = forbid(rows, modes, table, ride.elapsed, tau, known)
    bans = Bans(rows.first, rows.cell, known.begin, known.end, low, high, span)
    return search(ride, bans, rest, release, polite, leave_by)


@compiled
def search(
    ride: Ride, bans: Bans, rest: Array, release: float, polite: bool, leave_by: float
) -> tuple[Array, float]:
    """Return the rests (n, 3) of the earliest motion, and its arrival [s]; infinite if none.

    A rest: station, departure [s], the zone that it is for (-1: none).  rest (stations,) [s] bounds
    the time from a station to the goal from below; the robot leaves its start from `release` to
    `leave_by` [s].
    A polite one never waits in a zone which the other robot has yet to pass.
    """
    first, times = _intervals(ride, bans, polite and not ride.at_once)
    if _is_hopeless(first, times, release):
        return np.empty((0, 3)), math.inf
    states, goal = _unreached(first, times), len(ride.stations) - 1
    states.best[0] = release
    size = len(bans.cell) + len(bans.low) + 1
    begins, ends, owners = np.empty(size), np.empty(size), np.empty(size, np.int64)
    extra = 0.0 if ride.at_once else _PER_STOP
    heap = [(release + rest[0], 0, 0)]
    while len(heap) > 0:
        _, _, here = heapq.heappop(heap)
        if states.done[here]:
            continue
        states.done[here] = True
        if here == len(times) - 1:
            return _rests(states, here), states.best[here]
        p = states.station[here]
        latest = times[here, 1] if p > 0 else min(times[here, 1], leave_by)
        if polite and ride.at_once and p > 0 and states.best[here] < _patience(ride, bans, p):
            latest = states.best[here]
        # Where stopping costs no time the next station is as good as any other, and waits come as
        # late as they can.
        for q in range(min(p + 1, goal) if ride.at_once else goal, p, -1):
            lasts = passing_time(ride, p, q, ride.stations[q, PLACE], 0.0)
            bound = states.best[here] + lasts + rest[q] + extra * states.stops[here]
            if bound > states.best[-1] + extra * states.stops[-1]:
                continue
            number = forbidden(ride, bans, p, q, begins, ends, owners)
            closed = _Closed(begins, ends, owners, np.argsort(begins[:number]))
            _move(states, closed, here, latest, q, lasts, rest[q], extra, heap)
    return np.empty((0, 3)), math.inf


@compiled
def _intervals(ride: Ride, bans: Bans, polite: bool) -> tuple[Indices, Array]:
    """Return when a robot may stand at its stations: first (stations + 1,), times (n, 2) [s]."""
    count = len(ride.stations)
    first, times = np.zeros(count + 1, np.int64), np.empty((count, 2))
    for k in range(count):
        place, cell = ride.stations[k, PLACE], int(ride.stations[k, CELL])
        safe = safe_times(bans, place, cell, polite and 0 < k < count - 1)
        while first[k] + len(safe) > len(times):
            times = np.concatenate((times, np.empty_like(times)))
        times[first[k] : first[k] + len(safe)] = safe
        first[k + 1] = first[k] + len(safe)
    return first, times[: first[count]]


@compiled
def _patience(ride: Ride, bans: Bans, p: int) -> float:
    """Return from when on a polite robot may wait at a station [s]; infinite if it never may."""
    safe = safe_times(bans, ride.stations[p, PLACE], int(ride.stations[p, CELL]), True)
    return float(safe[0, 0]) if len(safe) else math.inf


@compiled
def _is_hopeless(first: Indices, times: Array, release: float) -> bool:
    """Tell whether the start is not free until the release, or the goal not for ever."""
    if first[1] == 0 or first[-2] == first[-1]:
        return True
    return bool(times[0, 0] > -math.inf or times[0, 1] <= release or times[-1, 1] < math.inf)


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
def _move(
    states: _States,
    closed: _Closed,
    here: int,
    latest: float,
    q: int,
    lasts: float,
    left: float,
    extra: float,
    heap: list[tuple[float, int, int]],
) -> None:
    """Reach the intervals of station q from a state, in every gap between closed departures.

    The move begins by `latest`, it lasts `lasts`, from q it takes at least `left` to the goal, and
    a stop counts `extra` [s].
    """
    earliest = states.best[here]
    at, whose, k = earliest, -1, 0
    while True:
        at, whose, k = _next_gap(closed, at, whose, k)
        if at > latest or at == math.inf:
            return
        until = latest
        if k < len(closed.order):
            until = min(closed.begins[closed.order[k]], latest)
        depart = _rounded(at, until) if at > earliest else at
        there = _interval_at(states, q, depart + lasts)
        stops = states.stops[here]
        if depart > earliest or (extra > 0.0 and states.parent[here] >= 0):
            stops += 1
        if there >= 0 and _is_better(states, there, depart + lasts, stops, extra):
            states.best[there], states.stops[there] = depart + lasts, stops
            states.parent[there], states.depart[there] = here, depart
            states.owner[there] = whose
            heapq.heappush(heap, (depart + lasts + extra * stops + left, stops, there))
        if k == len(closed.order):
            return
        at, whose = closed.ends[closed.order[k]], closed.owners[closed.order[k]]
        k += 1


@compiled
def _next_gap(closed: _Closed, at: float, whose: int, k: int) -> tuple[float, int, int]:
    """Return the first departure from `at` on that is not closed, for whom, what closes after."""
    while k < len(closed.order) and closed.begins[closed.order[k]] < at + SOON:
        if closed.ends[closed.order[k]] > at:
            at, whose = closed.ends[closed.order[k]], closed.owners[closed.order[k]]
        k += 1
    return at, whose, k


@compiled
def _rounded(depart: float, latest: float) -> float:
    """Return a departure rounded up to a millisecond where that is not too late."""
    later = math.ceil(depart * 1000.0) / 1000.0
    return later if later <= latest else depart


@compiled
def _interval_at(states: _States, q: int, at: float) -> int:
    """Return which state of station q has a time in its interval; -1 if none."""
    k = states.first[q + 1] - 1
    while k >= states.first[q] and states.times[k, 0] > at + SOON:
        k -= 1
    return int(k) if k >= states.first[q] and at <= states.times[k, 1] else -1


@compiled
def _is_better(states: _States, there: int, arrive: float, stops: int, extra: float) -> bool:
    """Tell whether a way to a state is better than the one known: earlier, or with fewer stops."""
    if states.done[there]:
        return False
    gain = states.best[there] + extra * states.stops[there] - arrive - extra * stops
    return bool(gain > SOON or (gain > -SOON and stops < states.stops[there]))


@compiled
def _rests(states: _States, state: int) -> Array:
    """Follow the parents back: station, departure and zone of every rest on the way (n, 3)."""
    count, at = 0, state
    while states.parent[at] >= 0:
        count, at = count + 1, states.parent[at]
    rests = np.empty((count, 3))
    at = state
    for k in range(count - 1, -1, -1):
        before = states.parent[at]
        waited = states.depart[at] > states.best[before]
        rests[k, 0] = states.station[before]
        rests[k, 1] = max(states.depart[at], states.best[before])
        rests[k, 2] = states.owner[at] if waited else -1
        at = before
    return rests
