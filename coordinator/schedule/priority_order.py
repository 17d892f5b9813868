"""Who goes first: an order of the robots in which all arrive, improved by counted rounds.

Robots get their motions one after another, each among the motions that are already known, so the
waits can never form a ring.  A search then improves the schedule (neighbourhood_search.py).

Decides: the first order, and what to try when no order works.  Must not know: how one robot waits
(safe_intervals.py), floors.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from coordinator.motion.velocity_profile import Motion
from coordinator.schedule.conflict_search import ConflictSearch
from coordinator.schedule.junctions import FEW, Junctions
from coordinator.schedule.neighbourhood_search import Improvement, delays
from coordinator.schedule.precedence import first_order, ring_of
from coordinator.schedule.safe_intervals import earliest_motion
from coordinator.schedule.timetable import Motions

Order = tuple[int, ...]

_EXHAUSTIVE: Final = 5
"""Up to this many robots every order is tried before giving up."""

_TRIES: Final = 4
"""Orders tried per robot before giving up."""

_ROUNDS: Final = 5
_ROUNDS_AFTER: Final = 1
"""Rounds of the neighbourhood search per unit of effort.  _ROUNDS_AFTER applies if the conflict
search has tried every order in the zones, since little is left to find then."""

_WORTH: Final = 0.5
_WORTH_SHARE: Final = 0.1
"""How much a schedule with more places to stop has to lower the sum of delays, [s] and as a share
of the sum; the larger of the two counts."""

_RING: Final = 300
_LARGEST_RING: Final = 24
"""If no order of whole robots works, _RING nodes are searched zone by zone, unless the ring has
more than _LARGEST_RING robots."""

_NODES: Final = 15
"""Nodes that are searched zone by zone per unit of effort, in a fleet of at most FEW robots."""


@dataclass(frozen=True)
class Deadlock:
    """Robot `loser` has no motion among those of the robots `winners`, which come before it."""

    loser: int
    winners: Order


def place_in_order(junctions: Junctions, order: Sequence[int]) -> Motions | Deadlock:
    """Find motions for the robots in this order; return the deadlock if a robot has none."""
    motions = Motions(junctions.lengths())
    return _place(junctions, motions, order, 0) or motions


def _place(
    junctions: Junctions, motions: Motions, order: Sequence[int], begin: int
) -> Deadlock | None:
    """Find motions for the robots from order[begin] on; those before keep theirs."""
    for index in order[begin:]:
        motions.put(index, None)
    for place, index in enumerate(order[begin:], begin):
        motion = earliest_motion(junctions, motions, index)
        if motion is None:
            return Deadlock(index, tuple(order[:place]))
        motions.put(index, motion)
    return None


def find_schedule(
    junctions: Junctions, priorities: Sequence[int], effort: int
) -> list[Motion] | Deadlock:
    """Return motions for all robots, or the deadlock that was met last.

    Robots of higher priority go first if such an order is found.  `effort` bounds the improvement
    after the first order that works: _ROUNDS rounds and _NODES nodes per unit.
    """
    found = _first_that_works(junctions, first_order(junctions, priorities))
    if isinstance(found, Deadlock):
        turned = _zone_by_zone(junctions, first_order(junctions, priorities))
        if turned is None:
            return found
        found = turned
    order, motions = found
    delay = delays(junctions, motions.all())
    complete = False
    if 1 < len(order) <= FEW and effort > 0 and not any(priorities):
        search = ConflictSearch(junctions, motions, order)
        search.run(sum(delay), _NODES * effort)
        late = sum(delays(junctions, motions.all()))
        # More places to wait at make more stops: they have to be worth it.
        bound = late - max(_WORTH, _WORTH_SHARE * late)
        if bound > 0.0:
            finer = ConflictSearch(junctions.finer(), motions, order)
            if finer.run(bound, _NODES * effort):
                junctions, search = finer.junctions, finer
        complete = search.complete
    improvement = Improvement(junctions, motions, order, priorities)
    improvement.run((_ROUNDS_AFTER if complete else _ROUNDS) * effort)
    improvement.turn_round(effort)
    improvement.settle()
    return motions.all()


def _first_that_works(
    junctions: Junctions, order: Sequence[int]
) -> tuple[Order, Motions] | Deadlock:
    """Try orders until one works; in each new order the last loser moves ahead of its blockers."""
    tried: set[Order] = set()
    first = trial = tuple(order)
    motions = Motions(junctions.lengths())
    result = _place(junctions, motions, trial, 0)
    for _ in range(_TRIES * len(first)):
        if result is None:
            return trial, motions
        tried.add(trial)
        before, trial = trial, _promoted(trial, result.loser, tried, junctions)
        if trial in tried:
            break
        result = _place(junctions, motions, trial, _shared(before, trial))
    if result is None:
        return trial, motions
    if len(first) <= _EXHAUSTIVE:
        for trial in itertools.permutations(first):
            if trial not in tried:
                other = place_in_order(junctions, trial)
                if isinstance(other, Motions):
                    return trial, other
    return result


def _shared(one: Order, other: Order) -> int:
    """Return how many robots two orders begin with in the same way."""
    return next(k for k, (a, b) in enumerate(zip(one, other, strict=True)) if a != b)


def _zone_by_zone(junctions: Junctions, order: Sequence[int]) -> tuple[Order, Motions] | None:
    """Find motions if no order of the robots works, as when each moves to the place of the next.

    The search covers all robots of a small fleet, else those of a ring; the others come after them.
    Robots of a dense ring must leave their starts at once and wait on the way.
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
    """Return the order with the loser moved ahead.

    It is moved before the next earlier robot that it has zones with, if that order was not tried,
    else farther ahead, at last to the front.
    """
    at = order.index(loser)
    without = order[:at] + order[at + 1 :]
    near = set(junctions.near(loser))
    for position in range(at - 1, -1, -1):
        if order[position] in near:
            trial = (*without[:position], loser, *without[position:])
            if trial not in tried:
                return trial
    return (loser, *without)
