"""Compiled: the earliest way over a mesh in space and time, among robots that come and go.

Safe-interval path planning (Phillips and Likhachev 2011): a state is a cell and an interval of time
in which no other robot forbids it.

Decides: past which side of obstacles, before or behind whom, and where to wait.  Must not know:
curves.
"""

from __future__ import annotations

import heapq
import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import compiled
from coordinator.bends.mesh_kernels import HALF, MOVES, OPEN, Mesh
from coordinator.bends.traffic_kernels import MOST, Traffic, entered, forbidden_at
from coordinator.curves.nurbs import Array
from coordinator.curves.nurbs_kernels import Indices

Flags = npt.NDArray[np.bool_]

LOOK: Final = 0.3
"""Distance [m] between the places looked at on a straight line."""

_HASTE: Final = 1.1
"""The weight of the time that is left to the goal.  The way takes at most so many times as long as
the earliest one, and half as many states are expanded as with a weight of 1."""

SOON: Final = 1e-6
"""Times nearer to each other [s] are the same."""


class Trip(NamedTuple):
    """Where robot number `robot` has to go, and what it needs on its way.

    The cells of its mesh where it enters and leaves it, and its start and goal (2,) [m]; left
    (cells,) [m]: distances to the goal; speed [m/s]; ramp [s]: what speeding up from rest costs,
    and braking; reach [m]: its radius and the margin; tau [s].
    """

    robot: int
    enters: int
    leaves: int
    start: Array
    goal: Array
    left: Array
    speed: float
    ramp: float
    reach: float
    tau: float


class _States(NamedTuple):
    """States (n,): when their cell is free, the earliest arrival there, and from which state."""

    begin: Array
    end: Array
    best: Array
    parent: Indices
    cell: Indices
    done: Flags


class _Move(NamedTuple):
    """A move to a cell that lasts `lasts` [s]; the cell's states are `first` to `last` - 1.

    From there it is at least `left` [s] to the goal.
    """

    to: int
    lasts: float
    first: int
    last: int
    left: float


@compiled
def earliest_way(
    mesh: Mesh, trip: Trip, traffic: Traffic, latest: float, most: int
) -> tuple[Array, Array]:
    """Return the places (n, 2) [m] of the earliest way, and when the robot comes and goes there.

    The times are (n, 2) [s].  Empty if it cannot arrive before `latest` [s], or after `most` states
    were expanded.
    """
    times, closed = np.empty((MOST, 2)), np.empty((MOST, 2))
    lead = _apart(mesh, trip.enters, trip.start) / trip.speed
    tail = _apart(mesh, trip.leaves, trip.goal) / trip.speed
    # The robot stands at its start until it sets out, and at its goal for ever.
    x, y = trip.start
    busy = forbidden_at(traffic, trip.robot, x, y, trip.reach, trip.tau, times)
    until = times[0, 0] if busy > 0 else math.inf
    x, y = trip.goal
    busy = forbidden_at(traffic, trip.robot, x, y, trip.reach, trip.tau, times)
    settled = times[busy - 1, 1] if busy > 0 else -math.inf
    states = _room(4096)
    first = np.full(mesh.columns * mesh.rows, -1)
    count = np.zeros(mesh.columns * mesh.rows, np.int64)
    states.begin[0], states.end[0], states.best[0] = -math.inf, until, trip.ramp
    states.parent[0], states.cell[0], states.done[0] = -1, -1, False
    total, expanded = 1, 0
    moves, lasts = np.empty(2 * HALF, np.int64), np.empty(2 * HALF)
    heap = [(trip.ramp + trip.left[trip.enters] / trip.speed, 0)]
    while len(heap) > 0 and expanded < most and until > 0.0:
        _, here = heapq.heappop(heap)
        if states.done[here]:
            continue
        states.done[here] = True
        expanded += 1
        cell = states.cell[here]
        if cell == trip.leaves:
            arrival = max(states.best[here] + tail, settled)
            if arrival - tail <= states.end[here] and arrival < latest:
                return _traced(mesh, trip, states, here, lead, tail, arrival)
        for k in range(_moves_from(mesh, trip, cell, lead, moves, lasts)):
            to = moves[k]
            if first[to] < 0:
                x, y = _middle(mesh, to)
                busy = forbidden_at(traffic, trip.robot, x, y, trip.reach, trip.tau, times)
                first[to] = total
                states, total = _with_free(states, total, to, times, busy)
                count[to] = total - first[to]
            left = trip.left[to] / trip.speed
            move = _Move(to, lasts[k], first[to], first[to] + count[to], left)
            _relax(mesh, trip, traffic, states, here, move, latest, times, closed, heap)
    return np.empty((0, 2)), np.empty((0, 2))


