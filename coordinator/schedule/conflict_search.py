"""Who goes first, zone by zone: a depth-first search that branches where two robots clash.

An order of whole robots cannot express that A goes first at one place and B at another; here the
order is decided for each zone separately.  In a node of the search, some zones are decided.  Every
robot has its earliest motion behind those that precede it in these zones; conflicts in the other
zones are ignored, so the delays are a lower bound.  The first clash is then decided both ways
(conflict-based search: Sharon et al. 2015; the orders are those of a disjunctive graph: Roy and
Sussmann 1964).  Nodes are counted, never timed.

Decides: the orders in zones between chosen robots; others keep their motions.  Must not know: how
one robot waits (safe_intervals.py).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from coordinator.motion.velocity_profile import Motion
from coordinator.schedule.conflict_zones import Indices
from coordinator.schedule.forbidden_interval_kernels import AFTER, BOTH, FIRST, FREE, Passage, clash
from coordinator.schedule.junctions import FEW, Junctions
from coordinator.schedule.safe_interval_kernels import Departure
from coordinator.schedule.safe_intervals import earliest_motion
from coordinator.schedule.timetable import Motions

GAIN: Final = 1e-6
"""Differences of delay [s] below this do not count."""

_REPEATS: Final = 6
"""How often one decision may replan a robot; more would mean a ring of waits."""


@dataclass(frozen=True, eq=False)
class _Meeting:
    """A zone between two chosen robots a and b, and its index among the zones of each."""

    zone: int
    a: int
    b: int
    in_a: int
    in_b: int


Undo = list[tuple[int, Motion | None, int]]


class ConflictSearch:
    """A search for motions of chosen robots with less delay than a bound; others do not change.

    The chosen robots leave their starts by `leave_by` [s].
    """

    def __init__(
        self,
        junctions: Junctions,
        motions: Motions,
        chosen: Sequence[int],
        leave_by: float = math.inf,
    ) -> None:
        self.leave_by = leave_by
        self.junctions, self.motions, self.chosen = junctions, motions, list(chosen)
        self.meetings = _meetings(junctions, set(chosen))
        self.modes = {index: self._outside(index) for index in chosen}
        self.clashes = [math.inf] * len(self.meetings)
        self.nodes = 0
        self._few = len(junctions.tracks) <= FEW
        self.best = math.inf
        self.found: dict[int, Motion] = {}

    def run(self, bound: float, nodes: int) -> bool:
        """Search up to `nodes` nodes for a sum of delays below `bound` [s]; adopt the best motions.

        Returns False, with every motion unchanged, when none are found.
        """
        before = self._state(self.chosen)
        self.best, self.nodes = bound, nodes
        for index in self.chosen:
            self.motions.put(index, None)
        self.delay = dict.fromkeys(self.chosen, 0.0)
        if self._plan_again(self.chosen) is not None:
            self._dive(self.chosen)
        for old in before:
            self.motions.put(*old)
        for index, motion in self.found.items():
            self.motions.put(index, motion)
        return bool(self.found)

    @property
    def complete(self) -> bool:
        """Whether the last run ended before its nodes were used up: it has tried every order."""
        return self.nodes > 0

    def cost_if(self, zone: int, second: int, nodes: int) -> float:
        """Return by how much the delays [s] grow if robot `second` passes a zone second.

        Infinite if no such motions are found.  No motion is changed.
        """
        before = self._state(self.chosen)
        self.delay = dict.fromkeys(self.chosen, 0.0)
        self._restore(before)
        was, self.best, self.nodes = sum(self.delay.values()), math.inf, nodes
        at = next(k for k, meeting in enumerate(self.meetings) if meeting.zone == zone)
        self._set(at, second, AFTER, FIRST)
        for index in self.chosen:
            self.motions.put(index, None)
        if self._plan_again(sorted(self.chosen, key=lambda index: index == second)) is not None:
            self._dive(self.chosen)
        self._restore(before)
        return self.best - was

    def _dive(self, changed: Sequence[int]) -> None:
        """Decide the first clash both ways, the cheaper one first, and search on from each."""
        self.nodes -= 1
        kept = list(self.clashes)
        self._look(set(changed))
        at = int(np.argmin(self.clashes)) if self.clashes else -1
        if at < 0 or self.clashes[at] == math.inf:
            self.best = sum(self.delay.values())
            self.found = {index: self._motion(index) for index in self.chosen}
        else:
            self._branch(at)
        self.clashes = kept

    def _branch(self, at: int) -> None:
        """Decide one clash both ways."""
        branches = []
        for way, second in enumerate(self._sides(at)):
            self._set(at, second, AFTER, FIRST)
            undo = self._plan_again([second])
            if undo is not None:
                after = self._state([index for index, _, _ in undo])
                branches.append((sum(self.delay.values()), way, after))
                self._restore(undo)
            self._set(at, second, FREE, FREE)
        for cost, way, after in sorted(branches, key=lambda branch: branch[:2]):
            if self.nodes <= 0 or cost >= self.best - GAIN:
                return
            second = self._sides(at)[way]
            before = self._state([index for index, _, _ in after])
            self._set(at, second, AFTER, FIRST)
            self._restore(after)
            self._dive([index for index, _, _ in after])
            self._restore(before)
            self._set(at, second, FREE, FREE)

    def _sides(self, at: int) -> tuple[int, int]:
        return self.meetings[at].b, self.meetings[at].a

    def _set(self, at: int, second: int, mode: int, first: int) -> None:
        """Set the mode of a zone: `mode` for robot `second`, `first` for the other robot."""
        meeting = self.meetings[at]
        of_a, of_b = (mode, first) if second == meeting.a else (first, mode)
        self.modes[meeting.a][meeting.in_a], self.modes[meeting.b][meeting.in_b] = of_a, of_b

    def _plan_again(self, changed: Sequence[int]) -> Undo | None:
        """Plan changed robots again, in the decided orders, then the robots that pass after them.

        Returns the former motions of all replanned robots; None, with nothing changed, if one of
        them finds no motion.
        """
        undo: Undo = []
        waiting, planned = list(changed), dict.fromkeys(self.chosen, 0)
        spent = sum(self.delay.values())
        while waiting:
            index = waiting.pop(0)
            planned[index] += 1
            old = self._state([index])[0]
            others = spent - self.delay[index]
            alone = self.junctions.tracks[index].alone
            motion = None
            if planned[index] <= _REPEATS:
                latest = alone + self.best - others - GAIN
                modes = self.modes[index]
                motion = earliest_motion(
                    self.junctions,
                    self.motions,
                    index,
                    modes,
                    Departure(0.0, self.leave_by),
                    latest=latest,
                    anywhere=self._few,
                )
            if motion is None:
                self._restore(undo[::-1])
                return None
            if old[1] is not None and motion.waits == old[1].waits:
                continue
            undo.append(old)
            self.motions.put(index, motion)
            self.delay[index] = motion.finish - alone
            spent = others + self.delay[index]
            waiting += [other for other in self._followers(index) if other not in waiting]
        return _first_of_each(undo)

    def _followers(self, index: int) -> list[int]:
        """Return the robots that pass after a robot in a decided zone."""
        followers = []
        for meeting in self.meetings:
            if meeting.a == index and self.modes[meeting.b][meeting.in_b] == AFTER:
                followers.append(meeting.b)
            if meeting.b == index and self.modes[meeting.a][meeting.in_a] == AFTER:
                followers.append(meeting.a)
        return list(dict.fromkeys(followers))

    def _look(self, changed: set[int]) -> None:
        """Update the times of clashes in the zones of robots whose motions changed."""
        table, tau = self.motions.table, self.junctions.tau
        for k, meeting in enumerate(self.meetings):
            if meeting.a in changed or meeting.b in changed:
                one, two = (self.junctions.rows_of(i)[0] for i in (meeting.a, meeting.b))
                cell = self.junctions.tracks[meeting.a].cell
                first = Passage(meeting.a, one, meeting.in_a)
                second = Passage(meeting.b, two, meeting.in_b)
                self.clashes[k] = clash(first, second, table, cell, tau)

    def _outside(self, index: int) -> Indices:
        """Return a robot's modes before any decision: BOTH for other robots' motions, else FREE."""
        others = self.junctions.rows_of(index)[0].other
        bound = self.motions.placed[others] & ~np.isin(others, self.chosen)
        return np.where(bound, BOTH, FREE).astype(np.int64)

    def _motion(self, index: int) -> Motion:
        motion = self.motions.found[index]
        assert motion is not None
        return motion

    def _state(self, indices: Sequence[int]) -> Undo:
        serial = self.motions.table.serial
        return [(index, self.motions.found[index], int(serial[index])) for index in indices]

    def _restore(self, state: Undo) -> None:
        for index, motion, serial in state:
            self.motions.put(index, motion, serial)
            alone = self.junctions.tracks[index].alone
            self.delay[index] = 0.0 if motion is None else motion.finish - alone


def _first_of_each(undo: Undo) -> Undo:
    """Return the oldest state of each robot."""
    return list({old[0]: old for old in reversed(undo)}.values())


def _meetings(junctions: Junctions, chosen: set[int]) -> list[_Meeting]:
    """Return the zones between chosen robots."""
    places = {
        index: {zone: k for k, zone in enumerate(junctions.zones_of(index).tolist())}
        for index in chosen
    }
    found = []
    for a in sorted(chosen):
        for zone, k in places[a].items():
            b = int(junctions.zones.b[zone])
            if int(junctions.zones.a[zone]) == a and b in chosen:
                found.append(_Meeting(zone, a, b, k, places[b][zone]))
    return found
