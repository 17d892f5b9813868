"""Compiled: all zones of some robots with the others of a fleet.

Decides: the order in which robots are searched and zones are returned.  Must not know: tasks,
executors.
"""

from __future__ import annotations

from typing import Final, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import allocation_free, compiled
from coordinator.curves.nurbs_kernels import Array, Indices
from coordinator.schedule.broad_phase_kernels import (
    MINE,
    OTHER,
    ROBOT,
    THEIRS,
    Grid,
    near_stretches,
    sort_up,
)
from coordinator.schedule.zone_assembly_kernels import (
    CHORD_A,
    CHORD_B,
    JOINED,
    SIDES,
    extents_of,
    join_pairs,
    near_chords,
    zones_in_order,
)
from coordinator.schedule.zone_kernels import SLACK, Polyline

Short = npt.NDArray[np.int32]
Number = TypeVar("Number", bound=np.generic)

ROBOT_A, ROBOT_B, SIZE = range(3)
"""Columns of zones (z, 3): the robots a < b, and the number of pairs of chords."""

_NEXT: Final = SIDES
"""Column of pairs in which `tell_members` counts: SIDES, which are no longer needed then."""


class Fleet(NamedTuple):
    """The chords of n robots; robot r has the vertices first[r] to first[r + 1] - 1.

    asked (n,): 1 for robots whose zones with all others are wanted.  line: the vertices (v,) of all
    robots; middles (v, 3) [m]: the middles of the chords and half their lengths.  half (n,) [m]:
    each robot's share of every need: its radius, half the margin, the error of its chords.  grid:
    the stretches of all robots.
    """

    asked: Indices
    first: Indices
    line: Polyline
    middles: Array
    half: Array
    grid: Grid


class FleetZones(NamedTuple):
    """Zones (z, 3), their extents (z, 4) [m], and their pairs of chords (m, 2), zone after zone.

    Chords are named by the vertices where they begin.
    """

    zones: Indices
    extents: Array
    members: Short


@compiled
def widened(table: npt.NDArray[Number], count: int) -> npt.NDArray[Number]:
    """Return a table (n, k) with room for `count` rows: the same or a larger copy."""
    if count <= len(table):
        return table
    wider = np.empty((2 * count, table.shape[1]), table.dtype)
    wider[: len(table)] = table
    return wider


@allocation_free
def by_partner(
    found: Indices, count: int, head: Indices, following: Indices, partners: Indices
) -> int:
    """Link the rows of `found` (n, 3) that have the same robot; return how many robots there are.

    head[r] becomes the last row with robot r, and following[k] the last one before row k with the
    same robot, or -1.  All of `head` must be -1 before.  The robots are written into `partners`,
    in increasing order.
    """
    total = 0
    for k in range(count):
        other = found[k, OTHER]
        if head[other] < 0:
            partners[total] = other
            total += 1
        following[k], head[other] = head[other], k
    sort_up(partners[:total])
    return total


@allocation_free
def keys_of(
    found: Indices, last: int, following: Indices, base: int, turned: bool, keys: Indices
) -> int:
    """Write the pairs of stretches in some rows of `found` as increasing keys; return how many.

    The rows are `last` and those before it that `following` links.  The keys are those that
    zone_assembly_kernels.near_chords takes; `base` is the number of all stretches.  With `turned`
    the stretch in column MINE is the second one of a pair.
    """
    total, k = 0, last
    while k >= 0:
        g, h = found[k, MINE], found[k, THEIRS]
        keys[total] = h * base + g if turned else g * base + h
        total, k = total + 1, following[k]
    for i in range(total // 2):
        keys[i], keys[total - 1 - i] = keys[total - 1 - i], keys[i]
    sort_up(keys[:total])
    return total


@allocation_free
def tell_members(pairs: Indices, order: Indices, sizes: Indices, members: Short) -> None:
    """Write the chords of joined pairs into `members`, zone after zone in the given order.

    order (z,): the first pair of each zone.  Into sizes (z,) goes the number of pairs of each zone.
    """
    for zone in order:
        pairs[zone, _NEXT] = 0
    for k in range(len(pairs)):
        pairs[pairs[k, JOINED], _NEXT] += 1
    begin = 0
    for k in range(len(order)):
        sizes[k], pairs[order[k], _NEXT] = pairs[order[k], _NEXT], begin
        begin += sizes[k]
    for k in range(len(pairs)):
        at = pairs[pairs[k, JOINED], _NEXT]
        members[at, 0], members[at, 1] = pairs[k, CHORD_A], pairs[k, CHORD_B]
        pairs[pairs[k, JOINED], _NEXT] += 1


@compiled
def zones_of(fleet: Fleet, task: tuple[int, int]) -> FleetZones:
    """Return the zones of those of robots task[0] to task[1] - 1 that are asked, with all others.

    They are in order of the asked robot, the other robot, and the extent.
    """
    zones, extents = np.empty((1024, 3), np.int64), np.empty((1024, 4))
    members, total, told = np.empty((8192, 2), np.int32), 0, 0
    found, pairs = np.empty((1024, 3), np.int64), np.empty((1024, 4), np.int64)
    boxes, order = np.empty((1024, 4)), np.empty(1024, np.int64)
    following, keys = np.empty(1024, np.int64), np.empty(1024, np.int64)
    owners, base = fleet.grid.stretches[:, ROBOT], len(fleet.grid.stretches)
    stamps, everybody = np.full(base, -1, np.int64), bool(fleet.asked.all())
    head, partners = np.full(len(fleet.half), -1, np.int64), np.empty(len(fleet.half), np.int64)
    past = int(np.searchsorted(owners, task[0]))
    for robot in range(task[0], task[1]):
        g = past
        while past < base and owners[past] == robot:
            past += 1
        if not fleet.asked[robot]:
            continue
        found, count = near_stretches(
            robot, (g, past), fleet.grid, fleet.asked, everybody, stamps, found
        )
        if len(keys) < count:
            following, keys = np.empty(2 * count, np.int64), np.empty(2 * count, np.int64)
        for p in range(by_partner(found, count, head, following, partners)):
            other = partners[p]
            chosen = keys_of(found, head[other], following, base, other < robot, keys)
            head[other] = -1
            reach = fleet.half[robot] + fleet.half[other] + SLACK
            pairs, near = near_chords(
                keys[:chosen], fleet.grid, fleet.line.points, fleet.middles, reach, pairs
            )
            if len(order) < near:
                boxes, order = np.empty((2 * near, 4)), np.empty(2 * near, np.int64)
            joined = pairs[:near]
            join_pairs(joined)
            extents_of(joined, fleet.line, reach, boxes)
            pieces = zones_in_order(joined, boxes, order)
            zones, extents = widened(zones, total + pieces), widened(extents, total + pieces)
            members = widened(members, told + near)
            new = zones[total : total + pieces]
            tell_members(joined, order[:pieces], new[:, SIZE], members[told:])
            for k in range(pieces):
                new[k, ROBOT_A], new[k, ROBOT_B] = min(robot, other), max(robot, other)
                extents[total + k] = boxes[order[k]]
            total, told = total + pieces, told + near
    return FleetZones(zones[:total], extents[:total], members[:told])