@compiled
def _relax(
    mesh: Mesh,
    trip: Trip,
    traffic: Traffic,
    states: _States,
    here: int,
    move: _Move,
    latest: float,
    times: Array,
    closed: Array,
    heap: list[tuple[float, int]],
) -> None:
    """Enter earlier arrivals by a move from state `here` into the states and the heap."""
    shut = -1
    for at in range(move.first, move.last):
        if states.done[at] or states.end[at] <= states.best[here] + move.lasts:
            continue
        if max(states.best[here] + move.lasts, states.begin[at]) >= states.best[at] - SOON:
            return
        if shut < 0:
            cell = states.cell[here]
            shut = _closed(mesh, trip, cell, move.to, move.lasts, traffic, times, closed)
        arrival = _departure(states, here, at, move.lasts, trip.ramp, closed, shut) + move.lasts
        if arrival >= min(states.end[at], states.best[at] - SOON):
            continue
        if arrival + move.left < latest:
            states.best[at], states.parent[at] = arrival, here
            heapq.heappush(heap, (arrival + _HASTE * move.left, at))


@compiled
def _moves_from(
    mesh: Mesh, trip: Trip, cell: int, lead: float, moves: Indices, lasts: Array
) -> int:
    """Enter to which cells one can move from a cell, and how long that lasts [s]; return how many.

    From its start, cell -1, a robot moves to where it enters the mesh, in `lead` [s].
    """
    if cell < 0:
        moves[0], lasts[0] = trip.enters, lead
        return 1
    n = 0
    for k in range(2 * HALF):
        if mesh.codes[cell, k] == OPEN or mesh.codes[cell, k] == trip.robot:
            x, y = MOVES[k]
            moves[n] = cell + y * mesh.columns + x
            lasts[n] = mesh.size * math.sqrt(x * x + y * y) / trip.speed
            n += 1
    return n


@compiled
def _departure(
    states: _States, here: int, at: int, lasts: float, ramp: float, closed: Array, shut: int
) -> float:
    """Return the earliest departure [s] from one state for another; infinite if there is none.

    closed (shut, 2) [s]: departures that others forbid.  A rest on the way costs the time for
    braking and speeding up; at its start a robot rests anyway.
    """
    now = states.best[here]
    at_start = states.cell[here] < 0
    rested = now if at_start else now + 2.0 * ramp
    leave = states.begin[at] - lasts
    leave = max(leave, rested) if leave > now else now
    for j in range(shut):
        if closed[j, 0] < leave < closed[j, 1]:
            leave = max(closed[j, 1], rested)
    stands = leave - (ramp if at_start else 0.0)
    return leave if stands <= states.end[here] else math.inf


@compiled
def _closed(
    mesh: Mesh,
    trip: Trip,
    cell: int,
    to: int,
    lasts: float,
    traffic: Traffic,
    times: Array,
    closed: Array,
) -> int:
    """Enter the departures for a move that others forbid on its way into closed (m, 2) [s].

    Returns how many there are, in order.  `cell` is -1 for the move from the start.
    """
    x0, y0 = (trip.start[0], trip.start[1]) if cell < 0 else _middle(mesh, cell)
    x1, y1 = _middle(mesh, to)
    pieces = int(math.hypot(x1 - x0, y1 - y0) / LOOK) + 1
    n = 0
    for j in range(1, pieces):
        share = j / pieces
        x, y = x0 + share * (x1 - x0), y0 + share * (y1 - y0)
        busy = forbidden_at(traffic, trip.robot, x, y, trip.reach, trip.tau, times)
        for i in range(busy):
            n = entered(closed, n, times[i, 0] - share * lasts, times[i, 1] - share * lasts)
    return n


