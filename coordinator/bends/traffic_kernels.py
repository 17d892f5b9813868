"""Compiled: where robots are and when, and which times they forbid to others.

Decides: how moving robots are kept as samples on a grid.  Must not know: how ways are searched.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from coordinator.base.compiled import allocation_free, compiled
from coordinator.curves.nurbs import Array
from coordinator.curves.nurbs_kernels import Indices

X, Y, BEGIN, END, RADIUS = range(5)
"""Columns of samples: a place [m], from when to when a robot is near it [s], its radius [m]."""


MOST: Final = 128
"""Greatest number of separate times in which others forbid a place."""

_MOST_DELAYS: Final = 2048
"""Greatest number of separate times in which others forbid a departure."""


class Traffic(NamedTuple):
    """Samples (n, 5) of robots `owner` (n,), by cells of a grid.

    The samples of cell c are samples[first[c] : first[c + 1]].  The grid's lower left corner is
    (x, y) [m]; its cells have a side of `size` [m].
    """

    samples: Array
    owner: Indices
    first: Indices
    x: float
    y: float
    size: float
    columns: int
    rows: int


class Errand(NamedTuple):
    """What bounds where a robot can be, and when.

    It does not leave `start` (2,) [m] before `leaves` [s], is at `goal` (2,) [m] from `latest` [s]
    on, and is never faster than `speed` [m/s].
    """

    start: Array
    goal: Array
    leaves: float
    latest: float
    speed: float


@compiled
def part_met(
    samples: Array, errand: Errand, need: float, tau: float, delay: float
) -> tuple[int, int]:
    """Return which of a course's samples (n, 5) a robot can meet on an errand: first, end.

    It meets a sample if it can be nearer than `need` [m] to the place from `tau` [s] before its
    owner is there until `tau` after; the owner is late by up to `delay` [s].  Those before the
    first and from the end on it cannot meet.
    """
    first, end = 0, len(samples)
    (x, y), (u, v) = errand.start, errand.goal
    while first < end:
        one = samples[first]
        since = errand.leaves + (math.hypot(one[X] - x, one[Y] - y) - need) / errand.speed
        if one[END] + delay + tau >= since:
            break
        first += 1
    while end > first:
        one = samples[end - 1]
        far = max(math.hypot(one[X] - u, one[Y] - v) - need, 0.0)
        if far == 0.0 or one[BEGIN] - tau <= errand.latest - far / errand.speed:
            break
        end -= 1
    return first, end


@compiled
def gathered(
    samples: Array, owner: Indices, x: float, y: float, size: float, columns: int, rows: int
) -> Traffic:
    """Return samples sorted by the cells of a grid."""
    count = len(samples)
    cell = np.empty(count, np.int64)
    first = np.zeros(columns * rows + 1, np.int64)
    for k in range(count):
        column = min(max(int((samples[k, X] - x) / size), 0), columns - 1)
        row = min(max(int((samples[k, Y] - y) / size), 0), rows - 1)
        cell[k] = row * columns + column
        first[cell[k] + 1] += 1
    for c in range(columns * rows):
        first[c + 1] += first[c]
    at = first[:-1].copy()
    ordered, whose = np.empty_like(samples), np.empty(count, np.int64)
    for k in range(count):
        place = at[cell[k]]
        at[cell[k]] += 1
        ordered[place], whose[place] = samples[k], owner[k]
    return Traffic(ordered, whose, first, x, y, size, columns, rows)


@allocation_free
def forbidden_at(
    traffic: Traffic, without: int, x: float, y: float, reach: float, tau: float, out: Array
) -> int:
    """Enter the times at which others forbid a place into out (m, 2) [s]; return how many.

    Others forbid it while they are nearer than their radius and `reach` [m], and `tau` [s] before
    and after.  The times are in order and do not overlap; if there are more than m, the last one
    has no end.  Robot `without` forbids nothing.
    """
    n = 0
    for row in range(-1, 2):
        first, last = _in_row(traffic, x, y, row)
        for k in range(first, last):
            dx, dy = traffic.samples[k, X] - x, traffic.samples[k, Y] - y
            need = reach + traffic.samples[k, RADIUS]
            if dx * dx + dy * dy < need * need and traffic.owner[k] != without:
                begin, end = traffic.samples[k, BEGIN] - tau, traffic.samples[k, END] + tau
                n = entered(out, n, begin, end)
    return n


@compiled
def free_from(
    traffic: Traffic, without: int, x: float, y: float, reach: float, tau: float
) -> float:
    """Return from when on [s] nobody forbids a place; -inf if nobody ever does."""
    times = np.empty((MOST, 2))
    busy = forbidden_at(traffic, without, x, y, reach, tau, times)
    return float(times[busy - 1, 1]) if busy > 0 else -math.inf


@allocation_free
def _in_row(traffic: Traffic, x: float, y: float, row: int) -> tuple[int, int]:
    """Return the range of the samples in the cells around a place, in one row of these.

    row: 0 for that of the place, -1 and 1 for those below and above.
    """
    column, row = int((x - traffic.x) / traffic.size), row + int((y - traffic.y) / traffic.size)
    low, high = max(column - 1, 0), min(column + 1, traffic.columns - 1)
    if low > high or not 0 <= row < traffic.rows:
        return 0, 0
    begin = row * traffic.columns
    return traffic.first[begin + low], traffic.first[begin + high + 1]


@allocation_free
def entered(out: Array, n: int, begin: float, end: float) -> int:
    """Enter an interval among n that are in order and apart; return how many there are then."""
    low = n
    while low > 0 and out[low - 1, 1] >= begin:
        low -= 1
    high = low
    while high < n and out[high, 0] <= end:
        begin, end = min(begin, out[high, 0]), max(end, out[high, 1])
        high += 1
    if high == low:
        if n == len(out):
            if low == n:
                out[n - 1, 1] = math.inf
                return n
            out[n - 2, 1] = math.inf
            n -= 1
        for k in range(n, low, -1):
            out[k, 0], out[k, 1] = out[k - 1, 0], out[k - 1, 1]
        n += 1
    else:
        gone = high - low - 1
        if gone > 0:
            for k in range(high, n):
                out[k - gone, 0], out[k - gone, 1] = out[k, 0], out[k, 1]
            n -= gone
    out[low, 0], out[low, 1] = begin, end
    return n


@compiled
def first_meeting(own: Array, traffic: Traffic, robot: int, reach: float, tau: float) -> int:
    """Return the first of a robot's samples (n, 5) that others forbid; -1 if there is none."""
    times = np.empty((MOST, 2))
    for k in range(len(own)):
        count = forbidden_at(traffic, robot, own[k, X], own[k, Y], reach, tau, times)
        for i in range(count):
            if times[i, 0] < own[k, END] and own[k, BEGIN] < times[i, 1]:
                return k
    return -1


