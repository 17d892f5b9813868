"""The least distance of moving robots over all times no more than tau apart.

Motions are straight pieces with a proven deviation (motion_pieces.py).  A sweep over the coarse
pieces of all robots in space and time finds the pairs of pieces that may have the least slack.
Only these pieces are cut more finely and compared again, until the deviation is small enough.
Slack is the distance between two centres less the need of the pair.

Decides: how near robots come to each other by their wire bytes, to margin.RESOLUTION.  Must not
know: which distance is too small (tau_safety.py), zones or schedules.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from coordinator.curves.nurbs import Array
from coordinator.proof.motion_pieces import Flights, Pieces
from coordinator.proof.separation_kernels import (
    BEGIN,
    END,
    HIGH,
    LOW,
    X0,
    X1,
    Indices,
    Motions,
    finer_pairs,
    near_pairs,
)
from coordinator.scenario.margin import RESOLUTION

_COARSE: Final = 2e-2
_FINER: Final = (1e-3, 5e-5)
"""Deviations [m] of finer pieces, used in turn.  Four times the last one, plus arc errors, is below
margin.RESOLUTION."""

_REACH: Final = 0.1
"""The first guess [m] of the least slack; while no pair is found, it is multiplied by four."""

_FARTHEST: Final = 1e6
"""Motions that are not nearer than this [m] at any two times that count are never compared."""

_BLOCK: Final = 4.0
_MOST_BLOCKS: Final = 2000
"""Time is swept in blocks of _BLOCK seconds, or in _MOST_BLOCKS longer blocks in a long plan."""


@dataclass(frozen=True)
class Closest:
    """The least slack and the distance there [m], both robots (indices), when [s] and where [m].

    The true least slack is never below `slack` by more than margin.RESOLUTION.  It is above it by
    more than that only where places by arc length are uncertain.
    """

    slack: float
    distance: float
    a: int
    b: int
    t_a: float
    t_b: float
    x: float
    y: float


@dataclass(frozen=True, eq=False)
class _Candidates:
    """Pairs (m, 2) of pieces (indices), and for each a row (4,) as in separation_kernels.py."""

    pieces: Pieces
    pairs: Indices
    found: Array

    @property
    def robots(self) -> Indices:
        """The robots that the pieces belong to, (m, 2), the smaller index first."""
        return self.pieces.robot[self.pairs]

    def pick(self, which: Indices) -> _Candidates:
        return _Candidates(self.pieces, self.pairs[which], self.found[which])


class Separation:
    """How near robots of a fleet come to each other, at all times no more than tau [s] apart."""

    def __init__(self, flights: Flights, tau: float) -> None:
        self._flights = flights
        self._tau = tau
        self._pieces = self._flights.pieces(_COARSE)
        self._first = np.searchsorted(self._pieces.robot, np.arange(len(flights.driven) + 1))
        self._block = max(_BLOCK, self._flights.finish / _MOST_BLOCKS)

    def least(self, keep: Array, reach: float = _REACH) -> Closest | None:
        """Return the least slack of all pairs; None where no two motions are compared.

        The need of a pair is the sum of its robots' `keep` (n,) [m].  `reach` [m]: a guess of the
        least slack; a guess that is too small costs another sweep.
        """
        if len(keep) < 2:
            return None
        while reach < _FARTHEST:
            candidates = self._near(keep, reach, each=False)
            if len(candidates.pairs):
                finest = self._refined(candidates, keep, math.inf, each=False)
                found = self._worst(finest, keep, each=False)[0]
                if found.slack <= reach:
                    return found
                # By its coarse pieces a pair may be a candidate although others are nearer.
                reach = found.slack
            else:
                reach = 4.0 * max(reach, _REACH)
        return None

    def below(self, keep: Array, limit: float) -> list[Closest]:
        """Return the least slack of every pair for which it is below a limit [m], least first."""
        candidates = self._refined(self._near(keep, limit, each=True), keep, limit, each=True)
        worst = [one for one in self._worst(candidates, keep, each=True) if one.slack < limit]
        return sorted(worst, key=lambda one: one.slack)

    def _near(self, keep: Array, limit: float, each: bool) -> _Candidates:
        motions = Motions(self._pieces.rows, self._first, keep, self._flights.asked)
        pairs, found = near_pairs(motions, self._tau, self._block, limit, each)
        _, distinct = np.unique(pairs[:, 0] * len(self._pieces.rows) + pairs[:, 1], True)
        return _Candidates(self._pieces, pairs[distinct], found[distinct])

    def _refined(
        self, candidates: _Candidates, keep: Array, limit: float, each: bool
    ) -> _Candidates:
        """Return the candidates among the finest pieces that may have the least slack.

        This is the least of all pairs of robots or, with `each`, the least of each pair by itself.
        """
        for tolerance in _FINER:
            group = self._groups(candidates, each)
            least = np.full(group.max(initial=-1) + 1, limit)
            np.minimum.at(least, group, candidates.found[:, HIGH])
            promising = np.flatnonzero(candidates.found[:, LOW] <= least[group])
            used, pairs = np.unique(candidates.pairs[promising], return_inverse=True)
            finer, origin = self._flights.split(candidates.pieces.pick(used), tolerance)
            needs = keep[candidates.robots[promising]].sum(axis=1)
            parts = np.searchsorted(origin, np.arange(len(used) + 1))
            limits = least[group[promising]]
            found = finer_pairs(finer.rows, pairs.reshape(-1, 2), parts, needs, self._tau, limits)
            candidates = _Candidates(finer, *found)
        return candidates

    def _groups(self, candidates: _Candidates, each: bool) -> Indices:
        """Return for each candidate the number (m,) of its group, from 0.

        The least slack is sought in each group.  All candidates form one group or, with `each`,
        those of each pair of robots form a group of their own.
        """
        if not each:
            return np.zeros(len(candidates.pairs), dtype=np.int64)
        a, b = candidates.robots.T
        return np.unique(a * len(self._flights.driven) + b, return_inverse=True)[1]

    def _worst(self, candidates: _Candidates, keep: Array, each: bool) -> list[Closest]:
        """Return where the slack is least in each group, in the order of the groups."""
        group, (low, high, t_a, t_b) = self._groups(candidates, each), candidates.found.T
        order = np.lexsort((high, group))
        firsts = order[np.unique(group[order], return_index=True)[1]]
        certain = np.full(len(firsts), math.inf)
        np.minimum.at(certain, group, low)
        robots, rows = candidates.robots, candidates.pieces.rows
        closest = []
        for row in firsts.tolist():
            a, b = robots[row].tolist()
            p, q = rows[candidates.pairs[row]]
            x, y = 0.5 * (_place(p, t_a[row]) + _place(q, t_b[row]))
            slack = float(min(high[row], certain[group[row]] + RESOLUTION))
            distance = slack + float(keep[a] + keep[b])
            when = (float(t_a[row]), float(t_b[row]))
            closest.append(Closest(slack, distance, a, b, *when, float(x), float(y)))
        return closest


def _place(piece: Array, time: float) -> Array:
    """Return the place (2,) [m] on a piece at a time [s]."""
    part = (time - piece[BEGIN]) / (piece[END] - piece[BEGIN])
    start, end = piece[X0 : X0 + 2], piece[X1 : X1 + 2]
    return np.asarray(start + part * (end - start))
