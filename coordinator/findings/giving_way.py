"""Finds in a plan which robots slow down or leave their shortest ways, and for which others.

Decides: a robot slows down where it drives more slowly than its own limits allow.  A bend of its
path is for the first robot that it would have met on its shortest way; it passes behind that robot,
before it, or aside from it.  Must not know: how the plan was made, how this is shown.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import msgspec
import numpy as np
from scipy.spatial import cKDTree

from coordinator.curves.nurbs import Array
from coordinator.findings.meetings import Meetings, Track, beside, only
from coordinator.motion.velocity_profile import Motion, Wait, limits_on
from coordinator.plan.document import Path, PlanDocument, RobotPlan
from coordinator.plan.shares_of_tau import BRAKING_SHARE
from coordinator.plan.wire import Driven, curve_of, drive

SLOWS: Final = "slows for"
BEHIND: Final = "passes behind"
BEFORE: Final = "passes before"
ASIDE: Final = "moves aside for"

_SLOWER: Final = 0.03
"""A robot slows down where it takes longer than it could by more than this share."""

_LEAST_LOSS: Final = 0.2
"""Stretches on which a robot loses less than this [s] are not told."""

_PAUSE: Final = 1.0
"""Slow stretches with less than this [s] between them are one."""

_OFF: Final = 0.5
"""A path leaves the shortest way where it is off it by this share of the robot's radius."""

_STEP: Final = 0.3
"""Distance between the places of a shortest way, as a share of the robot's radius."""

_ROOM: Final = (0.05, 0.4)
"""How much farther [m] and longer [s] than needed robots keep off others when they give way."""


class GivingWay(msgspec.Struct, frozen=True, kw_only=True):
    """A robot that gives way to `other` without a rest, `how`: SLOWS, BEHIND, BEFORE or ASIDE.

    since, until [s of plan time] and on [m]: when and where it drives more slowly, or is off its
    shortest way; if it passes behind or before the other, until it has.  lost [s]: what driving
    slowly costs it; 0 for a bend.
    """

    epoch: int
    robot: str
    how: str
    other: str
    since: float
    until: float
    on: tuple[float, float]
    lost: float = 0.0


def giving_way(document: PlanDocument, rides: Sequence[Driven] | None = None) -> list[GivingWay]:
    """Return how the robots of a plan give way, in the plan's order and by time.

    `rides`: what `drive` returned for the document, if the caller has it already.
    """
    rides = rides or drive(document)
    meetings = Meetings(document, rides)
    share = _speed_share(document)
    found = []
    for index, (robot, ride) in enumerate(zip(document.robots, rides, strict=True)):
        mine = [*_slowings(document, meetings, index, ride, share)]
        if robot.shortest is not None:
            mine += _bends(document, meetings, index, robot.shortest)
        found += sorted(mine, key=lambda one: one.since)
    return found


def _speed_share(document: PlanDocument) -> float:
    """Return the share of their speeds that robots use: some robot drives as fast as it may."""
    shares = [
        max(v for _, v in robot.profile) / robot.limits.max_speed
        for robot in document.robots
        if robot.limits is not None
    ]
    return min(max(shares, default=1.0), 1.0)


class _Slow(NamedTuple):
    """Where and when a robot is slower than it could be, and what it loses [s]."""

    on: tuple[float, float]
    since: float
    until: float
    lost: float


def _slowings(
    document: PlanDocument, meetings: Meetings, index: int, ride: Driven, share: float
) -> Iterator[GivingWay]:
    """Yield where a robot slows down for others."""
    robot = document.robots[index]
    rests = [*(stop.s for stop in robot.stops), math.inf]
    for slow in _slow_stretches(document, robot, ride, share):
        end = next(s for s in rests if s > slow.on[0])
        owner, _ = meetings.forcing(index, (slow.on[0], end), slow.lost)
        if owner:
            yield GivingWay(
                epoch=document.epoch,
                robot=robot.id,
                how=SLOWS,
                other=owner,
                since=slow.since,
                until=slow.until,
                on=slow.on,
                lost=slow.lost,
            )


def _slow_stretches(
    document: PlanDocument, robot: RobotPlan, ride: Driven, share: float
) -> list[_Slow]:
    """Return where a robot drives more slowly than its limits and its rests make it."""
    limits = robot.limits
    if limits is None:
        return []
    accel, lateral, turning = (
        math.inf if limit is None else limit
        for limit in (limits.max_accel, limits.max_lateral_accel, limits.max_turn_rate)
    )
    braking = 1.0 if document.policy == "paper" else BRAKING_SHARE
    speed = share * limits.max_speed
    allowed = limits_on(ride.curve, speed, braking * accel, lateral, turning)
    rests = [Wait(stop.s, stop.depart, -1) for stop in robot.stops]
    free = Motion(allowed, [Wait(0.0, robot.start_time, -1), *rests])
    t0, _, s0, s1, v0, v1 = ride.legs
    s = np.union1d(np.concatenate((s0, s1)), free.knots_s.clip(0.0, s1[-1]))
    middle = 0.5 * (s[1:] + s[:-1])
    leg = np.minimum(np.searchsorted(s1, middle), len(s1) - 1)
    now = _passing(s, s0[leg], s1[leg], v0[leg] ** 2, v1[leg] ** 2)
    k = np.clip(np.searchsorted(free.knots_s, middle) - 1, 0, len(free.knots_s) - 2)
    knots, heights = free.knots_s, free.knots_w
    could = _passing(s, knots[k], knots[k + 1], heights[k], heights[k + 1])
    passed = np.append(0.0, np.cumsum(now))
    first = np.searchsorted(leg, leg)
    begin = t0[leg] + passed[:-1] - passed[first]
    found: list[_Slow] = []
    for n in np.flatnonzero(now > (1.0 + _SLOWER) * could).tolist():
        one = _Slow(
            (float(s[n]), float(s[n + 1])),
            float(begin[n]),
            float(begin[n] + now[n]),
            float(now[n] - could[n]),
        )
        if found and one.since - found[-1].until < _PAUSE:
            last = found.pop()
            on = (last.on[0], one.on[1])
            one = _Slow(on, last.since, one.until, last.lost + one.lost)
        found.append(one)
    return [one for one in found if one.lost >= _LEAST_LOSS]


