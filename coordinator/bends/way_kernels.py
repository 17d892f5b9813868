"""Compiled: the earliest way over a mesh in space and time, among robots that come and go.

Safe-interval path planning (Phillips and Likhachev 2011): a state is a cell and an interval of time
in which no other robot forbids it.

Decides: past which side of obstacles, before or behind whom, and where to wait.  Must not know:
curves.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import allocation_free, compiled
from coordinator.base.heap_kernels import Heap, empty_heap, pop, push, wider_heap
from coordinator.bends.mesh_kernels import HALF, LENGTHS, MOVES, OPEN, Mesh
from coordinator.bends.traffic_kernels import MOST, Traffic, entered, forbidden_at, free_from
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

_EXPAND: Final = -1
_MOVE: Final = -2 * HALF - 1
"""What follows from a state: _EXPAND for all moves, _MOVE + k for move k, or the number of the
state that a move leads to.  The heap holds states with their weighed times [s] and what follows."""

_NONE: Final = -1
_FULL: Final = -2
"""What a search returns in place of a state: there is no way, or no more room."""

_ROOM: Final = 4096
"""For how many states, and half as many entries of the heap, there is room at first."""

_MOST_ADDED: Final = MOST + 2 * HALF
"""How many states or entries of the heap one step of the search adds at most."""


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


class _Search(NamedTuple):
    """A trip on a mesh in traffic, and what a search for its earliest way has looked up so far.

    latest [s]: when the robot has to arrive; settled [s]: from when on its goal is free for ever;
    lead, tail [s]: how long it takes from its start to the mesh, and from there to its goal.  The
    states of a cell are first[cell] to last[cell] - 1; both are -1 before a move to the cell is
    looked at.  times, closed (MOST, 2): memory for intervals [s].
    """

    mesh: Mesh
    trip: Trip
    traffic: Traffic
    latest: float
    settled: float
    lead: float
    tail: float
    first: Indices
    last: Indices
    times: Array
    closed: Array


@compiled
def earliest_way(
    mesh: Mesh, trip: Trip, traffic: Traffic, latest: float, most: int
) -> tuple[Array, Array]:
    """Return the places (n, 2) [m] of the earliest way, and when the robot comes and goes there.

    The times are (n, 2) [s].  Empty if it cannot arrive before `latest` [s], or after `most` states
    were expanded.  What others forbid to a move is looked up when that move comes first at the
    earliest time it could have (lazy weighted A*, Cohen et al. 2014): most moves never do.
    """
    cells, times = mesh.columns * mesh.rows, np.empty((MOST, 2))
    lead = _apart(mesh, trip.enters, trip.start) / trip.speed
    tail = _apart(mesh, trip.leaves, trip.goal) / trip.speed
    # The robot stands at its start until it sets out, and at its goal for ever.
    x, y = trip.start
    busy = forbidden_at(traffic, trip.robot, x, y, trip.reach, trip.tau, times)
    until = times[0, 0] if busy > 0 else math.inf
    x, y = trip.goal
    settled = free_from(traffic, trip.robot, x, y, trip.reach, trip.tau)
    first, last, closed = np.full(cells, -1), np.full(cells, -1), np.empty((MOST, 2))
    search = _Search(mesh, trip, traffic, latest, settled, lead, tail, first, last, times, closed)
    states, heap = _room(_ROOM), empty_heap(2 * _ROOM)
    states.begin[0], states.end[0], states.best[0] = -math.inf, until, trip.ramp
    states.parent[0], states.cell[0], states.done[0] = -1, -1, False
    push(heap, trip.ramp, 0, _EXPAND)
    goal, total, left = _NONE, 1, most if until > 0.0 else 0
    while left > 0:
        goal, total, left = _searched(search, states, heap, total, left)
        if goal != _FULL:
            break
        states, heap = _wider(states), wider_heap(heap)
    if goal < 0:
        return np.empty((0, 2)), np.empty((0, 2))
    return _traced(search, states, goal)


@allocation_free
def _searched(
    search: _Search, states: _States, heap: Heap, total: int, left: int
) -> tuple[int, int, int]:
    """Go on with a search in which there are `total` states and `left` more may be expanded.

    Return the state at the goal, or _NONE without a way, or _FULL if there is no room for more
    states; and both numbers as they are then.
    """
    mesh, trip, times = search.mesh, search.trip, search.times
    while heap.size[0] > 0 and left > 0:
        if min(len(states.begin) - total, len(heap.keys) - heap.size[0]) < _MOST_ADDED:
            return _FULL, total, left
        here, what = pop(heap)
        if what >= 0:
            _enter(search, states, here, what, heap)
        elif what != _EXPAND:
            to, lasts = _moved(search, states.cell[here], what - _MOVE)
            if search.first[to] < 0:
                x, y = _middle(mesh, to)
                busy = forbidden_at(search.traffic, trip.robot, x, y, trip.reach, trip.tau, times)
                search.first[to] = total
                total = _with_free(states, total, to, times, busy)
                search.last[to] = total
            _look(search, states, here, to, lasts, heap)
        elif not states.done[here]:
            states.done[here] = True
            left -= 1
            if states.cell[here] == trip.leaves:
                leave = _arrival(search, states, here) - search.tail
                if leave <= states.end[here] and leave + search.tail < search.latest:
                    return here, total, left
            _expand(search, states, here, heap)
    return _NONE, total, left


@allocation_free
def _arrival(search: _Search, states: _States, last: int) -> float:
    """Return when [s] the robot arrives at its goal from the state where it leaves the mesh."""
    return float(max(states.best[last] + search.tail, search.settled))


@allocation_free
def _expand(search: _Search, states: _States, here: int, heap: Heap) -> None:
    """Put the moves from a state on the heap, unless their cells are known to be reached before."""
    mesh, trip, cell = search.mesh, search.trip, states.cell[here]
    for k in range(1 if cell < 0 else 2 * HALF):
        if cell >= 0 and mesh.codes[cell, k] != OPEN and mesh.codes[cell, k] != trip.robot:
            continue
        to, lasts = _moved(search, cell, k)
        arrival, left = states.best[here] + lasts, trip.left[to] / trip.speed
        if arrival + left >= search.latest:
            continue
        if search.first[to] >= 0:
            at, last = search.first[to], search.last[to]
            while at < last and states.end[at] <= arrival:
                at += 1
            if at == last or max(arrival, states.begin[at]) >= states.best[at] - SOON:
                continue
        push(heap, _weighed(search, arrival, left), here, _MOVE + k)


@allocation_free
def _look(search: _Search, states: _States, here: int, to: int, lasts: float, heap: Heap) -> None:
    """Move from a state to a cell at once, and put moves to it after a rest on the heap."""
    trip, at_start = search.trip, states.cell[here] < 0
    arrival, final = states.best[here] + lasts, states.end[here] + lasts
    rested = arrival + 2.0 * trip.ramp
    if at_start:
        rested, final = arrival, final + trip.ramp
    for at in range(search.first[to], search.last[to]):
        if states.end[at] <= arrival:
            continue
        soonest = arrival if states.begin[at] <= arrival else max(states.begin[at], rested)
        if states.begin[at] > final or soonest >= states.best[at] - SOON:
            return
        if soonest == arrival:
            _enter(search, states, here, at, heap)
        elif soonest < states.end[at]:
            left = trip.left[to] / trip.speed
            push(heap, _weighed(search, soonest, left), here, at)


@allocation_free
def _enter(search: _Search, states: _States, here: int, at: int, heap: Heap) -> None:
    """Move from state `here` to state `at`, if that is earlier than all moves so far."""
    trip, cell, to = search.trip, states.cell[here], states.cell[at]
    lasts = search.lead if cell < 0 else _between(search.mesh, cell, to) / trip.speed
    if max(states.best[here] + lasts, states.begin[at]) >= states.best[at] - SOON:
        return
    shut = _closed(search, cell, to, lasts)
    arrival = _departure(states, here, at, lasts, trip.ramp, search.closed, shut) + lasts
    left = trip.left[to] / trip.speed
    if arrival < min(states.end[at], states.best[at] - SOON, search.latest - left):
        states.best[at], states.parent[at] = arrival, here
        push(heap, _weighed(search, arrival, left), at, _EXPAND)


@allocation_free
def _weighed(search: _Search, arrival: float, left: float) -> float:
    """Return the weighed time [s] of an arrival `left` [s] before the goal.

    Before the goal is free for ever nobody arrives there: up to then what is left counts alone.
    """
    return max(arrival + left, search.settled) + (_HASTE - 1.0) * left


@allocation_free
def _moved(search: _Search, cell: int, k: int) -> tuple[int, float]:
    """Return to which cell move k leads from a cell, and how long it lasts [s].

    From its start, cell -1, a robot moves to where it enters the mesh.
    """
    if cell < 0:
        return search.trip.enters, search.lead
    far = search.mesh.size * LENGTHS[k]
    return cell + MOVES[k, 1] * search.mesh.columns + MOVES[k, 0], far / search.trip.speed


@allocation_free
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


@allocation_free
def _closed(search: _Search, cell: int, to: int, lasts: float) -> int:
    """Enter the departures for a move that others forbid on its way into closed (m, 2) [s].

    Returns how many there are, in order.  `cell` is -1 for the move from the start.
    """
    mesh, trip, times = search.mesh, search.trip, search.times
    x0, y0 = (trip.start[0], trip.start[1]) if cell < 0 else _middle(mesh, cell)
    x1, y1 = _middle(mesh, to)
    pieces = int(math.hypot(x1 - x0, y1 - y0) / LOOK) + 1
    n = 0
    for j in range(1, pieces):
        share = j / pieces
        x, y = x0 + share * (x1 - x0), y0 + share * (y1 - y0)
        busy = forbidden_at(search.traffic, trip.robot, x, y, trip.reach, trip.tau, times)
        for i in range(busy):
            begin, end = times[i, 0] - share * lasts, times[i, 1] - share * lasts
            n = entered(search.closed, n, begin, end)
    return n


@allocation_free
def _middle(mesh: Mesh, cell: int) -> tuple[float, float]:
    """Return the middle of a cell [m]."""
    return (
        mesh.x + (cell % mesh.columns) * mesh.size,
        mesh.y + (cell // mesh.columns) * mesh.size,
    )


@allocation_free
def _apart(mesh: Mesh, cell: int, place: Array) -> float:
    """Return the distance [m] of a place (2,) from the middle of a cell."""
    x, y = _middle(mesh, cell)
    return math.hypot(x - place[0], y - place[1])


@allocation_free
def _between(mesh: Mesh, cell: int, to: int) -> float:
    """Return the distance [m] of the middles of two cells."""
    x0, y0 = _middle(mesh, cell)
    x1, y1 = _middle(mesh, to)
    return math.hypot(x1 - x0, y1 - y0)


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


@allocation_free
def _with_free(states: _States, total: int, cell: int, times: Array, busy: int) -> int:
    """Add the intervals in which a cell is free to `total` states; return how many there are."""
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
    return total


@compiled
def _traced(search: _Search, states: _States, last: int) -> tuple[Array, Array]:
    """Return the places and times of the way that ends in a state, without places on a straight."""
    mesh, trip, arrival = search.mesh, search.trip, _arrival(search, states, last)
    n, at = 1, last
    while at >= 0:
        n += 1
        at = states.parent[at]
    way, when = np.empty((n, 2)), np.empty((n, 2))
    way[0], way[n - 1] = trip.start, trip.goal
    when[n - 1] = arrival
    at, leave = last, arrival - search.tail
    for k in range(n - 2, 0, -1):
        way[k, 0], way[k, 1] = _middle(mesh, states.cell[at])
        when[k, 0], when[k, 1] = states.best[at], leave
        lasts = search.lead
        if k > 1:
            lasts = _between(mesh, states.cell[states.parent[at]], states.cell[at]) / trip.speed
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
