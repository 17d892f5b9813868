"""Independent oracle for conflict zones: both paths cut into short steps, every place tried.

Decides: where two robots on two paths are too near, in connected pieces, and what it takes that
one of them goes first.  Nothing in here imports the coordinator.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.spatial.distance import cdist

STEP = 0.02
"""Paths are cut into steps of at most this length [m]."""


class Course:
    """A path cut into steps: places (n, 2) at s (n,) [m], driven at `speed` [m/s].

    A robot on it has no inertia: it is at rest or at full speed, and may rest anywhere.
    `places_at` returns the places at arc lengths (n,).
    """

    def __init__(self, places_at, length, radius, speed, step=STEP):
        self.radius = radius
        self.s = np.linspace(0.0, length, 1 + max(1, int(np.ceil(length / step))))
        self.places = places_at(self.s)
        self.drive = self.s / speed
        """Time [s] that the drive from the start to each place takes without a rest."""

    @classmethod
    def of(cls, track, speed, step=STEP):
        """Return the course of an oracles.Track."""

        def places_at(s):
            return track.place_at_parameter(np.interp(s, track.s, track.u))

        return cls(places_at, float(track.s[-1]), track.radius, speed, step)

    @property
    def last(self):
        """Index of the goal."""
        return len(self.s) - 1

    @property
    def alone(self):
        """Time [s] of the whole drive without a rest."""
        return float(self.drive[-1])


@dataclass(frozen=True)
class Rows:
    """What has to hold when one robot is first in a zone, (m,) each.

    Robot `second` comes to its place `to[k]` only tau after robot `first` was at its place `at[k]`.
    """

    first: int
    second: int
    at: np.ndarray
    to: np.ndarray

    def lacks(self, times, tau):
        """Return how much time [s] each row lacks; `times`: [(n,)] of each robot at each place."""
        return times[self.first][self.at] + tau - times[self.second][self.to]


@dataclass(frozen=True)
class Zone:
    """One connected piece of the conflicts of robots a and b, and what each order asks for.

    None: that robot cannot be first, as its goal is in the zone or the other's start is.
    """

    a: int
    b: int
    a_first: Rows | None
    b_first: Rows | None

    @property
    def orders(self):
        """Return the possible orders, 0 to 2 of them."""
        return [rows for rows in (self.a_first, self.b_first) if rows is not None]


def find_zones(courses, margin, *, corners=False):
    """Return all zones of a fleet; with `corners`, pieces that touch at a corner are one."""
    return [
        zone
        for a, b in itertools.combinations(range(len(courses)), 2)
        for zone in _zones_of(a, b, courses[a], courses[b], margin, corners)
    ]


def _zones_of(a, b, course_a, course_b, margin, corners):
    need = course_a.radius + course_b.radius + margin
    near = cdist(course_a.places, course_b.places) < need
    pieces, count = ndimage.label(near, np.ones((3, 3)) if corners else None)
    for piece, box in enumerate(ndimage.find_objects(pieces, count), start=1):
        of_a, of_b = np.nonzero(pieces[box] == piece)
        of_a, of_b = of_a + box[0].start, of_b + box[1].start
        a_can = of_a.max() < course_a.last and of_b.min() > 0
        b_can = of_b.max() < course_b.last and of_a.min() > 0
        yield Zone(
            a=a,
            b=b,
            a_first=_rows(a, b, of_a, of_b) if a_can else None,
            b_first=_rows(b, a, of_b, of_a) if b_can else None,
        )


def _rows(first, second, at, to):
    """Return the rows of one order; what follows from other rows is left out.

    A robot comes to its places one after another, so only a place of the second robot matters
    before which the first has to be farther on than for all places before it.
    """
    order = np.lexsort((-at, to))
    at, to = at[order], to[order]
    before = np.concatenate(([-1], np.maximum.accumulate(at)[:-1]))
    return Rows(first, second, at[at > before], to[at > before])
