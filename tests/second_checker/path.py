"""A curve as a polyline over arc length, with bounds of everything that this leaves out.

Bezier pieces are exact (blossoms in rational numbers).  They are halved until the chord and the
control polygon of each are nearly as long as each other: with positive weights the curve is at
least as long as its chord, at most as long as its control polygon, and inside their hull.

Decides: where a curve is at an arc length, and how sharply it bends.  Must not know: robots.
"""

from dataclasses import dataclass
from math import comb

import numpy as np

ROUNDING = 1e-9
"""Added to each bound [m]: thousands of times what rounding adds up to at these sizes."""

_LONGER = 5e-7
_ASIDE = 1e-5
"""Pieces are halved until their polygons are longer than their chords by at most the share _LONGER,
and no corner is farther than _ASIDE [m] from the chord."""

_SHORTEST = 1e-9
_ROUNDS = 30


def bezier_pieces(degree, knots, points, weights):
    """Return the spans' homogeneous control points, lists of (wx, wy, w), exactly."""
    lifted = [(x * w, y * w, w) for (x, y), w in zip(points, weights, strict=True)]
    pieces = []
    for k in range(degree, len(points)):
        begin, end = knots[k], knots[k + 1]
        if begin < end:
            own = lifted[k - degree : k + 1]
            piece = [
                _blossom(degree, knots, k, own, [begin] * (degree - j) + [end] * j)
                for j in range(degree + 1)
            ]
            pieces.append(piece)
    return pieces


def _blossom(degree, knots, k, own, arguments):
    row = list(own)
    for level, u in enumerate(arguments, start=1):
        for i in range(degree, level - 1, -1):
            low, high = knots[k - degree + i], knots[k + 1 + i - level]
            part = (u - low) / (high - low)
            both = zip(row[i - 1], row[i], strict=True)
            row[i] = tuple((1 - part) * a + part * b for a, b in both)
    return row[degree]


@dataclass(frozen=True, eq=False)
class Path:
    """n pieces in order.

    s (n + 1,): the arc length [m] at the ends of pieces, each within `unsure` [m] of the truth.
    places (n + 1, 2) [m].  turned (n + 2,): the sum [rad] of the polyline's turns at all vertices
    before.  error [m]: the curve at any arc length is at most this far from `place`.
    """

    s: np.ndarray
    places: np.ndarray
    turned: np.ndarray
    unsure: float
    error: float
    pieces: np.ndarray

    @property
    def length(self):
        """The bracket [m] of the curve's length."""
        return self.s[-1] - self.unsure, self.s[-1] + self.unsure

    def place(self, s):
        """Return the polyline's places (m, 2) at arc lengths (m,) [m]."""
        x, y = self.places.T
        return np.column_stack((np.interp(s, self.s, x), np.interp(s, self.s, y)))

    def aside(self, s0, s1):
        """Return bounds (m,) [m] of how far the polyline is from its chord between arc lengths.

        Directions differ from the chord's by at most the sum of turns between, so a walk to the
        side and back of known length gets no farther than half of it times the sine.
        """
        first = np.searchsorted(self.s, s0, side="right")
        last = np.maximum(np.searchsorted(self.s, s1, side="left"), first)
        turn = self.turned[last] - self.turned[first]
        share = np.where(turn < 0.5 * np.pi, np.sin(np.minimum(turn, 0.5 * np.pi)), 1.0)
        return 0.5 * np.maximum(s1 - s0, 0.0) * share + ROUNDING


def path_of(message):
    """Return the Path of a message's curve."""
    exact = bezier_pieces(message.degree, message.knots, message.points, message.weights)
    pieces = np.array(exact, dtype=float)
    for _ in range(_ROUNDS):
        _, chord, polygon, aside = _measures(pieces)
        rough = (polygon - chord > _LONGER * polygon) | (aside > _ASIDE)
        rough &= polygon > _SHORTEST
        if not rough.any():
            break
        pieces = _halved(pieces, rough)
    corners, chord, polygon, aside = _measures(pieces)
    s = np.concatenate(([0.0], np.cumsum(0.5 * (chord + polygon))))
    places = np.concatenate((corners[:, 0], corners[-1:, -1]))
    unsure = 0.5 * float((polygon - chord).sum()) + ROUNDING
    error = 2.0 * unsure + float((polygon - chord).max() + aside.max()) + ROUNDING
    steps = np.diff(places, axis=0)
    cross = steps[:-1, 0] * steps[1:, 1] - steps[:-1, 1] * steps[1:, 0]
    turns = np.abs(np.arctan2(cross, (steps[:-1] * steps[1:]).sum(axis=1)))
    turned = np.concatenate(([0.0, 0.0], np.cumsum(turns), [turns.sum()]))
    return Path(s, places, turned, unsure, error, pieces)


