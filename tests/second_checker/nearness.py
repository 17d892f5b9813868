"""How near two robots come over all pairs of plan times of a region, by halving rectangles.

A region is low(t') <= t <= high(t') with functions that never fall: tau-safety asks about
t' - tau to t' + tau, a staircase about its need to t' - tau.  A rectangle of times keeps at least
the distance of the two chords less what the motions leave them; it is halved until that bound
is nearly as large as a distance that is reached.

Decides: the bracket of the least distance.  Must not know: what is enough.
"""

from dataclasses import dataclass

import numpy as np

GAP = 5e-5
"""Rectangles are halved until they may change the answer by no more than this [m]."""

_SHORTEST = 1e-6
"""Rectangles shorter than this [s] are not halved again: they count with their bound."""

_BLOCK = 1.0


@dataclass(frozen=True)
class Region:
    """The pairs of times (t, t') with low(t') <= t <= high(t'), for arrays of times [s].

    earliest(t), latest(t): the t' from and until which t is in the region.
    """

    low: object
    high: object
    earliest: object
    latest: object


@dataclass(frozen=True, eq=False)
class Ride:
    """A robot: where its path has it, and when."""

    path: object
    motion: object

    def places(self, times):
        """Return arc lengths (m,) and places (m, 2) [m] at times (m,) [s]."""
        s = self.motion.arc(times)
        return s, self.path.place(s)

    def moments(self, finish):
        """Return times [s] from 0 to `finish`: each leg's ends, and no more than a block apart."""
        own = np.concatenate((self.motion.t0, self.motion.t1))
        blocks = np.arange(0.0, finish, _BLOCK)
        moving = np.zeros(len(blocks), bool)
        for begin, end in zip(self.motion.t0, self.motion.t1, strict=True):
            moving |= (blocks > begin) & (blocks < end)
        times = np.concatenate(([0.0, finish], own, blocks[moving]))
        return np.unique(times[(times >= 0.0) & (times <= finish)])


def nearest(one, other, region, finish, enough=np.inf):
    """Return the bracket [m] of the least distance of two Rides; (enough, inf) when it is above.

    `finish` [s]: both have rested since then, or longer.  `enough` [m]: the answer need not be
    known beyond.  Both are (inf, inf) when no times are in the region.
    """
    error = one.path.error + other.path.error
    t, u = one.moments(finish), other.moments(finish)
    i, j = (index.ravel() for index in np.indices((len(t) - 1, len(u) - 1)))
    cells = np.column_stack((t[i], t[i + 1], u[j], u[j + 1]))
    reached, left = np.inf, np.inf
    while len(cells):
        cells = _within(cells, region)
        if not len(cells):
            break
        least, most, moved = _bounds(one, other, cells, region)
        reached = min(reached, most.min(initial=np.inf))
        wanted = least < min(reached - GAP, enough + error)
        lasts = np.column_stack((cells[:, 1] - cells[:, 0], cells[:, 3] - cells[:, 2]))
        small = wanted & (lasts.max(axis=1) < _SHORTEST)
        left = min(left, least[small].min(initial=np.inf))
        open_ = wanted & ~small
        cells = _halves(cells[open_], moved[open_], lasts[open_])
    if reached == np.inf:
        return (min(enough, left - error), np.inf)
    low = min(reached - GAP, left, enough + error)
    return low - error, reached + error


def _within(cells, region):
    """Return the cells that meet the region, without parts of their times that do not."""
    begin = np.maximum(cells[:, 0], region.low(cells[:, 2]))
    end = np.minimum(cells[:, 1], region.high(cells[:, 3]))
    since = np.maximum(cells[:, 2], region.earliest(begin))
    until = np.minimum(cells[:, 3], region.latest(end))
    return np.column_stack((begin, end, since, until))[(begin <= end) & (since <= until)]


def _bounds(one, other, cells, region):
    """Return bounds (m,) [m] of cells' least distances: below, reached; and how far both move."""
    s0, a = one.places(cells[:, 0])
    s1, b = one.places(cells[:, 1])
    r0, c = other.places(cells[:, 2])
    r1, d = other.places(cells[:, 3])
    aside = one.path.aside(s0, s1) + other.path.aside(r0, r1)
    least = segments_apart(a, b, c, d) - aside
    u = 0.5 * (cells[:, 2] + cells[:, 3])
    most = np.full(len(cells), np.inf)
    for at in (u, cells[:, 2], cells[:, 3]):
        low = np.maximum(cells[:, 0], region.low(at))
        high = np.minimum(cells[:, 1], region.high(at))
        t = np.clip(0.5 * (cells[:, 0] + cells[:, 1]), low, np.maximum(low, high))
        apart = np.hypot(*(one.places(t)[1] - other.places(at)[1]).T)
        most = np.minimum(most, np.where(low <= high, apart, np.inf))
    return least, most, np.column_stack((s1 - s0, r1 - r0))


def _halves(cells, moved, lasts):
    """Return the cells halved in the time in which its robot moves farther, or else longer."""
    still = moved.max(axis=1) <= 0.0
    first = np.where(still, lasts[:, 0] >= lasts[:, 1], moved[:, 0] >= moved[:, 1])
    lower, upper = cells.copy(), cells.copy()
    for chosen, column in ((first, 0), (~first, 2)):
        middle = 0.5 * (cells[chosen, column] + cells[chosen, column + 1])
        lower[chosen, column + 1] = middle
        upper[chosen, column] = middle
    return np.concatenate((lower, upper))


def segments_apart(a, b, c, d):
    """Return the distances (m,) [m] of the segments a to b and c to d, each (m, 2)."""
    crossing = (_side(c, d, a) * _side(c, d, b) < 0.0) & (_side(a, b, c) * _side(a, b, d) < 0.0)
    ends = [_to_segment(a, c, d), _to_segment(b, c, d), _to_segment(c, a, b), _to_segment(d, a, b)]
    return np.where(crossing, 0.0, np.minimum.reduce(ends))


def _side(a, b, p):
    along, off = b - a, p - a
    return along[:, 0] * off[:, 1] - along[:, 1] * off[:, 0]


def _to_segment(p, a, b):
    along, off = b - a, p - a
    square = np.maximum((along**2).sum(axis=1), 1e-300)
    part = np.clip((off * along).sum(axis=1) / square, 0.0, 1.0)
    return np.hypot(*(off - part[:, None] * along).T)
