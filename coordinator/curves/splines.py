"""Joining pieces to one spline, and elevating the degree of a piece: the curve stays the same.

Pieces are Bezier curves in homogeneous control points (degree + 1, 3), rows (w x, w y, w).
The method is based on blossoms.  Each control point of a spline belongs to `degree` successive
knots; it is the blossom of any of the spline's pieces at these knots.  Where two pieces join, their
first r derivatives agree if and only if their blossoms agree for all lists of arguments in which at
most r differ from the knot between the pieces.

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
from coordinator.curves.nurbs_kernels import W

SAME: Final = 1e-10
"""Control points count as equal if they are nearer than this [m] and their weights differ by no
more than this share."""

_ROUNDING: Final = 1e-12
"""Weights that differ from 1 by less are set to 1."""

_NOWHERE: Final = 1e-7
"""Pieces of less extent [m] are left out: float32 cannot distinguish such places."""

_NARROW: Final = 1e-9
"""The least width of a piece in the parameter, as a share of the curve's."""

_EVEN: Final = 100.0
"""|C'| is made continuous between parts, unless it then differs from 1 on average by more than this
factor."""


def joined_count(parts: Sequence[Nurbs]) -> int:
    """Return an upper bound of the number of control points of `joined`."""
    degree = max((curve.degree for curve in parts), default=1)
    raised = (len(curve.points) - curve.degree for curve in parts)
    more = sum(spans * (degree - part.degree) for spans, part in zip(raised, parts, strict=True))
    return sum(len(curve.points) for curve in parts) + more - max(len(parts) - 1, 0)


def joined(parts: Sequence[Nurbs]) -> Nurbs:
    """Join curves, each of which begins where the one before ends, to one curve.

    It has the greatest of their degrees.  Where two parts join it has as many continuous
    derivatives as they have in common.  Joining the parts of a curve gives the same curve with the
    same knots, except that the parameter is scaled: it ends at the length of the control
    polygon [m].
    """
    degree = max(part.degree for part in parts)
    pieces: list[Array] = []
    widths: list[float] = []
    pace = weight = 0.0
    for part in parts:
        own = [elevated(one.lifted.control, degree) for one in beziers(part)]
        scale = _scale(pace, own[0], part)
        widths += (scale * np.diff(np.unique(part.knots))).tolist()
        factor = weight / own[0][0, W] if weight else 1.0
        pieces += [factor * one for one in own]
        pace, weight = _pace(pieces[-1][::-1]) / widths[-1], pieces[-1][-1, W]
    whole = spline(*_worth_keeping(pieces, widths))
    legs = np.diff(whole.points, axis=0)
    scale = float(np.hypot(legs[:, 0], legs[:, 1]).sum() / whole.knots[-1])
    return Nurbs(degree, whole.knots * scale, whole.points, whole.weights)


def _worth_keeping(
    pieces: Sequence[Array], widths: Sequence[float]
) -> tuple[list[Array], list[float]]:
    """Leave out pieces without extent, and widen those that are too narrow in the parameter."""
    least = _NARROW * sum(widths)
    kept: list[Array] = []
    wide: list[float] = []
    for piece, width in zip(pieces, widths, strict=True):
        if np.ptp(piece[:, :W] / piece[:, W:], axis=0).max() > _NOWHERE:
            kept.append(piece)
            wide.append(max(width, least))
    for before, after in pairwise(kept):
        after[0] = before[-1] * (after[0, W] / before[-1, W])
    return kept, wide


def elevated(piece: Array, degree: int) -> Array:
    """Return a Bezier piece (k + 1, 3) with its degree raised to `degree`, unless k is greater."""
    while len(piece) <= degree:
        part = (np.arange(1, len(piece)) / len(piece))[:, None]
        piece = np.concatenate(
            (piece[:1], part * piece[:-1] + (1.0 - part) * piece[1:], piece[-1:])
        )
    return piece


