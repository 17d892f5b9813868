"""Which robots a robot meets: who would have been in its way, had it been earlier.

Plans do not state for whom a robot waits or slows down.

Decides: a loss of time is for the first robot ahead that would still have been met with half of the
loss.  If there is none, it is for the one that is followed most closely.  The planner uses the same
rule (schedule/wait_owners.py).  Must not know: how the plan was made.  In a schedule no wait is
longer than necessary, so there is always a robot that forces it.  The result is only shown to
people; no decision depends on it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.ndimage import label

from coordinator.curves.nurbs import Array
from coordinator.findings.ride_samples import arcs_on
from coordinator.plan.document import PlanDocument
from coordinator.plan.wire import Driven

_STEP: Final = 0.2
"""Step between the sampled places of a path, as a share of the robot's radius."""

_MOST: Final = 400
"""Greatest number of places at which a path is sampled."""

_FORCED: Final = 1.0
"""A robot does not force a short wait if it is followed with more time to spare [s] than this."""

_MOST_OF_IT: Final = 0.5
"""A robot that forces at least this share of a loss explains it."""


_PIECE: Final = 25
"""Number of places of a piece of a way whose box tells who may be near."""


class Track(NamedTuple):
    """Places (n, 2) [m] of a path at arc lengths (n,) [m], reached and left at times (n,) [s]."""

    s: Array
    places: Array
    reached: Array
    left: Array


class Follows(NamedTuple):
    """The time to spare [s] behind another robot, and both paths' stretches of the conflict [m]."""

    spare: float
    zone: tuple[float, float]
    their_zone: tuple[float, float]


class _Pieces(NamedTuple):
    """Boxes in space [m] and time [s] around pieces of a way, (n,) each."""

    x0: Array
    y0: Array
    x1: Array
    y1: Array
    begin: Array
    end: Array


class Meetings:
    """The motions of a plan's robots, sampled; `rides`: what `drive` returns for the document."""

    def __init__(self, document: PlanDocument, rides: Sequence[Driven]) -> None:
        self._document = document
        self.tracks = [_track(ride) for ride in rides]
        self._radii = np.array([robot.radius for robot in document.robots])
        pieces = [_pieces(track) for track in self.tracks]
        none = np.empty((len(_Pieces._fields), 0))
        self._pieces = _Pieces(*np.concatenate((none, *pieces), axis=1))
        self._owner = np.repeat(np.arange(len(pieces)), [len(one.x0) for one in pieces])

    def need(self, index: int, other: int) -> float:
        """Return the distance [m] that two robots keep."""
        robots = self._document.robots
        return robots[index].radius + robots[other].radius + self._document.margin

    def near(self, index: int, mine: Track, before: float, after: float) -> list[int]:
        """Return the other robots that may come near a robot on a part of its way.

        They are there at most `before` [s] earlier and `after` [s] later.
        """
        if not len(mine.s):
            return []
        own, all_ = _Pieces(*(column[:, None] for column in _pieces(mine))), self._pieces
        need = self._radii[self._owner] + self._radii[index] + self._document.margin
        meets = (own.x0 < all_.x1 + need) & (own.x1 > all_.x0 - need)
        meets &= (own.y0 < all_.y1 + need) & (own.y1 > all_.y0 - need)
        meets &= (own.begin < all_.end + before) & (own.end > all_.begin - after)
        found = np.unique(self._owner[meets.any(axis=0)])
        return [other for other in found.tolist() if other != index]

    def forcing(
        self, index: int, within: tuple[float, float], lasts: float
    ) -> tuple[str, Follows | None]:
        """Return the robot that forces a loss of time, "" if none does, and how it is followed.

        lasts: how long the loss is [s]; within: arc lengths [m] of where it is and of the next
        rest.
        """
        mine = self.tracks[index]
        part = only(mine, (mine.s > within[0]) & (mine.s <= within[1]))
        most = max(_FORCED, _MOST_OF_IT * lasts)
        followed: list[tuple[Follows, str]] = []
        for other in self.near(index, part, self._document.tau + most, 0.0):
            need = self.need(index, other)
            found = _follows(part, self.tracks[other], need, self._document.tau, most)
            if found is not None and found.spare < most:
                followed.append((found, self._document.robots[other].id))
        if not followed:
            return "", None
        forcing = [pair for pair in followed if pair[0].spare <= _MOST_OF_IT * lasts]
        first = min(forcing, key=lambda pair: pair[0].zone[0], default=None)
        best, owner = first or min(followed, key=lambda pair: pair[0].spare)
        return owner, best


def _pieces(track: Track) -> _Pieces:
    """Return the boxes around the pieces of a way."""
    first = np.arange(0, len(track.s), _PIECE)
    (x0, y0), (x1, y1) = (
        bound.reduceat(track.places, first, axis=0).T for bound in (np.minimum, np.maximum)
    )
    begin, end = np.minimum.reduceat(track.reached, first), np.maximum.reduceat(track.left, first)
    return _Pieces(x0, y0, x1, y1, begin, end)


def _follows(mine: Track, theirs: Track, need: float, tau: float, most: float) -> Follows | None:
    """Return how closely, within `most` [s], one robot follows another; None if they never meet."""
    soon = (theirs.left > mine.reached[0] - tau - most) & (theirs.reached < mine.reached[-1])
    mine, theirs = beside(mine, only(theirs, soon), need)
    theirs, mine = beside(theirs, mine, need)
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
    return Follows(float(behind[at]), zone, their_zone)


def only(track: Track, kept: npt.NDArray[np.bool_] | slice) -> Track:
    """Return a track at some of its places."""
    return Track(*(column[kept] for column in track))


def beside(one: Track, other: Track, need: float) -> tuple[Track, Track]:
    """Return two tracks, the first without the places far from the second one's bounding box."""
    if not len(other.s):
        return only(one, np.zeros(len(one.s), dtype=bool)), other
    low, high = other.places.min(axis=0) - need, other.places.max(axis=0) + need
    return only(one, np.all((one.places >= low) & (one.places <= high), axis=1)), other


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


def _track(ride: Driven) -> Track:
    """Return a path with the times at which its robot reaches and leaves each place."""
    line, length = ride.timeline, ride.curve.length
    count = min(2 + math.ceil(length / (_STEP * ride.radius)), _MOST)
    s = np.linspace(0.0, length, count)
    starts, ends = np.asarray(line.t0), np.asarray(line.t1)
    knots_t = np.union1d(np.concatenate((starts, ends)), np.linspace(0.0, line.finish, 4 * count))
    knots_s = np.maximum.accumulate(arcs_on(line, knots_t))
    reached = knots_t[np.minimum(np.searchsorted(knots_s, s - 1e-6), len(knots_t) - 1)]
    after = np.searchsorted(knots_s, s + 1e-6, side="right")
    left = knots_t[np.minimum(after, len(knots_t) - 1)]
    return Track(s, ride.curve.at_arc(s), reached, left)