@compiled
def count_meetings(
    own: Array, traffic: Traffic, robot: int, reach: float, tau: float, count: int
) -> Indices:
    """Return how many pairs of samples, one of a robot's (n, 5), each of `count` robots forbids."""
    found = np.zeros(count, np.int64)
    for j in range(len(own)):
        for row in range(-1, 2):
            first, last = _in_row(traffic, own[j, X], own[j, Y], row)
            for k in range(first, last):
                other, whose = traffic.samples[k], traffic.owner[k]
                if other[BEGIN] - tau >= own[j, END] or own[j, BEGIN] >= other[END] + tau:
                    continue
                far = math.hypot(other[X] - own[j, X], other[Y] - own[j, Y])
                if whose != robot and far < reach + other[RADIUS]:
                    found[whose] += 1
    return found


@compiled
def least_delay(own: Array, traffic: Traffic, robot: int, reach: float, tau: float) -> float:
    """Return by how much later [s] a robot has to leave its start so that others allow its motion.

    own (n, 5): the samples of its motion without a delay, those of the start and the goal at the
    ends.  Infinite if no delay will do.
    """
    times, closed = np.empty((MOST, 2)), np.empty((_MOST_DELAYS, 2))
    n, latest = 0, math.inf
    for k in range(len(own)):
        count = forbidden_at(traffic, robot, own[k, X], own[k, Y], reach, tau, times)
        for i in range(count):
            begin, end = times[i, 0] - own[k, END], times[i, 1] - own[k, BEGIN]
            if own[k, BEGIN] == -math.inf:
                latest = min(latest, begin)
            elif end > 0.0:
                n = entered(closed, n, begin, end)
    delay = 0.0
    for i in range(n):
        if closed[i, 0] < delay:
            delay = max(delay, closed[i, 1])
    return delay if delay <= latest else math.inf