def spline(pieces: Sequence[Array], widths: Sequence[float]) -> Nurbs:
    """Return the curve of pieces of equal degree, given the width of each in the parameter.

    The multiplicity of the knot between two pieces is as low as the derivatives that they have in
    common allow; it may be 0.
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
        # Each of the two knots around a short piece may be removable alone, but not both of them.
        if (times[beside] == degree).all():
            return curve
        times[beside] = np.minimum(times[beside] + 1, degree)


def _spline(pieces: Sequence[Array], borders: Array, times: Indices) -> Nurbs:
    """Return the curve of m pieces, given borders (m + 1,) and multiplicities of inner ones."""
    degree = len(pieces[0]) - 1
    ends = np.full(degree + 1, 1.0)
    knots = np.concatenate((0.0 * ends, np.repeat(borders[1:-1], times), borders[-1] * ends))
    control = []
    for i in range(len(knots) - degree - 1):
        # The blossom of any of its pieces would do.  The widest one is taken: the knots are least
        # far outside of it, relative to its width.
        low, past = np.searchsorted(borders, (knots[i], knots[i + degree + 1]))
        k = low + int(np.argmax(np.diff(borders[low : past + 1])))
        at = knots[i + 1 : i + degree + 1].tolist()
        control.append(_blossom(pieces[k], (borders[k], borders[k + 1]), at))
    points = np.array(control)
    weights = np.where(np.abs(points[:, W] - 1.0) < _ROUNDING, 1.0, points[:, W])
    return Nurbs(degree, knots, points[:, :W] / points[:, W:], weights)


def _changed(curve: Nurbs, pieces: Sequence[Array], borders: Array, times: Indices) -> Indices:
    """Return the indices of the pieces whose control points the curve does not reproduce."""
    degree = curve.degree
    if not (np.diff(borders) > 0.0).all() or not curve.weights.min() > 0.0:
        return np.arange(len(pieces))
    control = refine(curve, np.repeat(borders[1:-1], degree - times)).lifted.control
    own = [control[degree * k : degree * (k + 1) + 1] for k in range(len(pieces))]
    same = [all(map(_same, one, piece)) for one, piece in zip(own, pieces, strict=True)]
    return np.flatnonzero(~np.array(same))


def _blossom(piece: Array, ends: tuple[float, float], at: Sequence[float]) -> Array:
    """Return the blossom (3,) at `degree` arguments of a piece between two parameters `ends`."""
    for u in at:
        part = (u - ends[0]) / (ends[1] - ends[0])
        piece = (1.0 - part) * piece[:-1] + part * piece[1:]
    return np.asarray(piece[0])


def _smoothness(
    one: Array, other: Array, here: tuple[float, float], there: tuple[float, float]
) -> int:
    """Return how many derivatives two successive pieces have in common where they meet.

    here, there: the parameters between which they run.
    """
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
    """Return whether two homogeneous control points (3,) are the same."""
    places = one[:W] / one[W] - other[:W] / other[W]
    near = SAME + 1e-12 * float(np.abs(other[:W] / other[W]).max())
    return bool(np.hypot(*places) <= near and abs(one[W] / other[W] - 1.0) <= SAME)


def _pace(piece: Array) -> float:
    """Return |C'| [m] at the start of a piece whose parameter runs from 0 to 1."""
    leg = piece[1, :W] / piece[1, W] - piece[0, :W] / piece[0, W]
    return float((len(piece) - 1) * piece[1, W] / piece[0, W] * np.hypot(*leg))


def _scale(pace: float, first: Array, part: Nurbs) -> float:
    """Return the factor by which a part's parameter is scaled.

    `pace` is |C'| at the end of the part before, `first` the first piece of this part.  The factor
    makes |C'| equal to `pace` at the start of this part, if possible.  If it is not, or if `pace`
    is 0, the factor makes |C'| equal to 1 on average.
    """
    legs = np.diff(part.points, axis=0)
    even = float(np.hypot(legs[:, 0], legs[:, 1]).sum() / part.knots[-1])
    own = _pace(first) / float(np.diff(np.unique(part.knots))[0])
    wanted = own / pace if pace > 0.0 else even
    return wanted if even / _EVEN <= wanted <= even * _EVEN else even
