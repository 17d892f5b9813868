"""Compiled: one robot's moves that start at times, among others' that are known.

A plan gives each of a robot's moves the time at which it starts.  Times are the lengths [m] that a
robot drives meanwhile.  Of two moves that come near each other the later one starts when the
earlier robot is out of its way for good, and `gap` later.  So each move of another robot closes an
edge for starts within a window of time, and cuts the time that a robot may rest at a place beside
it into parts.  A robot's moves are found by a search over places and these parts (safe interval
path planning, Phillips and Likhachev 2011).

Decides: where and when one robot moves.  Must not know: what places stand for, how robots
accelerate, who is planned anew (early_neighbourhood_kernels.py).
"""

from __future__ import annotations

import heapq
import math
from typing import Final, NamedTuple

import numpy as np

from coordinator.base.compiled import allocation_free, compiled
from coordinator.places.move_kernels import Array, Edges, Flags, Indices

_LATER: Final = 1e-6
"""A move starts so much [m] after somebody has passed."""


class Meetings(NamedTuple):
    """Edges that come near each other: those of edge e are other[first[e] : first[e + 1]].

    mine: how far [m] along e a robot has driven when it is clear of the other edge for good;
    theirs: the same of a robot on the other edge; stays: whether a robot at the end of e is in the
    way of the other edge.
    """

    first: Indices
    other: Indices
    mine: Array
    theirs: Array
    stays: Flags


class Floor(NamedTuple):
    """What a robot can do on the graph: its edges, their lengths [m], and which may be used.

    The edges that a robot at place v closes are beside[beside_first[v] : beside_first[v + 1]];
    the places beside an edge are passed[passed_first[e] : passed_first[e + 1]].
    """

    edges: Edges
    length: Array
    fits: Flags
    meetings: Meetings
    beside_first: Indices
    beside: Indices
    passed_first: Indices
    passed: Indices
    gap: float


class Rows(NamedTuple):
    """Rows of times in order: row r has size[r] of them from first[r] on, and room up to the next.

    times (m, 3): when a window begins and ends, or twice a time, and when the last one up to it
    ends; whose (m,): the robot.
    """

    first: Indices
    size: Indices
    times: Array
    whose: Indices


class Books(NamedTuple):
    """The windows in which nobody may start on an edge; the times at which a place is passed."""

    edge: Rows
    place: Rows


class Plans(NamedTuple):
    """Each robot's moves: edge (n, most), start (n, most), how many (n,), and arrival (n,)."""

    edge: Indices
    start: Array
    size: Indices
    arrival: Array


@compiled
def _insert(rows: Rows, row: int, begin: float, end: float, robot: int) -> bool:
    """Insert a window into a row; return whether there was room."""
    first, times = rows.first[row], rows.times
    k = first + rows.size[row]
    if k == rows.first[row + 1]:
        return False
    while k > first and times[k - 1, 0] > begin:
        times[k, 0], times[k, 1] = times[k - 1, 0], times[k - 1, 1]
        times[k, 2] = max(times[k - 1, 2], end)
        rows.whose[k] = rows.whose[k - 1]
        k -= 1
    times[k, 0], times[k, 1], rows.whose[k] = begin, end, robot
    times[k, 2] = max(times[k - 1, 2], end) if k > first else end
    rows.size[row] += 1
    return True


@compiled
def _remove(rows: Rows, row: int, begin: float, robot: int) -> None:
    """Remove the window of a robot that begins at a time from a row.

    If there was no room for it, the robot's next one goes, which is to go as well.
    """
    times, whose = rows.times, rows.whose
    k, end = _first_from(rows, row, begin), rows.first[row] + rows.size[row] - 1
    while k <= end and whose[k] != robot:
        k += 1
    if k > end:
        return
    last = times[k - 1, 2] if k > rows.first[row] else -math.inf
    while k < end:
        last = max(last, times[k + 1, 1])
        times[k, 0], times[k, 1], times[k, 2] = times[k + 1, 0], times[k + 1, 1], last
        whose[k] = whose[k + 1]
        k += 1
    rows.size[row] -= 1