def _measures(pieces):
    """Return corners, and of each piece the chord, polygon and distance of corners from it [m]."""
    corners = pieces[:, :, :2] / pieces[:, :, 2:]
    along = corners[:, -1] - corners[:, 0]
    chord = np.hypot(*along.T)
    polygon = np.hypot(*np.moveaxis(np.diff(corners, axis=1), 2, 0)).sum(axis=1)
    rel = corners - corners[:, :1]
    square = np.maximum(chord**2, 1e-300)
    part = np.clip((rel * along[:, None]).sum(axis=2) / square[:, None], 0.0, 1.0)
    off = rel - part[:, :, None] * along[:, None]
    return corners, chord, polygon, np.hypot(*np.moveaxis(off, 2, 0)).max(axis=1)


def _halved(pieces, rough):
    """Return the pieces with the rough ones halved, by de Casteljau's algorithm."""
    row, left, right = pieces, [pieces[:, 0]], [pieces[:, -1]]
    while row.shape[1] > 1:
        row = 0.5 * (row[:, :-1] + row[:, 1:])
        left.append(row[:, 0])
        right.append(row[:, -1])
    halves = np.stack((np.stack(left, axis=1), np.stack(right[::-1], axis=1)), axis=1)
    made = np.repeat(pieces, 1 + rough, axis=0)
    ends = np.cumsum(1 + rough)
    made[ends[rough] - 2], made[ends[rough] - 1] = halves[rough, 0], halves[rough, 1]
    return made


def curvatures(pieces):
    """Return what each piece's greatest curvature [1/m] reaches and what it does not exceed.

    With P = (X, Y, w) and N = (X' w - X w', Y' w - Y w') it is det(P, P', P'') w^3 / |N|^3.  All
    are polynomials in Bernstein form, whose coefficients bound them.
    """
    shift = pieces[:, :1, :2] / pieces[:, :1, 2:]
    x, y, w = (pieces[:, :, axis] for axis in range(3))
    x, y = x - shift[:, :, 0] * w, y - shift[:, :, 1] * w
    dx, dy, dw = (_slope(one) for one in (x, y, w))
    nx = _times(dx, w) - _times(x, dw)
    ny = _times(dy, w) - _times(y, dw)
    det = np.zeros((len(pieces), 1))
    if x.shape[1] > 2:
        ddx, ddy, ddw = (_slope(one) for one in (dx, dy, dw))
        det = (
            _times(x, _times(dy, ddw) - _times(dw, ddy))
            - _times(y, _times(dx, ddw) - _times(dw, ddx))
            + _times(w, _times(dx, ddy) - _times(dy, ddx))
        )
    middle = np.stack((nx.sum(axis=1), ny.sum(axis=1)))
    middle /= np.maximum(np.hypot(*middle), 1e-300)
    slowest = (nx * middle[0][:, None] + ny * middle[1][:, None]).min(axis=1)
    top = np.abs(det).max(axis=1) * w.max(axis=1) ** 3
    most = np.where(slowest > 0.0, top / np.maximum(slowest, 1e-100) ** 3, np.inf)
    sizes = np.hypot(nx, ny)
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = [np.abs(det[:, k]) * w[:, k] ** 3 / sizes[:, k] ** 3 for k in (0, -1)]
    reached = np.nan_to_num(np.maximum(*ends), nan=0.0, posinf=0.0)
    return reached, most


def _slope(coefficients):
    return (coefficients.shape[1] - 1) * np.diff(coefficients, axis=1)


def _times(a, b):
    """Return the products of polynomials in Bernstein form, (n, i) times (n, j)."""
    m, n = a.shape[1] - 1, b.shape[1] - 1
    product = np.zeros((len(a), m + n + 1))
    for i in range(m + 1):
        for j in range(n + 1):
            product[:, i + j] += comb(m, i) * comb(n, j) / comb(m + n, i + j) * a[:, i] * b[:, j]
    return product
