"""Who goes first: an order of the robots in which everybody arrives, improved by counted rounds.

Robots are given their motions one after another, each among those that have one, so the waits can
never form a circle.  Then some are taken out and put back in other orders (large neighbourhood
search, Shaw 1998): whatever lowers the sum of delays stays.

Decides: the order.  Must not know: how one robot waits (waiting.py), floors.
"""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from coordinator.conflict_search import ConflictSearch
from coordinator.junctions import FEW, Junctions
from coordinator.motion import Motion
from coordinator.precedence import first_order, ring_of
from coordinator.timetable import Motions
from coordinator.waiting import earliest_motion

Order = tuple[int, ...]

_EXHAUSTIVE: Final = 5
"""Up to this many robots every order is tried before giving up."""

_TRIES: Final = 4
"""Orders tried per robot before giving up."""

_LARGEST: Final = 6
"""So many robots at most are taken out in one round."""

_ROUNDS: Final = 5
"""Neighbourhoods that are tried per unit of effort."""

_WORTH: Final = 0.5
_WORTH_SHARE: Final = 0.1
"""What more stops have to gain of the delays, [s] and as a share."""

_PAIR_NODES: Final = 4
"""Nodes that are searched for two robots of which one waits for the other."""

_SETTLING: Final = 3
"""So often at most everybody is looked at again in the end."""

_GAIN: Final = 1e-6

_RING: Final = 300
_LARGEST_RING: Final = 24
"""Nodes that are searched for motions of robots that no order works for, if they are so few."""

_NODES: Final = 15
"""Nodes that are searched per unit of effort, zone by zone, where robots are few."""


@dataclass(frozen=True)
class Deadlock:
    """Robot `loser` found no motion behind the robots `winners`."""

    loser: int
    winners: Order


def place_in_order(junctions: Junctions, order: Sequence[int]) -> Motions | Deadlock:
    """Give the robots of an order their motions one after another."""
    motions = Motions(junctions.lengths())
    for place, index in enumerate(order):
        motion = earliest_motion(junctions, motions, index)
        if motion is None:
            return Deadlock(index, tuple(order[:place]))
        motions.put(index, motion)
    return motions


def delays(junctions: Junctions, motions: Sequence[Motion]) -> list[float]:
    """Return what each robot arrives later than alone [s]."""
    return [m.finish - t.alone for m, t in zip(motions, junctions.tracks, strict=True)]


def find_schedule(
    junctions: Junctions, priorities: Sequence[int], effort: int
) -> list[Motion] | Deadlock:
    """Return motions for all robots, or the deadlock that was met last.

    Higher priorities go first as long as an order with them exists.  `effort` counts rounds of
    improvement after the first order that works, by the _ROUNDS.
    """
    found = _first_that_works(junctions, first_order(junctions, priorities))
    if isinstance(found, Deadlock):
        turned = _zone_by_zone(junctions, first_order(junctions, priorities))
        if turned is None:
            return found
        found = turned
    order, motions = found
    delay = delays(junctions, motions.all())
    if 1 < len(order) <= FEW and effort > 0 and not any(priorities):
        ConflictSearch(junctions, motions, order).run(sum(delay), _NODES * effort)
        late = sum(delays(junctions, motions.all()))
        # More places to wait at make more stops: they have to be worth it.
        finer = junctions.finer()
        bound = late - max(_WORTH, _WORTH_SHARE * late)
        if bound > 0.0 and ConflictSearch(finer, motions, order).run(bound, _NODES * effort):
            junctions = finer
    improvement = _Improvement(junctions, motions, order, priorities)
    improvement.run(_ROUNDS * effort)
    improvement.turn_round(effort)
    improvement.settle()
    return motions.all()


