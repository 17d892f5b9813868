"""Who goes first: an order of the robots in which everybody arrives, improved by counted rounds.

Robots are given their motions one after another, each among those before it, so the waits can
never form a circle.  Decides: the order.  Must not know: how one robot waits (waiting.py), floors.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterable
from dataclasses import dataclass

from coordinator.motion import Motion
from coordinator.waiting import Track, collect_bans, earliest_motion
from coordinator.zones import Conflict, Runs, find_conflict

Order = tuple[int, ...]

_EXHAUSTIVE = 5
"""Up to this many robots every order is tried before giving up."""


@dataclass(frozen=True)
class Deadlock:
    """Robot `loser` found no motion behind the robots `winners`."""

    loser: int
    winners: Order


class Junctions:
    """All tracks of a fleet and the conflicts between them."""

    def __init__(self, tracks: list[Track], needs: list[list[float]], tau: float) -> None:
        self.tracks = tracks
        self.tau = tau
        self._needs = needs
        self.conflicts: dict[tuple[int, int], Conflict] = {}
        self._meet(itertools.combinations(range(len(tracks)), 2))

    def take(self, index: int, track: Track) -> None:
        """Give one robot another track; what the others have between them stays."""
        self.tracks[index] = track
        others = (other for other in range(len(self.tracks)) if other != index)
        self._meet((min(index, other), max(index, other)) for other in others)

    def _meet(self, pairs: Iterable[tuple[int, int]]) -> None:
        """Find the conflicts of some pairs anew, and all waiting places."""
        for a, b in pairs:
            self.conflicts.pop((a, b), None)
            conflict = find_conflict(self.tracks[a].cells, self.tracks[b].cells, self._needs[a][b])
            if conflict is not None:
                self.conflicts[a, b] = conflict
        self.conflicts = dict(sorted(self.conflicts.items(), key=lambda item: item[0]))
        for index in range(len(self.tracks)):
            self._find_places(index)

    def runs(self, mine: int, other: int) -> Runs | None:
        """Return the conflict with another robot, seen from my side."""
        conflict = self.conflicts.get((min(mine, other), max(mine, other)))
        if conflict is None:
            return None
        return conflict.of_a if mine < other else conflict.of_b

    def _find_places(self, index: int) -> None:
        """Put the waiting places half a cell before every zone of a robot."""
        track, spans = self.tracks[index], []
        for (a, b), conflict in self.conflicts.items():
            if index in (a, b):
                spans += [
                    (zone.a0, zone.a1) if index == a else (zone.b0, zone.b1)
                    for zone in conflict.zones
                ]
        half = 0.5 * track.cells.size
        track.anywhere = sorted({begin - half for begin, _ in spans if begin - half > half})
        track.harmless = [
            s for s in track.anywhere if not any(begin <= s <= end for begin, end in spans)
        ]


def place_in_order(junctions: Junctions, order: Order) -> dict[int, Motion] | Deadlock:
    """Give the robots of an order their motions one after another."""
    motions: dict[int, Motion] = {}
    for index in order:
        others = [
            (other, runs, junctions.tracks[other].cells, motion)
            for other, motion in motions.items()
            if (runs := junctions.runs(index, other)) is not None
        ]
        bans = collect_bans(others, junctions.tau)
        track = junctions.tracks[index]
        motion = earliest_motion(track, bans, track.harmless)
        if motion is None and len(track.anywhere) > len(track.harmless):
            motion = earliest_motion(track, bans, track.anywhere)
        if motion is None:
            return Deadlock(index, tuple(motions))
        motions[index] = motion
    return motions


def total_delay(junctions: Junctions, motions: dict[int, Motion]) -> float:
    """Return the sum of what the robots arrive later than alone [s]."""
    return sum(
        motion.finish - Motion(junctions.tracks[index].limits, []).finish
        for index, motion in motions.items()
    )


def find_schedule(
    junctions: Junctions, priorities: list[int], effort: int
) -> dict[int, Motion] | Deadlock:
    """Return motions for all robots, or the deadlock that was met last.

    Higher priorities go first as long as an order with them exists.  `effort` counts rounds of
    improvement after the first order that works.
    """
    count = len(priorities)
    first = _first_order(junctions, priorities)
    groups = [priorities[index] for index in first]
    found, result = _search(junctions, first)
    if isinstance(result, Deadlock):
        return result
    by_priority = [priorities[index] for index in found] == groups
    rounds = random.Random(count)
    cost = total_delay(junctions, result)
    for _ in range(effort if count > 1 else 0):
        if cost <= 1e-6:
            break
        i, j = rounds.sample(range(count), 2)
        trial = list(found)
        trial.insert(j, trial.pop(i))
        if by_priority and [priorities[index] for index in trial] != groups:
            continue
        other = place_in_order(junctions, tuple(trial))
        if isinstance(other, Deadlock):
            continue
        trial_cost = total_delay(junctions, other)
        if trial_cost < cost - 1e-9:
            found, result, cost = tuple(trial), other, trial_cost
    return result


def _first_order(junctions: Junctions, priorities: list[int]) -> Order:
    """Return the order to begin with: priority, then the faster one, as the paper has it."""
    limits = [track.limits for track in junctions.tracks]
    return tuple(
        sorted(
            range(len(priorities)),
            key=lambda index: (-priorities[index], -limits[index].top, index),
        )
    )


def _search(junctions: Junctions, first: Order) -> tuple[Order, dict[int, Motion] | Deadlock]:
    """Try orders until one works: the loser moves ahead of those that blocked it."""
    tried: set[Order] = set()
    order = first
    result: dict[int, Motion] | Deadlock = place_in_order(junctions, order)
    for _ in range(4 * len(first)):
        if not isinstance(result, Deadlock):
            return order, result
        tried.add(order)
        order = _promote(order, result.loser, tried, junctions)
        if order in tried:
            break
        result = place_in_order(junctions, order)
    if not isinstance(result, Deadlock):
        return order, result
    if len(first) <= _EXHAUSTIVE:
        for order in itertools.permutations(first):
            if order not in tried:
                other = place_in_order(junctions, order)
                if not isinstance(other, Deadlock):
                    return order, other
    return first, result


def _promote(order: Order, loser: int, tried: set[Order], junctions: Junctions) -> Order:
    """Move the loser ahead: first of the nearest robot it conflicts with, then of all."""
    at = order.index(loser)
    without = order[:at] + order[at + 1 :]
    for position in range(at - 1, -1, -1):
        if junctions.runs(loser, order[position]) is None:
            continue
        trial = (*without[:position], loser, *without[position:])
        if trial not in tried:
            return trial
    return (loser, *without)
