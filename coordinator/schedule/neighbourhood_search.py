"""Better orders: robots are removed and put back in other orders where that lowers the delays.

Large neighbourhood search (Shaw 1998) by counted rounds.

Decides: which robots are removed, and which results are accepted.  Must not know: how one robot
waits (safe_intervals.py), how the first order was found.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Final

import numpy as np

from coordinator.motion.velocity_profile import Motion
from coordinator.schedule.conflict_search import ConflictSearch
from coordinator.schedule.forbidden_interval_kernels import BOTH, FIRST
from coordinator.schedule.junctions import Junctions
from coordinator.schedule.safe_intervals import Begun, earliest_motion, rest_of_motion
from coordinator.schedule.timetable import Motions

_LARGEST: Final = 6
"""Greatest number of robots that are removed in one round."""

_PAIR_NODES: Final = 4
"""Nodes that are searched for two robots of which one waits for the other."""

_SETTLING: Final = 3
"""Greatest number of times that `settle` goes through all robots."""

_GAIN: Final = 1e-6


def delays(junctions: Junctions, motions: Sequence[Motion]) -> list[float]:
    """Return how much later [s] each robot arrives than it would alone."""
    return [m.finish - t.alone for m, t in zip(motions, junctions.tracks, strict=True)]


class Improvement:
    """A search that removes robots and puts them back in orders that lower the delays."""

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
        self.failed: set[tuple[bytes, tuple[int, ...]]] = set()

    def run(self, rounds: int) -> None:
        """Run `rounds` rounds, or fewer when no robot is delayed any more."""
        for _ in range(rounds):
            late = [index for index, delay in enumerate(self.delay) if delay > _GAIN]
            if not late:
                return
            self._try(self._neighbourhood(late))

    def _may(self, index: int, motion: Motion) -> bool:
        """Return whether a motion respects the priorities.

        It does if it waits for no robot of lower priority, or if the first order did not respect
        the priorities either.
        """
        owners = (wait.owner for wait in motion.waits if wait.owner >= 0)
        mine = self.priorities[index]
        return not self.by_priority or all(self.priorities[owner] >= mine for owner in owners)

    def turn_round(self, count: int) -> None:
        """For the `count` longest waits, search all orders of the two robots, zone by zone."""
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
        """Plan robots again that wait for a robot planned later: they may wait less now."""
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

    def plan_all_again(self, most: int) -> None:
        """Plan all robots again, who arrives first ahead of others, up to _SETTLING times.

        `most` bounds the effort: the sum of the cells times the stations of all approaches.
        """
        for _ in range(_SETTLING):
            finish = [motion.finish for motion in self.motions.all()]
            for index in sorted(range(len(finish)), key=finish.__getitem__):
                approach = self.junctions.approach(index)
                most -= len(approach.rows.cell) * len(approach.ride.stations)
                if most < 0:
                    return
                self._plan_again(index)

    def plan_again(self, chosen: Sequence[int]) -> None:
        """Plan some robots again, one after the other."""
        for index in chosen:
            self._plan_again(index)

    def _plan_again(self, index: int) -> None:
        """Give a robot its earliest motion among all others, if that is no later."""
        old, serial = self.motions.found[index], int(self.motions.table.serial[index])
        assert old is not None
        self.motions.put(index, None)
        motion = earliest_motion(self.junctions, self.motions, index, latest=old.finish + _GAIN)
        if motion is None:
            motion = self._resting_less(index, old)
        if motion is None or not self._may(index, motion):
            self.motions.put(index, old, serial)
        else:
            self.motions.put(index, motion)
            self.delay[index] = motion.finish - self.junctions.tracks[index].alone

    def _resting_less(self, index: int, old: Motion) -> Motion | None:
        """Return the motion of a robot that leaves one of its rests earlier; None if there is none.

        What it does before may leave it no other time, and others none to spare.  One that drives
        more slowly than it could is left alone: it would not, before that rest.
        """
        if old.limits is not self.junctions.tracks[index].limits:
            return None
        others, best = self.junctions.rows_of(index)[0].other, None
        modes = np.where(self.motions.placed[others], BOTH, FIRST)
        for k, wait in enumerate(old.waits):
            if wait.s > 0.0:
                there = float(old.reached(np.array([wait.s]))[0])
                begun = Begun(tuple(old.waits[:k]), wait.s, there, wait.depart, wait.s, wait.s)
                motion = rest_of_motion(self.junctions, self.motions, index, begun, modes)
                if motion is not None and motion.finish < (best or old).finish - _GAIN:
                    best = motion
        return best

    def _neighbourhood(self, late: list[int]) -> list[int]:
        """Return robots to remove: a delayed one, and some that it waits for or is near."""
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
        """Put robots back in another order unless it failed before; undo it if it is no better."""
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
