"""Compiled: neighbourhoods of robots that are planned anew, so that all arrive earlier.

A few robots are taken out and put back in another order, each as early as the others let it; what
is no better is undone (large neighbourhood search, Li et al. 2021).

Decides: which robots are planned anew together, and when that is no longer worth it.  Must not
know: how one robot's moves are found (early_move_kernels.py).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from coordinator.base.compiled import compiled
from coordinator.places.early_move_kernels import Books, Floor, Plans, enter, soonest, strike_out
from coordinator.places.move_kernels import Array, Flags, Indices

_MOST: Final = 8
_LEAST: Final = 4
_FEW: Final = 3
_FEW_ROUNDS: Final = 50
"""Up to _MOST robots are taken out.  It begins with up to _FEW, since robots that are late by much
are put back at little cost, and becomes one more every _FEW_ROUNDS rounds.  If fewer than _LEAST
are in a robot's way, others are taken out at random."""

_CHANCE: Final = 4
"""Of so many robots on a robot's shortest way one stays where it is."""

_CHECKED: Final = 256
_SLOW: Final = 0.99
"""The search ends if in _CHECKED rounds the delays fall to no less than the share _SLOW."""

_PER_ROUND: Final = 1000
"""What a round costs at least, in edges."""

_GAIN: Final = 1e-6


@compiled
def _random(noise: Indices, below: int) -> int:
    noise[0] = (noise[0] * 1103515245 + 12345) % 2147483648
    return int((noise[0] >> 8) % below)


@compiled
def _in_its_way(
    start: int, left: Array, floor: Floor, books: Books, chosen: Flags, most: int, noise: Indices
) -> int:
    """Choose up to `most` robots that close edges on a robot's shortest way; return how many."""
    edges, found = floor.edges, 0
    here = start
    at = 0.0
    while left[here] > 0.0 and found < most:
        best, onward = math.inf, -1
        for e in range(edges.first[here], edges.first[here + 1]):
            there = left[edges.to[e]]  # Places less than a rounding error apart lead to each other.
            if floor.fits[e] and there < left[here] and floor.length[e] + there < best:
                best, onward = floor.length[e] + there, e
        if onward < 0:
            break
        first = books.edge.first[onward]
        for k in range(first, first + books.edge.size[onward]):
            other = books.edge.whose[k]
            begin, end = books.edge.times[k, 0], books.edge.times[k, 1]
            in_the_way = begin <= at < end and not chosen[other] and found < most
            if in_the_way and _random(noise, _CHANCE) > 0:
                chosen[other] = True
                found += 1
        at += floor.length[onward]
        here = edges.to[onward]
    return found


@compiled
def _at_a_crossing(
    robot: int, plans: Plans, books: Books, chosen: Flags, most: int, noise: Indices
) -> int:
    """Choose up to `most` robots that come near one of a robot's moves, nearest in time first.

    Returns how many.
    """
    found, size = 0, plans.size[robot]
    if size == 0:
        return 0
    number = _random(noise, size)
    e, at = plans.edge[robot, number], plans.start[robot, number]
    first = books.edge.first[e]
    last = first + books.edge.size[e]
    after = first
    while after < last and books.edge.times[after, 0] < at:
        after += 1
    before = after - 1
    while found < most and (before >= first or after < last):
        gone = at - books.edge.times[before, 1] if before >= first else math.inf
        coming = books.edge.times[after, 0] - at if after < last else math.inf
        if gone < coming:
            k, before = before, before - 1
        else:
            k, after = after, after + 1
        other = books.edge.whose[k]
        if not chosen[other]:
            chosen[other] = True
            found += 1
    return found


@compiled
def _taken_out(
    plans: Plans,
    delay: Array,
    starts: Indices,
    left: Array,
    floor: Floor,
    books: Books,
    most: int,
    noise: Indices,
) -> Indices:
    """Return up to `most` robots in any order: one that is late, those in its way, and others."""
    count = len(starts)
    aim = delay.sum() * _random(noise, 1_000_000) / 1_000_000.0
    late = 0
    while late < count - 1 and aim >= delay[late]:
        aim -= delay[late]
        late += 1
    chosen = np.zeros(count, np.bool_)
    chosen[late] = True
    wanted = 1 + _random(noise, most)
    if _random(noise, 2) == 0:
        size = 1 + _at_a_crossing(late, plans, books, chosen, wanted - 1, noise)
    else:
        size = 1 + _in_its_way(starts[late], left[late], floor, books, chosen, wanted - 1, noise)
    for _ in range(min(wanted, _LEAST) - size):
        chosen[_random(noise, count)] = True
    order = np.flatnonzero(chosen)
    for k in range(len(order) - 1, 0, -1):
        j = _random(noise, k + 1)
        order[k], order[j] = order[j], order[k]
    return order


@compiled
def _copy(robot: int, source: Plans, target: Plans) -> None:
    """Copy a robot's moves."""
    size = source.size[robot]
    target.edge[robot, :size] = source.edge[robot, :size]
    target.start[robot, :size] = source.start[robot, :size]
    target.size[robot], target.arrival[robot] = size, source.arrival[robot]


@compiled
def improve(
    starts: Indices, goals: Indices, left: Array, floor: Floor, plans: Plans, books: Books,
    effort: int,
) -> None:  # fmt: skip
    """Take up to _MOST robots out and put them back, again and again, while there is effort.

    left (n, V): the length [m] of a robot's way to its goal; effort: how many edges are looked at.
    A round that makes the sum of arrivals more is undone.  It ends when little is gained any more.
    """
    noise = np.ones(1, np.int64)
    alone = np.empty(len(starts))
    for robot in range(len(starts)):
        alone[robot] = left[robot, starts[robot]]
    kept = Plans(
        np.empty_like(plans.edge), np.empty_like(plans.start), np.empty_like(plans.size),
        np.empty_like(plans.arrival),
    )  # fmt: skip
    rounds, before = 0, math.inf
    while effort > 0 and plans.arrival.sum() > alone.sum() + _GAIN:
        if rounds % _CHECKED == 0:
            delay = plans.arrival.sum() - alone.sum()
            if delay > _SLOW * before:
                break
            before = delay
        most = min(_MOST, _FEW + rounds // _FEW_ROUNDS)
        order = _taken_out(plans, plans.arrival - alone, starts, left, floor, books, most, noise)
        rounds += 1
        effort -= _PER_ROUND
        latest = plans.arrival[order].sum() - alone[order].sum() + _GAIN
        for robot in order:
            _copy(robot, plans, kept)
            strike_out(robot, starts[robot], plans, floor, books)
        entered = 0
        for robot in order:
            # Those that follow take at least as long as they would alone.
            spent = soonest(
                robot, starts[robot], goals[robot], left[robot], floor, plans, books,
                alone[robot] + latest,
            )  # fmt: skip
            effort -= abs(spent)
            if spent < 0:
                break
            entered += 1
            latest -= plans.arrival[robot] - alone[robot]
            if not enter(robot, starts[robot], plans, floor, books):
                break
        else:
            continue
        for robot in order[:entered]:
            strike_out(robot, starts[robot], plans, floor, books)
        for robot in order:
            _copy(robot, kept, plans)
            enter(robot, starts[robot], plans, floor, books)
