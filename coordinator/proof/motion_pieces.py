"""Where robots are over time, as straight pieces driven at constant speed with a proven deviation.

A piece replaces the robot's motion between two moments of one leg.  If two places are l apart along
the curve and c apart in a straight line, the curve between them lies in an ellipse with these foci:
it stays within sqrt(l^2 - c^2) / 2 across that line and within l - c along it.  An acceleration a
moves the robot by at most a t^2 / 8 along its path in the time t of the piece.  The only value that
is measured by sampling is `Driven.arc_error`.

Decides: how a motion becomes pieces.  Must not know: other robots, zones or schedules.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from coordinator.base.kept import kept
from coordinator.curves.nurbs import Array
from coordinator.plan.wire import Driven
from coordinator.proof.separation_kernels import BEGIN, DEVIATION, END, Indices

_ROUNDING: Final = 1e-9
"""By how much [m] rounding may make a measured arc length too short."""

_ARC_ERRORS: Final = 2.5
"""Uncertainty of a place as a multiple of the arc error: 1 at the ends of a piece, 1 between them,
and 0.5 because the arc error itself is measured."""

_LEG_BEGIN, _LEG_END, _LEG_S, _LEG_V, _LEG_RATE = range(5)
"""Columns of legs (n, 5): begin and end [s], arc length [m] and speed [m/s] at the begin,
acceleration [m/s^2]."""

_TIME, _X, _Y, _S = range(4)
"""Columns of nodes (m, 4): time [s], place [m] and exact arc length [m]."""

_ROUNDS: Final = 24
_MOST_PARTS: Final = 64.0
"""Pieces are cut at most _ROUNDS times, each time into at most _MOST_PARTS parts."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """Motions of robots in m pieces, sorted by robot, then time.

    rows (m, 7): their columns are named in separation_kernels.py.  robot (m,), leg (m,): indices.
    """

    rows: Array
    robot: Indices
    leg: Indices

    def pick(self, which: Indices) -> Pieces:
        """Return some of the pieces."""
        return Pieces(self.rows[which], self.robot[which], self.leg[which])


class Part(NamedTuple):
    """The part of a fleet's motions that is compared: what a change of some courses concerns.

    spans: for each course the plan times [s] from and until which it may be driven.  asked: whether
    a course is compared with all others; others are compared with those alone.
    """

    spans: Sequence[tuple[float, float]]
    asked: Sequence[bool]


class Flights:
    """The motions c_i(t) of a fleet, from plan time 0 until 1 s after the last robot has arrived.

    Before and after that, robots stand at their starts and goals, so other times add no places.
    With `part`, each motion only lasts for its span, or until that time.
    """

    def __init__(self, driven: Sequence[Driven], part: Part | None = None) -> None:
        self.driven = driven
        spans = [(0.0, math.inf)] * len(driven) if part is None else list(part.spans)
        begin, end = np.array(spans).reshape(-1, 2).T
        departs, start, arrives, goal = np.array([_ends(one) for one in driven]).reshape(-1, 4).T
        self.finish = 1.0 + max([*arrives.tolist(), *begin.tolist()])
        self.asked = np.ones(len(driven), np.bool_) if part is None else np.array(part.asked)
        under_way = np.column_stack((np.maximum(begin, departs), np.minimum(end, arrives)))
        self._ways = list(zip(driven, map(tuple, under_way.tolist()), strict=True))
        drives = [_driving_legs(one, *span) for one, span in self._ways]
        before = _standing(begin, np.minimum(departs, end), start)
        after = _standing(np.maximum(arrives, begin), np.minimum(end, self.finish), goal)
        stands = np.stack((before, after), axis=1)
        lasts = stands[:, :, _LEG_BEGIN] < stands[:, :, _LEG_END]
        moving = [len(legs) for legs in drives]
        self._sizes = np.column_stack((lasts[:, 0], moving, lasts[:, 1])).astype(np.int64)
        still = _standing_ends(self._sizes)
        self._legs = np.empty((int(self._sizes.sum()), 5))
        self._legs[still] = stands[lasts]
        moves = np.ones(len(self._legs), np.bool_)
        moves[still] = False
        self._legs[moves] = np.concatenate(drives)
        self._robot = np.repeat(np.arange(len(driven)), self._sizes.sum(axis=1))
        self._noise = _ARC_ERRORS * np.array([one.arc_error for one in driven])
        self._is_part = part is not None

    def pieces(self, tolerance: float) -> Pieces:
        """Return all motions in pieces; `tolerance` [m] bounds their deviation as in `split`.

        For a part of a fleet's motions those of each robot are kept: most courses with which a new
        one is compared have been compared with another one before.
        """
        if not self._is_part:
            return self._pieces_of(np.arange(len(self._legs)), tolerance)
        own = [_own_pieces(one, *span, tolerance) for one, span in self._ways]
        sizes = self._sizes.copy()
        sizes[:, 1] = [len(one.rows) for one in own]
        robot = np.repeat(np.arange(len(own)), sizes.sum(axis=1))
        rows, leg = np.empty((len(robot), 7)), np.empty(len(robot), np.int64)
        borders = np.cumsum(sizes).reshape(-1, 3)[:, :2]
        for one, (begin, end) in zip(own, borders.tolist(), strict=True):
            rows[begin:end], leg[begin:end] = one.rows, one.leg
        leg += np.cumsum(self._sizes).reshape(-1, 3)[robot, 0]
        still, legs = _standing_ends(sizes), _standing_ends(self._sizes)
        rows[still], leg[still] = self._standing_pieces(legs).rows, legs
        return Pieces(rows, robot, leg)

    def _standing_pieces(self, legs: Indices) -> Pieces:
        """Return the pieces of these legs, on which robots stand."""
        robot, (begin, end, s, _, _) = self._robot[legs], self._legs[legs].T
        who = zip(robot.tolist(), s.tolist(), strict=True)
        x, y = np.array([_place(self.driven[index], at) for index, at in who]).reshape(-1, 2).T
        return Pieces(np.column_stack((begin, end, x, y, x, y, np.zeros(len(x)))), robot, legs)

    def _pieces_of(self, legs: Indices, tolerance: float) -> Pieces:
        ends = self._nodes(np.repeat(legs, 2), self._legs[legs][:, (_LEG_BEGIN, _LEG_END)].ravel())
        return self.split(self._pieces(ends, legs, np.arange(0, 2 * len(legs), 2)), tolerance)[0]

    def split(self, pieces: Pieces, tolerance: float) -> tuple[Pieces, Indices]:
        """Return finer pieces, and for each of them (m,) the index of the piece that it is part of.

        They deviate by at most `tolerance` [m] plus _ARC_ERRORS times the robot's arc error.
        """
        origin = np.arange(len(pieces.rows))
        for _ in range(_ROUNDS):
            excess = (pieces.rows[:, DEVIATION] - self._noise[pieces.robot]) / tolerance
            rough = np.flatnonzero(excess > 1.0)
            if not len(rough):
                break
            parts = np.ones(len(excess), dtype=np.int64)
            parts[rough] = np.clip(np.ceil(1.1 * np.sqrt(excess[rough])), 2.0, _MOST_PARTS)
            owner = np.repeat(np.arange(len(parts)), parts)
            finer = pieces.pick(owner)
            changed = self._cut(pieces.pick(rough), parts[rough])
            finer.rows[parts[owner] > 1] = changed.rows
            pieces, origin = finer, origin[owner]
        return pieces, origin

    def _arcs(self, leg: Indices, time: Array) -> Array:
        """Return arc lengths (m,) [m] at times (m,) [s] of legs (m,)."""
        begin, end, s, v, rate = self._legs[leg].T
        passed = np.clip(time, begin, end) - begin
        return np.asarray(s + passed * (v + 0.5 * rate * passed))

    def _nodes(self, leg: Indices, time: Array) -> Array:
        """Return nodes (m, 4) at times (m,) of legs (m,), which have to be sorted by robot."""
        robot = self._robot[leg]
        s = self._arcs(leg, time)
        nodes = np.empty((len(time), 4))
        nodes[:, _TIME] = time
        borders = np.searchsorted(robot, np.arange(len(self.driven) + 1))
        for index, (first, end) in enumerate(pairwise(borders.tolist())):
            if first < end:
                curve = self.driven[index].curve
                u = curve.parameter_at(s[first:end])
                nodes[first:end, _X : _Y + 1] = curve.evaluate(u)
                nodes[first:end, _S] = curve.arc_at(u)
        return nodes

    def _cut(self, pieces: Pieces, parts: Indices) -> Pieces:
        """Return pieces cut into `parts` (m,) parts each, of equal duration."""
        owner = np.repeat(np.arange(len(parts)), parts + 1)
        last = np.cumsum(parts + 1) - 1
        step = np.arange(len(owner)) - (last - parts)[owner]
        begin, end = pieces.rows[owner, BEGIN], pieces.rows[owner, END]
        time = begin + (end - begin) * (step / parts[owner])
        time[last] = pieces.rows[:, END]
        nodes = self._nodes(pieces.leg[owner], time)
        inner = np.flatnonzero(step < parts[owner])
        return self._pieces(nodes, pieces.leg[owner[inner]], inner)

    def _pieces(self, nodes: Array, leg: Indices, first: Indices) -> Pieces:
        """Return the pieces from nodes `first` (m,) to the next ones, with their deviation."""
        begin, end = nodes[first], nodes[first + 1]
        rate = self._legs[leg, _LEG_RATE]
        moves = (self._legs[leg, _LEG_V] != 0.0) | (rate != 0.0)
        straight = np.hypot(end[:, _X] - begin[:, _X], end[:, _Y] - begin[:, _Y])
        excess = np.maximum(end[:, _S] - begin[:, _S] - straight, 0.0) + _ROUNDING
        curved = np.hypot(0.5 * np.sqrt(excess * (2.0 * straight + excess)), excess)
        duration = end[:, _TIME] - begin[:, _TIME]
        robot = self._robot[leg]
        uneven = 0.125 * np.abs(rate) * duration * duration + self._noise[robot]
        deviation = np.where(moves, curved + uneven, 0.0)
        places = begin[:, _X : _Y + 1], end[:, _X : _Y + 1]
        rows = np.column_stack((begin[:, _TIME], end[:, _TIME], *places, deviation))
        return Pieces(rows, robot, leg)


@kept
def _own_pieces(driven: Driven, begin: float, end: float, tolerance: float) -> Pieces:
    """Return the pieces of one robot between its departure and its arrival; legs from 0 on."""
    alone = Flights((driven,), None)
    alone._legs = _driving_legs(driven, begin, end)
    alone._robot = np.zeros(len(alone._legs), np.int64)
    return alone._pieces_of(np.arange(len(alone._legs)), tolerance)


@kept
def _place(driven: Driven, s: float) -> tuple[float, float]:
    """Return where a robot is [m] at an arc length [m] of its curve."""
    ((x, y),) = driven.curve.at_arc(np.array([s])).tolist()
    return x, y


@kept
def _ends(driven: Driven) -> tuple[float, float, float, float]:
    """Return when [s] and where [m] a robot departs, and when and where it arrives."""
    line, (departs, start) = driven.timeline, driven.legs[(0, 2), 0].tolist()
    return departs, start, line.finish, line.length


@kept
def _driving_legs(driven: Driven, begin: float, end: float) -> Array:
    """Return the legs (n, 5) of a motion in a span of time [s] between departure and arrival.

    There is a leg for each rest on the way.
    """
    t0, t1, s0, _, v0, v1 = driven.legs
    driving = np.column_stack((t0, t1, s0, v0, (v1 - v0) / (t1 - t0)))
    still = np.zeros(len(t0))
    resting = np.column_stack((np.append(t0[0], t1[:-1]), t0, s0, still, still))
    legs = np.stack((resting, driving), axis=1).reshape(-1, 5)
    missed = np.clip(begin - legs[:, _LEG_BEGIN], 0.0, None)
    legs[:, _LEG_S] += missed * (legs[:, _LEG_V] + 0.5 * legs[:, _LEG_RATE] * missed)
    legs[:, _LEG_V] += legs[:, _LEG_RATE] * missed
    legs[:, _LEG_BEGIN] += missed
    legs[:, _LEG_END] = np.minimum(legs[:, _LEG_END], end)
    return legs[legs[:, _LEG_BEGIN] < legs[:, _LEG_END]]


def _standing(since: Array, until: Array, s: Array) -> Array:
    """Return legs (n, 5) of robots that stand at s [m]; some may have no duration."""
    return np.column_stack((since, until, s, np.zeros(len(s)), np.zeros(len(s))))


def _standing_ends(sizes: Indices) -> Indices:
    """Return which rows are a robot's stand before it departs or after it has arrived, in order.

    sizes (n, 3): how many rows each robot has before, between and after.
    """
    ends: Indices = np.cumsum(sizes).reshape(-1, 3)[:, ::2]
    return ends[sizes[:, ::2] > 0] - 1