def _passing(s: Array, s0: Array, s1: Array, w0: Array, w1: Array) -> Array:
    """Return how long [s] the pieces between arc lengths s (n + 1,) take.

    Piece k lies on a leg from s0[k] to s1[k] [m], on which the square of the speed goes evenly from
    w0[k] to w1[k].
    """
    slope = (w1 - w0) / np.maximum(s1 - s0, 1e-12)
    ends = [np.sqrt(np.maximum(w0 + slope * (at - s0), 0.0)) for at in (s[:-1], s[1:])]
    taken: Array = 2.0 * np.diff(s) / np.maximum(ends[0] + ends[1], 1e-9)
    return taken


def _bends(
    document: PlanDocument, meetings: Meetings, index: int, shortest: Path
) -> Iterator[GivingWay]:
    """Yield where a robot leaves its shortest way for others."""
    robot, mine = document.robots[index], meetings.tracks[index]
    curve = curve_of(shortest)
    arcs = np.linspace(0.0, curve.length, 1 + max(int(curve.length / (_STEP * robot.radius)), 1))
    direct = curve.at_arc(arcs)
    off, nearest = cKDTree(direct).query(mine.places)
    at = np.asarray(nearest)
    speed = max(v for _, v in robot.profile)
    is_off = np.concatenate(([False], off > _OFF * robot.radius, [False]))
    edges = np.flatnonzero(np.diff(is_off.astype(int))).reshape(-1, 2)
    for begin, end in (edges - [1, 0]).clip(0, len(mine.s) - 1).tolist():
        a, b = sorted((int(at[begin]), int(at[end])))
        times = mine.left[begin] + (arcs[a : b + 1] - arcs[a]) / speed
        instead = Track(arcs[a : b + 1], direct[a : b + 1], times, times)
        other = _first_met(document, meetings, index, instead)
        if other < 0:
            continue
        aside = only(mine, (mine.s >= mine.s[begin]) & (mine.s <= mine.s[end]))
        how, last = _passes(aside, meetings.tracks[other], meetings.need(index, other))
        yield GivingWay(
            epoch=document.epoch,
            robot=robot.id,
            how=how,
            other=document.robots[other].id,
            since=float(mine.left[begin]),
            until=float(aside.reached[last]),
            on=(float(mine.s[begin]), float(aside.s[last])),
        )


def _first_met(document: PlanDocument, meetings: Meetings, index: int, instead: Track) -> int:
    """Return the robot that one would meet first on another way than its own; -1 for none."""
    room, slack = _ROOM
    slack += document.tau
    best, found = len(instead.s), -1
    for other in meetings.near(index, instead, slack, slack):
        theirs, times = meetings.tracks[other], instead.reached[:best]
        soon = (theirs.left > times[0] - slack) & (theirs.reached < times[-1] + slack)
        need = meetings.need(index, other) + room
        theirs, _ = beside(only(theirs, soon), only(instead, slice(best)), need)
        near = _near(instead.places[:best], theirs.places, need)
        near &= (theirs.reached - slack < times[:, None]) & (times[:, None] < theirs.left + slack)
        first = np.flatnonzero(near.any(axis=1))
        if len(first):
            best, found = int(first[0]), other
        if best == 0:
            break
    return found


def _passes(mine: Track, theirs: Track, need: float) -> tuple[str, int]:
    """Return how a robot on a stretch of its path passes another robot, and at which place."""
    theirs, _ = beside(theirs, mine, need)
    near = _near(mine.places, theirs.places, need)
    after = (mine.reached[:, None] > theirs.left)[near]
    if not len(after) or (after.any() and not after.all()):
        return ASIDE, len(mine.s) - 1
    return BEHIND if after.all() else BEFORE, int(np.flatnonzero(near.any(axis=1))[-1])


def _near(
    mine: Array, theirs: Array, need: float
) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
    """Return which of places (n, 2) are nearer than `need` [m] to others (m, 2), as (n, m)."""
    x, y = (mine[:, None, axis] - theirs[None, :, axis] for axis in (0, 1))
    return np.asarray(x * x + y * y < need * need)