class _Improvement:
    """Takes robots out and puts them back in other orders, as long as that lowers the delays."""

    def __init__(
        self,
        junctions: Junctions,
        motions: Motions,
        order: Sequence[int],
        priorities: Sequence[int],
    ) -> None:
        self.junctions, self.motions, self.priorities = junctions, motions, priorities
        self.rounds = random.Random(len(order))
        ranks = [priorities[index] for index in order]
        self.by_priority = ranks == sorted(ranks, reverse=True)
        self.delay = delays(junctions, motions.all())
        self.failed: set[tuple[bytes, Order]] = set()

    def run(self, rounds: int) -> None:
        """Try so many rounds, or until nobody is late."""
        for _ in range(rounds):
            late = [index for index, delay in enumerate(self.delay) if delay > _GAIN]
            if not late:
                return
            self._try(self._neighbourhood(late))

    def _may(self, index: int, motion: Motion) -> bool:
        """Tell whether a robot waits for nobody of lower priority, if that is to be kept."""
        owners = (wait.owner for wait in motion.waits if wait.owner >= 0)
        mine = self.priorities[index]
        return not self.by_priority or all(self.priorities[owner] >= mine for owner in owners)

    def turn_round(self, count: int) -> None:
        """Look at so many waits, the longest first: the two robots in any order, zone by zone."""
        if any(self.priorities):
            return
        waits = [
            (wait.depart - (before.depart if before else 0.0), index, wait.owner)
            for index, motion in enumerate(self.motions.all())
            for before, wait in zip((None, *motion.waits), motion.waits, strict=False)
            if wait.owner >= 0
        ]
        for _, *pair in sorted(waits, reverse=True)[:count]:
            bound = sum(self.delay[index] for index in pair)
            if ConflictSearch(self.junctions, self.motions, pair).run(bound, _PAIR_NODES):
                for index in pair:
                    motion = self.motions.found[index]
                    assert motion is not None
                    self.delay[index] = motion.finish - self.junctions.tracks[index].alone

    def settle(self) -> None:
        """Plan robots again whom others have left behind: they may wait less, and know for whom."""
        for _ in range(_SETTLING):
            serial = self.motions.table.serial
            behind = [
                index
                for index, motion in enumerate(self.motions.all())
                if any(w.owner >= 0 and serial[w.owner] > serial[index] for w in motion.waits)
            ]
            for index in behind:
                self._plan_again(index)
            if not behind:
                return

    def _plan_again(self, index: int) -> None:
        """Give a robot its earliest motion among all others, if that is no later."""
        old, serial = self.motions.found[index], int(self.motions.table.serial[index])
        assert old is not None
        self.motions.put(index, None)
        motion = earliest_motion(self.junctions, self.motions, index, latest=old.finish + _GAIN)
        if motion is None or not self._may(index, motion):
            self.motions.put(index, old, serial)
        else:
            self.motions.put(index, motion)
            self.delay[index] = motion.finish - self.junctions.tracks[index].alone

    def _neighbourhood(self, late: list[int]) -> list[int]:
        """Return robots to take out: a late one, whom it waits for, and who else is near."""
        weights = [self.delay[index] for index in late]
        seed = self.rounds.choices(late, weights)[0]
        motion = self.motions.found[seed]
        assert motion is not None
        owners = {wait.owner for wait in motion.waits if wait.owner >= 0}
        near = [index for index in self.junctions.near(seed) if index not in owners]
        others = sorted(owners) + self.rounds.sample(near, min(len(near), 2))
        self.rounds.shuffle(others)
        return [seed, *others[: self.rounds.randint(1, _LARGEST - 1)]]

    def _try(self, chosen: list[int]) -> None:
        """Put robots back in another order, each once a state; undo it if that is no better."""
        serials = self.motions.table.serial
        before = [(index, self.motions.found[index], int(serials[index])) for index in chosen]
        was = sum(self.delay[index] for index in chosen)
        if self.rounds.random() < 0.5:
            self.rounds.shuffle(chosen)
        if self.by_priority:
            chosen.sort(key=lambda index: -self.priorities[index])
        trial = (serials.tobytes(), tuple(chosen))
        if trial in self.failed:
            return
        self.failed.add(trial)
        for index in chosen:
            self.motions.put(index, None)
        now, fresh = 0.0, {}
        for index in chosen:
            alone = self.junctions.tracks[index].alone
            motion = earliest_motion(
                self.junctions,
                self.motions,
                index,
                latest=alone + was - now - _GAIN,
                anywhere=False,
            )
            if motion is None or not self._may(index, motion):
                break
            fresh[index] = motion.finish - alone
            now += fresh[index]
            self.motions.put(index, motion)
        else:
            for index, delay in fresh.items():
                self.delay[index] = delay
            return
        for index, old, serial in before:
            self.motions.put(index, old, serial)


def _first_that_works(
    junctions: Junctions, order: Sequence[int]
) -> tuple[Order, Motions] | Deadlock:
    """Try orders until one works: the loser moves ahead of those that blocked it."""
    tried: set[Order] = set()
    first = trial = tuple(order)
    result = place_in_order(junctions, trial)
    for _ in range(_TRIES * len(first)):
        if isinstance(result, Motions):
            return trial, result
        tried.add(trial)
        trial = _promoted(trial, result.loser, tried, junctions)
        if trial in tried:
            break
        result = place_in_order(junctions, trial)
    if isinstance(result, Motions):
        return trial, result
    if len(first) <= _EXHAUSTIVE:
        for trial in itertools.permutations(first):
            if trial not in tried:
                other = place_in_order(junctions, trial)
                if isinstance(other, Motions):
                    return trial, other
    return result


def _zone_by_zone(junctions: Junctions, order: Sequence[int]) -> tuple[Order, Motions] | None:
    """Find motions where no order of whole robots works, such as for a ring that turns by one.

    Looks at all robots where they are few, else at those of a ring; the others come after them.
    Robots of a dense ring must leave their starts at once, and wait on the way.
    """
    motions = Motions(junctions.lengths())
    chosen = list(order) if len(order) <= FEW else ring_of(junctions)
    if len(chosen) > _LARGEST_RING or not any(
        ConflictSearch(junctions, motions, chosen, leave_by).run(math.inf, _RING)
        for leave_by in (math.inf, 0.0)
    ):
        return None
    rest = [index for index in order if index not in chosen]
    for index in rest:
        motion = earliest_motion(junctions, motions, index)
        if motion is None:
            return None
        motions.put(index, motion)
    return (*chosen, *rest), motions


def _promoted(order: Order, loser: int, tried: set[Order], junctions: Junctions) -> Order:
    """Move the loser ahead: first of the nearest robot that it meets, then of all."""
    at = order.index(loser)
    without = order[:at] + order[at + 1 :]
    near = set(junctions.near(loser))
    for position in range(at - 1, -1, -1):
        if order[position] in near:
            trial = (*without[:position], loser, *without[position:])
            if trial not in tried:
                return trial
    return (loser, *without)