@compiled
def _first_from(rows: Rows, row: int, time: float) -> int:
    """Return the index of a row's first window that begins at `time` or later.

    If none does, it is the one after the row's last.
    """
    low = rows.first[row]
    high = low + rows.size[row]
    while low < high:
        middle = (low + high) // 2
        if rows.times[middle, 0] < time:
            low = middle + 1
        else:
            high = middle
    return int(low)


class Windows(NamedTuple):
    """Windows of one robot: edge (n,), and the times (n, 2) between which it closes that."""

    edge: Indices
    times: Array


@allocation_free
def _close(e: int, begin: float, end: float, size: int, windows: Windows, latest: Indices) -> int:
    """Add a window to the first `size` ones, or widen the latest one of its edge if they overlap.

    Returns how many there are then.
    """
    times, k = windows.times, latest[e]
    if k >= 0 and begin < times[k, 1] and times[k, 0] < end:
        times[k, 0], times[k, 1] = min(times[k, 0], begin), max(times[k, 1], end)
        return size
    windows.edge[size], latest[e] = e, size
    times[size, 0], times[size, 1] = begin, end
    return size + 1


@compiled
def windows_of(robot: int, start: int, plans: Plans, floor: Floor) -> Windows:
    """Return the windows in which a robot's moves from the place `start` on close edges."""
    meetings, moves = floor.meetings, plans.size[robot]
    most = floor.beside_first[start + 1] - floor.beside_first[start]
    for e in plans.edge[robot, :moves]:
        most += meetings.first[e + 1] - meetings.first[e]
    windows = Windows(np.empty(most, np.int64), np.empty((most, 2)))
    latest, size = np.full(len(floor.length), -1), 0
    until = plans.start[robot, 0] if moves else math.inf
    for k in range(floor.beside_first[start], floor.beside_first[start + 1]):
        size = _close(floor.beside[k], -math.inf, until, size, windows, latest)
    for number in range(moves):
        e, at = plans.edge[robot, number], plans.start[robot, number]
        onward = plans.start[robot, number + 1] if number + 1 < moves else math.inf
        for k in range(meetings.first[e], meetings.first[e + 1]):
            begin = at - meetings.theirs[k] - floor.gap
            end = at + meetings.mine[k] + floor.gap
            if meetings.stays[k]:
                end = max(end, onward)
            size = _close(meetings.other[k], begin, end, size, windows, latest)
    return Windows(windows.edge[:size], windows.times[:size])


@compiled
def count_windows(
    plans: Plans, starts: Indices, floor: Floor, edges: Indices, places: Indices
) -> None:
    """Add up how many windows all plans enter at edges (E,) and places (V,)."""
    for robot in range(len(starts)):
        for e in windows_of(robot, starts[robot], plans, floor).edge:
            edges[e] += 1
        for e in plans.edge[robot, : plans.size[robot]]:
            for k in range(floor.passed_first[e], floor.passed_first[e + 1]):
                places[floor.passed[k]] += 1


@compiled
def enter(robot: int, start: int, plans: Plans, floor: Floor, books: Books) -> bool:
    """Enter the windows that a robot's moves close, and the places that it passes.

    Returns whether there was room for all.
    """
    room, windows = True, windows_of(robot, start, plans, floor)
    for k in range(len(windows.edge)):
        begin, end = windows.times[k]
        room &= _insert(books.edge, windows.edge[k], begin, end, robot)
    for number in range(plans.size[robot]):
        e, at = plans.edge[robot, number], plans.start[robot, number]
        for k in range(floor.passed_first[e], floor.passed_first[e + 1]):
            room &= _insert(books.place, floor.passed[k], at, at, robot)
    return room


@compiled
def strike_out(robot: int, start: int, plans: Plans, floor: Floor, books: Books) -> None:
    """Take back what `enter` has entered for a robot, all of it."""
    windows = windows_of(robot, start, plans, floor)
    for k in range(len(windows.edge)):
        _remove(books.edge, windows.edge[k], windows.times[k, 0], robot)
    for number in range(plans.size[robot]):
        e, at = plans.edge[robot, number], plans.start[robot, number]
        for k in range(floor.passed_first[e], floor.passed_first[e + 1]):
            _remove(books.place, floor.passed[k], at, robot)