@compiled
def _middle(mesh: Mesh, cell: int) -> tuple[float, float]:
    """Return the middle of a cell [m]."""
    return (
        mesh.x + (cell % mesh.columns) * mesh.size,
        mesh.y + (cell // mesh.columns) * mesh.size,
    )


@compiled
def _apart(mesh: Mesh, cell: int, place: Array) -> float:
    """Return the distance [m] of a place (2,) from the middle of a cell."""
    x, y = _middle(mesh, cell)
    return math.hypot(x - place[0], y - place[1])


@compiled
def _room(size: int) -> _States:
    """Return room for states."""
    begin, end, best = np.empty(size), np.empty(size), np.empty(size)
    parent, cell = np.empty(size, np.int64), np.empty(size, np.int64)
    return _States(begin, end, best, parent, cell, np.zeros(size, np.bool_))


@compiled
def _wider(states: _States) -> _States:
    """Return the same states with room for twice as many."""
    old = len(states.begin)
    fresh = _room(2 * old)
    fresh.begin[:old], fresh.end[:old], fresh.best[:old] = states.begin, states.end, states.best
    fresh.parent[:old], fresh.cell[:old], fresh.done[:old] = states.parent, states.cell, states.done
    return fresh


@compiled
def _with_free(
    states: _States, total: int, cell: int, times: Array, busy: int
) -> tuple[_States, int]:
    """Add the intervals in which a cell is free; return the states, and how many there are then."""
    if total + busy + 1 > len(states.begin):
        states = _wider(states)
    since = -math.inf
    for j in range(busy + 1):
        stop = times[j, 0] if j < busy else math.inf
        if stop > since and stop > 0.0:
            states.begin[total], states.end[total] = since, stop
            states.best[total], states.parent[total] = math.inf, -1
            states.cell[total], states.done[total] = cell, False
            total += 1
        if j < busy:
            since = times[j, 1]
    return states, total


@compiled
def _traced(
    mesh: Mesh, trip: Trip, states: _States, last: int, lead: float, tail: float, arrival: float
) -> tuple[Array, Array]:
    """Return the places and times of the way that ends in a state, without places on a straight."""
    n, at = 1, last
    while at >= 0:
        n += 1
        at = states.parent[at]
    way, when = np.empty((n, 2)), np.empty((n, 2))
    way[0], way[n - 1] = trip.start, trip.goal
    when[n - 1] = arrival
    at, leave = last, arrival - tail
    for k in range(n - 2, 0, -1):
        way[k, 0], way[k, 1] = _middle(mesh, states.cell[at])
        when[k, 0], when[k, 1] = states.best[at], leave
        lasts = lead
        if k > 1:
            x, y = _middle(mesh, states.cell[states.parent[at]])
            lasts = math.hypot(way[k, 0] - x, way[k, 1] - y) / trip.speed
        leave = states.best[at] - lasts
        at = states.parent[at]
    when[0, 0], when[0, 1] = 0.0, leave
    kept = 1
    for k in range(1, n):
        if k < n - 1 and when[k, 1] <= when[k, 0] + SOON:
            ax, ay = way[k, 0] - way[kept - 1, 0], way[k, 1] - way[kept - 1, 1]
            bx, by = way[k + 1, 0] - way[k, 0], way[k + 1, 1] - way[k, 1]
            if abs(ax * by - ay * bx) < 1e-9 and ax * bx + ay * by > 0.0:
                continue
        way[kept], when[kept] = way[k], when[k]
        kept += 1
    return way[:kept], when[:kept]
