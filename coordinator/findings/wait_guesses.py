"""Finds from plans alone for whom robots wait, since no message states it.

Decides: a robot waits for the first robot ahead that it would still have met had it waited half as
long.  If there is none, it waits for the one that it follows most closely.  The planner uses the
same rule (schedule/wait_owners.py).  Must not know: how the plan was made.  In a schedule no wait
is longer than necessary, so there is always a robot that forces it.  The result is only shown to
people; no decision depends on it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
from msgspec.structs import replace
from scipy.ndimage import label

from coordinator.curves.nurbs import Array
from coordinator.plan.document import PlanDocument, Reason, RobotPlan
from coordinator.plan.wire import Driven, drive

_STEP: Final = 0.2
"""Step between the sampled places of a path, as a share of the robot's radius."""

_MOST: Final = 400
"""Greatest number of places at which a path is sampled."""

_FORCED: Final = 1.0
"""A robot does not force a short wait if it is followed with more time to spare [s] than this."""

_MOST_OF_IT: Final = 0.5
"""A robot that forces at least this share of a wait explains it."""


class _Track(NamedTuple):
    """Places (n, 2) [m] of a path at arc lengths (n,) [m], reached and left at times (n,) [s]."""

    s: Array
    places: Array
    reached: Array
    left: Array


class _Follows(NamedTuple):
    """The time to spare [s] behind another robot, and both paths' stretches of the conflict [m]."""

    spare: float
    zone: tuple[float, float]
    their_zone: tuple[float, float]


def with_reasons(document: PlanDocument) -> PlanDocument:
    """Return the plan with the reason of every wait for which one can be found."""
    rides = drive(document)
    tracks = [_track(ride) for ride in rides]
    robots, waits = [], []
    for index, robot in enumerate(document.robots):
        told, reasons = _explained(document, tracks, index, robot)
        robots.append(told)
        waits += reasons
    return replace(document, robots=robots, waits=waits)


def _explained(
    document: PlanDocument, tracks: Sequence[_Track], index: int, robot: RobotPlan
) -> tuple[RobotPlan, list[Reason]]:
    """Return the robot with `yields_to` filled in, and the reasons of its waits."""
    rests = [(stop.s, stop.depart - stop.arrive) for stop in robot.stops]
    late = robot.start_time > 0.0
    if late:
        rests.insert(0, (0.0, robot.start_time))
    ends = [s for s, _ in [*rests[1:], (math.inf, 0.0)]][: len(rests)]
    owners, reasons = [], []
    for (s, lasts), end in zip(rests, ends, strict=True):
        owner, found = _forces(document, tracks, index, (s, end), lasts)
        owners.append(owner)
        if found is not None:
            reasons.append(
                Reason(
                    robot=robot.id,
                    s=s,
                    wait=lasts,
                    yields_to=owner,
                    zone=found.zone,
                    their_zone=found.their_zone,
                )
            )
    stops = [
        replace(stop, yields_to=owner)
        for stop, owner in zip(robot.stops, owners[1:] if late else owners, strict=True)
    ]
    return replace(robot, stops=stops, start_yields_to=owners[0] if late else ""), reasons


def _forces(
    document: PlanDocument,
    tracks: Sequence[_Track],
    index: int,
    within: tuple[float, float],
    lasts: float,
) -> tuple[str, _Follows | None]:
    """Return the robot that forces a wait, "" if none does, and how closely it is followed.

    lasts: how long the wait is [s]; within: arc lengths [m] of the wait and of the next rest.
    """
    mine, radius = tracks[index], document.robots[index].radius
    ahead = (mine.s > within[0]) & (mine.s <= within[1])
    part = _only(mine, ahead)
    followed: list[tuple[_Follows, str]] = []
    for other, robot in enumerate(document.robots):
        if other == index or not len(part.s):
            continue
        need = radius + robot.radius + document.margin
        found = _follows(part, tracks[other], need, document.tau, max(_FORCED, _MOST_OF_IT * lasts))
        if found is not None and found.spare < max(_FORCED, _MOST_OF_IT * lasts):
            followed.append((found, robot.id))
    if not followed:
        return "", None
    forcing = [pair for pair in followed if pair[0].spare <= _MOST_OF_IT * lasts]
    first = min(forcing, key=lambda pair: pair[0].zone[0], default=None)
    best, owner = first or min(followed, key=lambda pair: pair[0].spare)
    return owner, best


def _follows(mine: _Track, theirs: _Track, need: float, tau: float, most: float) -> _Follows | None:
    """Return how closely, within `most` [s], one robot follows another; None if they never meet."""
    soon = (theirs.left > mine.reached[0] - tau - most) & (theirs.reached < mine.reached[-1])
    mine, theirs = _beside(mine, _only(theirs, soon), need)
    theirs, mine = _beside(theirs, mine, need)
    if not len(mine.s) or not len(theirs.s):
        return None
    x = mine.places[:, None, 0] - theirs.places[None, :, 0]
    y = mine.places[:, None, 1] - theirs.places[None, :, 1]
    near = x * x + y * y < need * need
    spare = np.where(near, mine.reached[:, None] - theirs.left[None] - tau, math.inf)
    behind = np.where(spare > -tau, spare, math.inf)
    if not np.isfinite(behind).any():
        return None
    at = np.unravel_index(int(np.argmin(behind)), behind.shape)
    zone, their_zone = _stretches(near, (int(at[0]), int(at[1])), mine.s, theirs.s)
    return _Follows(float(behind[at]), zone, their_zone)


def _only(track: _Track, kept: npt.NDArray[np.bool_]) -> _Track:
    return _Track(*(column[kept] for column in track))


def _beside(one: _Track, other: _Track, need: float) -> tuple[_Track, _Track]:
    """Return two tracks, the first without the places far from the second one's bounding box."""
    if not len(other.s):
        return _only(one, np.zeros(len(one.s), dtype=bool)), other
    low, high = other.places.min(axis=0) - need, other.places.max(axis=0) + need
    return _only(one, np.all((one.places >= low) & (one.places <= high), axis=1)), other


def _stretches(
    near: npt.NDArray[np.bool_], at: tuple[int, int], mine: Array, theirs: Array
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the stretches of both paths that form one conflict with the given pair of places."""
    pieces, _ = label(near)
    rows, columns = np.nonzero(pieces == pieces[at])
    return (
        (float(mine[rows.min()]), float(mine[rows.max()])),
        (float(theirs[columns.min()]), float(theirs[columns.max()])),
    )


def _track(ride: Driven) -> _Track:
    """Return a path with the times at which its robot reaches and leaves each place."""
    line, length = ride.timeline, ride.curve.length
    count = min(2 + math.ceil(length / (_STEP * ride.radius)), _MOST)
    s = np.linspace(0.0, length, count)
    starts, ends = np.asarray(line.t0), np.asarray(line.t1)
    knots_t = np.union1d(np.concatenate((starts, ends)), np.linspace(0.0, line.finish, 4 * count))
    knots_s = np.maximum.accumulate([line.s_at(t) for t in knots_t.tolist()])
    reached = knots_t[np.minimum(np.searchsorted(knots_s, s - 1e-6), len(knots_t) - 1)]
    after = np.searchsorted(knots_s, s + 1e-6, side="right")
    left = knots_t[np.minimum(after, len(knots_t) - 1)]
    return _Track(s, ride.curve.at_arc(s), reached, left)
