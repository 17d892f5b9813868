"""Compiled: all zones of some robots with the others of a fleet.

Decides: the order in which robots are searched and zones are returned.  Must not know: tasks,
executors.
"""

from __future__ import annotations

from typing import NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import compiled
from coordinator.curves.nurbs_kernels import Array, Indices
from coordinator.schedule.broad_phase_kernels import ROBOT, Grid, near_stretches, sort_up
from coordinator.schedule.zone_assembly_kernels import (
    extents_of,
    join_pairs,
    near_chords,
    zones_in_order,
)
from coordinator.schedule.zone_kernels import SLACK

Short = npt.NDArray[np.int32]
Number = TypeVar("Number", bound=np.generic)


class Fleet(NamedTuple):
    """A fleet as plain arrays; robot r has the vertices from first[r] to first[r + 1].

    asked (n,): 1 for robots to be looked at against all others.  s (v,), points (v, 2) [m]: all
    chords; middles (v, 3) [m]: their middles and half lengths.  half (n,) [m]: each robot's half of
    every need, errors included.  The others are those of near_kernels.
    """

    asked: Indices
    first: Indices
    s: Array
    points: Array
    middles: Array
    half: Array
    stretches: Indices
    shapes: Array
    grid: Grid


@compiled
def widened(table: npt.NDArray[Number], count: int) -> npt.NDArray[Number]:
    """Return a table (n, k) with room for `count` rows, the first ones kept."""
    if count <= len(table):
        return table
    wider = np.empty((2 * count, table.shape[1]), table.dtype)
    wider[: len(table)] = table
    return wider


@compiled
def by_partner(
    found: Indices, count: int, head: Indices, following: Indices, partners: Indices
) -> int:
    """Chain the rows of `found` robot by robot; return how many robots there are.

    head[r] is the last row with robot r and following[k] the one before row k, -1 when none; all
    of `head` is -1 before.  partners: the robots, increasing.
    """
    total = 0
    for k in range(count):
        other = found[k, 2]
        if head[other] < 0:
            partners[total] = other
            total += 1
        following[k], head[other] = head[other], k
    sort_up(partners[:total])
    return total


@compiled
def keys_of(
    found: Indices, last: int, following: Indices, base: int, turned: bool, keys: Indices
) -> int:
    """Write the stretches of a chain of rows as increasing keys; return how many.

    A key is the stretch of the first robot times `base`, and that of the second; `turned`: the
    robot looked at is the second one.
    """
    total, k = 0, last
    while k >= 0:
        g, h = found[k, 0], found[k, 1]
        keys[total] = h * base + g if turned else g * base + h
        total, k = total + 1, following[k]
    for i in range(total // 2):
        keys[i], keys[total - 1 - i] = keys[total - 1 - i], keys[i]
    sort_up(keys[:total])
    return total


@compiled
def tell_members(pairs: Indices, order: Indices, begins: Indices, members: Short) -> None:
    """Write the chords of joined pairs into `members`, zone by zone in the given order.

    pairs[zone, 2] is a counter from here on; begins (z,): how many chords a zone has.
    """
    for zone in order:
        pairs[zone, 2] = 0
    for k in range(len(pairs)):
        pairs[pairs[k, 3], 2] += 1
    begin = 0
    for k in range(len(order)):
        begins[k], pairs[order[k], 2] = pairs[order[k], 2], begin
        begin += begins[k]
    for k in range(len(pairs)):
        at = pairs[pairs[k, 3], 2]
        members[at, 0], members[at, 1] = pairs[k, 0], pairs[k, 1]
        pairs[pairs[k, 3], 2] += 1


@compiled
def zones_of(fleet: Fleet, task: tuple[int, int]) -> tuple[Indices, Array, Short]:
    """Return the zones of the robots asked from task[0] to task[1] with all others.

    Rows (z, 3): a, b, how many pairs of chords; extents (z, 4) [m]; those pairs (m, 2), as vertices
    where chords begin.  In order of a robot asked, its partner, and the extent.
    """
    zones, extents = np.empty((1024, 3), np.int64), np.empty((1024, 4))
    members, total, told = np.empty((8192, 2), np.int32), 0, 0
    found, pairs = np.empty((1024, 3), np.int64), np.empty((1024, 4), np.int64)
    boxes, order = np.empty((1024, 4)), np.empty(1024, np.int64)
    following, keys = np.empty(1024, np.int64), np.empty(1024, np.int64)
    owners, base = fleet.stretches[:, ROBOT], len(fleet.stretches)
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
            robot,
            (g, past),
            fleet.stretches,
            fleet.shapes,
            fleet.grid,
            fleet.asked,
            everybody,
            stamps,
            found,
        )
        if len(keys) < count:
            following, keys = np.empty(2 * count, np.int64), np.empty(2 * count, np.int64)
        for p in range(by_partner(found, count, head, following, partners)):
            other = partners[p]
            chosen = keys_of(found, head[other], following, base, other < robot, keys)
            head[other] = -1
            reach = fleet.half[robot] + fleet.half[other] + SLACK
            pairs, near = near_chords(
                keys[:chosen],
                fleet.stretches,
                fleet.shapes,
                fleet.points,
                fleet.middles,
                reach,
                pairs,
            )
            if len(order) < near:
                boxes, order = np.empty((2 * near, 4)), np.empty(2 * near, np.int64)
            joined = pairs[:near]
            join_pairs(joined)
            extents_of(joined, fleet.s, fleet.points, reach, boxes)
            pieces = zones_in_order(joined, boxes, order)
            zones, extents = widened(zones, total + pieces), widened(extents, total + pieces)
            members = widened(members, told + near)
            new = zones[total : total + pieces]
            tell_members(joined, order[:pieces], new[:, 2], members[told:])
            for k in range(pieces):
                new[k, 0], new[k, 1] = min(robot, other), max(robot, other)
                extents[total + k] = boxes[order[k]]
            total, told = total + pieces, told + near
    return zones[:total], extents[:total], members[:told]
