"""Compiled: when robots with known motions forbid another robot the cells of its path.

Decides: the forbidden times of the rows of zones.  Must not know: how motions are searched.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import allocation_free, compiled
from coordinator.curves.nurbs import Array
from coordinator.curves.nurbs_kernels import Indices

FREE, BOTH, AFTER, FIRST = 0, 1, 2, 3
"""Modes: what a zone demands of a robot.  FREE: nothing.  BOTH: not to be near the other robot,
whoever passes first.  AFTER: to pass after the other robot.  FIRST: to pass before it; only the
other one has to wait, but a polite robot does not stand in the zone."""


class Timetable(NamedTuple):
    """The motions of a fleet as knots: the first knots[i] entries of row i are those of robot i.

    s [m], w = v^2 and t [s] (robots, most knots).  serial (robots,): a new number for every new
    motion.  length (robots,) [m]: the lengths of the paths.
    """

    s: Array
    w: Array
    t: Array
    knots: Indices
    serial: Indices
    length: Array


class Rows(NamedTuple):
    """One robot's zones as rows, row after row of zone after zone.

    Rows first[z] to first[z + 1] - 1 belong to the robot's zone z, which it shares with robot
    other[z] and enters at enters[z] [m], in the cell of its first row.  While the robot is in
    cell[r], it is too near where the other one is between low[r] and high[r] [m].
    """

    first: Indices
    cell: Indices
    low: Array
    high: Array
    other: Indices
    enters: Array


class Known(NamedTuple):
    """What a robot's zones forbid: begin and end (rows,) [s], low and high (zones,) [s].

    All four are those of waiting_kernels.ForbiddenTimes.  stamp (zones,): for which motion of the
    other robot and which mode they were computed.
    """

    begin: Array
    end: Array
    low: Array
    high: Array
    stamp: Indices


class Passage(NamedTuple):
    """A robot's passage through one of its zones; `zone`: the index of that zone in `rows`."""

    robot: int
    rows: Rows
    zone: int


@allocation_free
def _within(table: Timetable, robot: int, leg: int, s: float) -> float:
    """Return when a robot is at s [m] on the leg from knot `leg` to the next one."""
    s0, s1 = table.s[robot, leg], table.s[robot, leg + 1]
    passed = min(max(s - s0, 0.0), s1 - s0)
    part = passed / max(s1 - s0, 1e-12)
    w0, w1 = table.w[robot, leg], table.w[robot, leg + 1]
    both = math.sqrt(w0) + math.sqrt(max(w0 + part * (w1 - w0), 0.0))
    return float(table.t[robot, leg] + (2.0 * passed / both if both > 0.0 else 0.0))


@allocation_free
def reached(table: Timetable, robot: int, s: float) -> float:
    """Return when a robot reaches s [m]; -inf at its start."""
    return first_at(table, robot, s, 0)[0]


@allocation_free
def first_at(table: Timetable, robot: int, s: float, leg: int) -> tuple[float, int]:
    """Return the time [s] at which a robot reaches s [m], and on which leg; -inf at its start.

    The search for the leg begins at `leg`.
    """
    if s <= 0.0:
        return -math.inf, leg
    knots, last = table.s[robot], table.knots[robot] - 2
    while leg > 0 and knots[leg] >= s:
        leg -= 1
    while leg < last and knots[leg + 1] < s:
        leg += 1
    return _within(table, robot, leg, s), leg


@allocation_free
def last_at(table: Timetable, robot: int, s: float, leg: int) -> tuple[float, int]:
    """Return the time [s] at which a robot leaves s [m], and on which leg; infinite at its goal.

    The search for the leg begins at `leg`.
    """
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
    """Bring `known` up to date and return low and high (zones,) [s] for these modes (zones,).

    FREE zones get low = inf and high = -inf, FIRST zones inf for both; their rows are not updated.
    elapsed: that of waiting_kernels.Ride.
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


@allocation_free
def clash(one: Passage, two: Passage, table: Timetable, cell: float, tau: float) -> float:
    """Return when two robots come too near in the zone that they both pass [s]; infinite if never.

    They never do if one of them comes after the other throughout the zone.  `cell` [m]: the length
    of cells.
    """
    if _comes_after(one, table, cell, tau) or _comes_after(two, table, cell, tau):
        return math.inf
    return max(
        reached(table, one.robot, one.rows.enters[one.zone]),
        reached(table, two.robot, two.rows.enters[two.zone]),
        -1.0,
    )


@allocation_free
def _comes_after(passage: Passage, table: Timetable, cell: float, tau: float) -> bool:
    """Tell whether a robot comes after the other one in each row of a zone.

    A robot whose start lies in the zone's first cell, but not in the zone, may come after.
    """
    mine, rows, z = passage
    other, length = rows.other[z], table.length[mine]
    to = since = 0
    for r in range(rows.first[z], rows.first[z + 1]):
        place = min(max(rows.cell[r] * cell, rows.enters[z]), length)
        arrives, to = first_at(table, mine, place, to)
        leaves, since = last_at(table, other, rows.high[r], since)
        if arrives < leaves + tau - 1e-9:
            return False
    return True


@compiled
def meetings(
    rows: Rows, known: Known, table: Timetable, robot: int, cell: float
) -> npt.NDArray[np.bool_]:
    """Return in which of its zones (zones,) a robot is in a cell when the other one forbids it.

    `known` must be up to date for mode BOTH; `cell` [m]: the length of cells.
    """
    met = np.zeros(len(rows.other), np.bool_)
    for z in range(len(rows.other)):
        to = since = 0
        for r in range(rows.first[z], rows.first[z + 1]):
            low = rows.cell[r] * cell
            comes, to = first_at(table, robot, max(low, rows.enters[z]), to)
            goes, since = last_at(table, robot, low + cell, since)
            if comes < known.end[r] - 1e-9 and known.begin[r] + 1e-9 < goes:
                met[z] = True
                break
    return met