@compiled
def _open_from(e: int, start: float, rows: Rows) -> float:
    """Return the earliest time from `start` on at which an edge is open."""
    first = rows.first[e]
    k, last = _first_from(rows, e, start), first + rows.size[e]
    if k > first:
        start = max(start, rows.times[k - 1, 2])
    while k < last and rows.times[k, 0] < start:
        start = max(start, rows.times[k, 1])
        k += 1
    return start


@compiled
def soonest(
    robot: int, start: int, goal: int, left: Array, floor: Floor, plans: Plans, books: Books,
    latest: float,
) -> int:  # fmt: skip
    """Put the moves of a robot among those of the others into its plan, the earliest to arrive.

    left (V,): the length [m] of the way to the goal.  Returns how many edges were looked at,
    negative if there are no moves by which the robot arrives before `latest`.
    """
    edges = floor.edges
    passing = books.place
    first = np.zeros(len(passing.size) + 1, np.int64)
    first[1:] = np.cumsum(passing.size + 1)
    total = first[-1]
    arrival, parent = np.full(total, math.inf), np.full(total, -1)
    by, started = np.empty(total, np.int64), np.empty(total)
    done = np.zeros(total, np.bool_)
    last = first[goal + 1] - 1
    arrival[first[start]] = 0.0
    heap = [(left[start], first[start], start)]
    spent = 0
    while heap:
        _, state, v = heapq.heappop(heap)
        if done[state]:
            continue
        done[state] = True
        if state == last:
            break
        part = state - first[v]
        limit = math.inf
        if part < passing.size[v]:
            limit = passing.times[passing.first[v] + part, 0]
        for e in range(edges.first[v], edges.first[v + 1]):
            w = edges.to[e]
            if not floor.fits[e] or left[w] == math.inf:
                continue
            spent += 1
            at = arrival[state]
            if at + floor.length[e] + left[w] >= latest:
                continue
            k, end = _first_from(passing, w, at), first[w + 1] - 1
            there = first[w] + k - passing.first[w]
            while True:
                # Parts that end before, or that are reached as early already, are passed over.
                while there < end and (
                    passing.times[k, 0] < at or arrival[there] <= at + floor.length[e]
                ):
                    at = max(at, passing.times[k, 0] + _LATER)
                    k += 1
                    there += 1
                if arrival[there] > at + floor.length[e]:
                    at = _open_from(e, at, books.edge)
                if at >= limit or at + floor.length[e] + left[w] >= latest:
                    break
                if there < end and passing.times[k, 0] < at:
                    continue
                after = at + floor.length[e]
                if after < arrival[there]:
                    arrival[there], parent[there] = after, state
                    by[there], started[there] = e, at
                    heapq.heappush(heap, (after + left[w], there, w))
                if there == end:
                    break
                at = passing.times[k, 0] + _LATER
                k += 1
                there += 1
    if not done[last]:
        return -1 - spent
    size, state = 0, last
    while parent[state] >= 0:
        size += 1
        state = parent[state]
    if size > plans.edge.shape[1]:
        return -1 - spent
    plans.size[robot], plans.arrival[robot] = size, arrival[last]
    state = last
    while parent[state] >= 0:
        size -= 1
        plans.edge[robot, size], plans.start[robot, size] = by[state], started[state]
        state = parent[state]
    return spent


@compiled
def timed(moves: Indices, floor: Floor, plans: Plans) -> None:
    """Put moves (m, 2), robot and edge in turn, into plans: each starts as early as it can."""
    meetings = floor.meetings
    count = len(moves)
    at = np.zeros(count)
    free = np.zeros(len(plans.size))
    ready = np.zeros(len(floor.length))
    for k in range(count):
        robot, e = moves[k]
        at[k] = max(free[robot], ready[e])
        free[robot] = at[k] + floor.length[e]
        for j in range(meetings.first[e], meetings.first[e + 1]):
            f = meetings.other[j]
            ready[f] = max(ready[f], at[k] + meetings.mine[j] + floor.gap)
        size = plans.size[robot]
        plans.edge[robot, size], plans.start[robot, size] = e, at[k]
        plans.size[robot], plans.arrival[robot] = size + 1, free[robot]
