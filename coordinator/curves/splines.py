"""Joining pieces to one spline, and elevating the degree of a piece: the curve stays the same.

Pieces are Bezier curves in homogeneous control points (degree + 1, 3), rows (w x, w y, w).
The method is based on blossoms: a control point of a spline is the blossom of any of its pieces at
the knots that belong to it, and two pieces join with r derivatives exactly when their blossoms
agree where at most r arguments are not the knot between them.

Decides: which knots a spline needs.  Must not know: where the pieces come from.
Source: Ramshaw, Blossoms are polar forms (1989).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from coordinator.curves.knots import Indices, beziers, refine
from coordinator.curves.nurbs import Array, Nurbs

SAME: Final = 1e-10
"""Control points nearer than this [m] are the same, and weights that differ by this share."""

_ROUNDING: Final = 1e-12
"""Weights are as good as this."""

_NOWHERE: Final = 1e-7
"""Pieces of less extent [m] are left out: float32 tells no such places apart."""

_NARROW: Final = 1e-9
"""No piece has less of the whole parameter, as a share."""

_EVEN: Final = 100.0
"""Parts of a curve are driven at the same speed of the parameter up to this factor from 1 m/s."""


def joined_count(parts: Sequence[Nurbs]) -> int:
    """Return how many control points `joined` gives at most."""
    degree = max((curve.degree for curve in parts), default=1)
    raised = (len(curve.points) - curve.degree for curve in parts)
    more = sum(spans * (degree - part.degree) for spans, part in zip(raised, parts, strict=True))
    return sum(len(curve.points) for curve in parts) + more - max(len(parts) - 1, 0)


def joined(parts: Sequence[Nurbs]) -> Nurbs:
    """Return one curve along several, each beginning where the last one ends.

    It has the greatest of their degrees.  A joint keeps as many derivatives as the parts have in
    common there, so that a curve which was cut is whole again, knots and all but for the scale of
    its parameter: that runs to the length of the control polygon [m].
    """
    degree = max(part.degree for part in parts)
    pieces: list[Array] = []
    widths: list[float] = []
    pace = weight = 0.0
    for part in parts:
        own = [elevated(one.lifted[2], degree) for one in beziers(part)]
        scale = _scale(pace, own[0], part)
        widths += (scale * np.diff(np.unique(part.knots))).tolist()
        factor = weight / own[0][0, 2] if weight else 1.0
        pieces += [factor * one for one in own]
        pace, weight = _pace(pieces[-1][::-1]) / widths[-1], pieces[-1][-1, 2]
    whole = spline(*_worth_keeping(pieces, widths))
    legs = np.diff(whole.points, axis=0)
    scale = float(np.hypot(legs[:, 0], legs[:, 1]).sum() / whole.knots[-1])
    return Nurbs(degree, whole.knots * scale, whole.points, whole.weights)


def _worth_keeping(
    pieces: Sequence[Array], widths: Sequence[float]
) -> tuple[list[Array], list[float]]:
    """Leave out pieces that lead nowhere, and widen those that the parameter could not tell."""
    least = _NARROW * sum(widths)
    kept: list[Array] = []
    wide: list[float] = []
    for piece, width in zip(pieces, widths, strict=True):
        if np.ptp(piece[:, :2] / piece[:, 2:], axis=0).max() > _NOWHERE:
            kept.append(piece)
            wide.append(max(width, least))
    for before, after in pairwise(kept):
        after[0] = before[-1] * (after[0, 2] / before[-1, 2])
    return kept, wide


def elevated(piece: Array, degree: int) -> Array:
    """Return a Bezier piece with control points of a higher degree, or of its own."""
    while len(piece) <= degree:
        part = (np.arange(1, len(piece)) / len(piece))[:, None]
        piece = np.concatenate(
            (piece[:1], part * piece[:-1] + (1.0 - part) * piece[1:], piece[-1:])
        )
    return piece


def spline(pieces: Sequence[Array], widths: Sequence[float]) -> Nurbs:
    """Return the curve through pieces of one degree, given the width of each in the parameter.

    Between two pieces a knot stands as often as the derivatives there ask for, maybe not at all.
    """
    degree = len(pieces[0]) - 1
    borders = np.append(0.0, np.cumsum(widths))
    ends = list(pairwise(borders.tolist()))
    joints = zip(pairwise(pieces), pairwise(ends), strict=True)
    times = np.array([degree - _smoothness(*both, *where) for both, where in joints], np.int64)
    while True:
        curve = _spline(pieces, borders, times)
        wrong = _changed(curve, pieces, borders, times)
        beside = np.unique(np.concatenate((wrong - 1, wrong)))
        beside = beside[(beside >= 0) & (beside < len(times))]
        # Two knots may seem needless each for itself, about a short piece, and not both be so.
        if (times[beside] == degree).all():
            return curve
        times[beside] = np.minimum(times[beside] + 1, degree)


def _spline(pieces: Sequence[Array], borders: Array, times: Indices) -> Nurbs:
    """Return the curve through pieces between borders, with knots there so many times."""
    degree = len(pieces[0]) - 1
    ends = np.full(degree + 1, 1.0)
    knots = np.concatenate((0.0 * ends, np.repeat(borders[1:-1], times), borders[-1] * ends))
    control = []
    for i in range(len(knots) - degree - 1):
        # The longest piece it belongs to: the knots are the least far outside of that one.
        low, past = np.searchsorted(borders, (knots[i], knots[i + degree + 1]))
        k = low + int(np.argmax(np.diff(borders[low : past + 1])))
        at = knots[i + 1 : i + degree + 1].tolist()
        control.append(_blossom(pieces[k], (borders[k], borders[k + 1]), at))
    points = np.array(control)
    weights = np.where(np.abs(points[:, 2] - 1.0) < _ROUNDING, 1.0, points[:, 2])
    return Nurbs(degree, knots, points[:, :2] / points[:, 2:], weights)


def _changed(curve: Nurbs, pieces: Sequence[Array], borders: Array, times: Indices) -> Indices:
    """Return which pieces a curve does not lead along."""
    degree = curve.degree
    if not (np.diff(borders) > 0.0).all() or not curve.weights.min() > 0.0:
        return np.arange(len(pieces))
    control = refine(curve, np.repeat(borders[1:-1], degree - times)).lifted[2]
    own = [control[degree * k : degree * (k + 1) + 1] for k in range(len(pieces))]
    same = [all(map(_same, one, piece)) for one, piece in zip(own, pieces, strict=True)]
    return np.flatnonzero(~np.array(same))


def _blossom(piece: Array, ends: tuple[float, float], at: Sequence[float]) -> Array:
    """Return the blossom (3,) of a piece over a stretch of the parameter, at `degree` arguments."""
    for u in at:
        part = (u - ends[0]) / (ends[1] - ends[0])
        piece = (1.0 - part) * piece[:-1] + part * piece[1:]
    return np.asarray(piece[0])


def _smoothness(
    one: Array, other: Array, here: tuple[float, float], there: tuple[float, float]
) -> int:
    """Return how many derivatives two pieces have in common where they meet."""
    if there[1] - there[0] > here[1] - here[0]:
        one, other = other[::-1], one[::-1]
        here, there = there[::-1], here[::-1]
    degree = len(one) - 1
    agreed = 0
    for order in range(1, degree + 1):
        at = [here[1]] * (degree - order) + [there[1]] * order
        if not _same(_blossom(one, here, at), other[order]):
            break
        agreed = order
    return agreed


def _same(one: Array, other: Array) -> bool:
    """Tell whether two homogeneous control points (3,) are the same."""
    places = one[:2] / one[2] - other[:2] / other[2]
    near = SAME + 1e-12 * float(np.abs(other[:2] / other[2]).max())
    return bool(np.hypot(*places) <= near and abs(one[2] / other[2] - 1.0) <= SAME)


def _pace(piece: Array) -> float:
    """Return the speed [m] of a piece at its beginning, by a parameter that runs from 0 to 1."""
    leg = piece[1, :2] / piece[1, 2] - piece[0, :2] / piece[0, 2]
    return float((len(piece) - 1) * piece[1, 2] / piece[0, 2] * np.hypot(*leg))


def _scale(pace: float, first: Array, part: Nurbs) -> float:
    """Return the factor for a part's parameter: on at the pace so far, if that is near 1 m/s."""
    legs = np.diff(part.points, axis=0)
    even = float(np.hypot(legs[:, 0], legs[:, 1]).sum() / part.knots[-1])
    own = _pace(first) / float(np.diff(np.unique(part.knots))[0])
    wanted = own / pace if pace > 0.0 else even
    return wanted if even / _EVEN <= wanted <= even * _EVEN else even
