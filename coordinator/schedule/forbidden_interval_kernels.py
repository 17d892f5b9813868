"""Compiled: the times at which robots with known motions forbid another robot its cells.

Decides: the forbidden times of the rows of zones.  Must not know: how they are searched.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from coordinator.base.compiled import compiled
from coordinator.curves.nurbs import Array
from coordinator.curves.nurbs_kernels import Indices

FREE, BOTH, AFTER, FIRST = 0, 1, 2, 3
"""What a zone demands of a robot: nothing; not to be near the other one; to pass after it; to pass
first and, if polite, not to stand in the zone."""


class Timetable(NamedTuple):
    """The motions of a fleet: robot i's knots s [m], v^2 and t [s] are the first knots[i] of row i.

    Rows are (robots, most knots); serial (robots,) is a new number for every new motion; length
    (robots,) [m] of the paths.
    """

    s: Array
    w: Array
    t: Array
    knots: Indices
    serial: Indices
    length: Array


class Rows(NamedTuple):
    """One robot's zones as rows: while it is in cell[r], `other` conflicts from low[r] to high[r].

    Rows first[z] to first[z + 1] belong to its zone z, which it has with robot other[z] and enters
    at enters[z] [m], somewhere in the first cell.
    """

    first: Indices
    cell: Indices
    low: Array
    high: Array
    other: Indices
    enters: Array


class Known(NamedTuple):
    """What a robot's rows forbid, begin and end (rows,) [s], and its zones, low and high (zones,).

    Zone times are those of a start from which the robot never stops, as in waiting_kernels.Bans.
    stamp (zones,) says of which motion of the other robot, and in which mode.
    """

    begin: Array
    end: Array
    low: Array
    high: Array
    stamp: Indices


@compiled
def _within(table: Timetable, robot: int, leg: int, s: float) -> float:
    """Return when a robot is at s [m] on the leg between two knots."""
    s0, s1 = table.s[robot, leg], table.s[robot, leg + 1]
    passed = min(max(s - s0, 0.0), s1 - s0)
    part = passed / max(s1 - s0, 1e-12)
    w0, w1 = table.w[robot, leg], table.w[robot, leg + 1]
    both = math.sqrt(w0) + math.sqrt(max(w0 + part * (w1 - w0), 0.0))
    return float(table.t[robot, leg] + (2.0 * passed / both if both > 0.0 else 0.0))


@compiled
def reached(table: Timetable, robot: int, s: float) -> float:
    """Return when a robot reaches s [m]; -inf at its start."""
    return first_at(table, robot, s, 0)[0]


@compiled
def first_at(table: Timetable, robot: int, s: float, leg: int) -> tuple[float, int]:
    """Return the time of `reached` and its leg; the search for the leg begins at `leg`."""
    if s <= 0.0:
        return -math.inf, leg
    knots, last = table.s[robot], table.knots[robot] - 2
    while leg > 0 and knots[leg] >= s:
        leg -= 1
    while leg < last and knots[leg + 1] < s:
        leg += 1
    return _within(table, robot, leg, s), leg


@compiled
def last_at(table: Timetable, robot: int, s: float, leg: int) -> tuple[float, int]:
    """Return when a robot leaves s [m], inf at its goal, and the leg, as `first_at` does."""
    if s >= table.length[robot]:
        return math.inf, leg
    knots, last = table.s[robot], table.knots[robot] - 2
    while leg > 0 and knots[leg] > s:
        leg -= 1
    while leg < last and knots[leg + 1] <= s:
        leg += 1
    return _within(table, robot, leg, s), leg


@compiled
def forbid(
    rows: Rows, modes: Indices, table: Timetable, elapsed: Array, tau: float, known: Known
) -> tuple[Array, Array]:
    """Update what a robot's zones forbid; return low and high (zones,) [s].

    Zones that demand nothing have low above high; zones to pass first have infinity for both.  The
    rows of these zones are not updated.
    """
    zones = len(rows.other)
    low, high = np.full(zones, math.inf), np.full(zones, -math.inf)
    for z in range(zones):
        if modes[z] == FREE:
            continue
        if modes[z] == FIRST:
            high[z] = math.inf
            continue
        other = rows.other[z]
        stamp = 2 * table.serial[other] + (modes[z] == AFTER)
        if known.stamp[z] != stamp:
            known.stamp[z] = stamp
            known.low[z], known.high[z] = math.inf, -math.inf
            to = since = 0
            for r in range(rows.first[z], rows.first[z + 1]):
                begin = -math.inf
                if modes[z] == BOTH:
                    begin, to = first_at(table, other, rows.low[r], to)
                    begin -= tau
                end, since = last_at(table, other, rows.high[r], since)
                end += tau
                known.begin[r], known.end[r] = begin, end
                known.low[z] = min(known.low[z], begin - elapsed[rows.cell[r] + 1])
                known.high[z] = max(known.high[z], end - elapsed[rows.cell[r]])
        low[z], high[z] = known.low[z], known.high[z]
    return low, high


@compiled
def clash(
    one: Rows, two: Rows, z: int, y: int, a: int, b: int, table: Timetable, cell: float, tau: float
) -> float:
    """Return when robots a and b come too near in a zone [s]; infinite if they never do.

    It is zone z of the rows `one` of robot a, zone y of the rows `two` of robot b.  They do not if
    one of them comes after the other throughout the zone.
    """
    if _comes_after(one, z, a, table, cell, tau) or _comes_after(two, y, b, table, cell, tau):
        return math.inf
    return max(reached(table, a, one.enters[z]), reached(table, b, two.enters[y]), -1.0)


@compiled
def _comes_after(rows: Rows, z: int, mine: int, table: Timetable, cell: float, tau: float) -> bool:
    """Tell whether robot `mine` comes after the other one at each row of its zone z.

    A robot whose start lies in the zone's first cell, but not in the zone, may come after.
    """
    other, length = rows.other[z], table.length[mine]
    to = since = 0
    for r in range(rows.first[z], rows.first[z + 1]):
        place = min(max(rows.cell[r] * cell, rows.enters[z]), length)
        arrives, to = first_at(table, mine, place, to)
        leaves, since = last_at(table, other, rows.high[r], since)
        if arrives < leaves + tau - 1e-9:
            return False
    return True
