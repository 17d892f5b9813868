"""Compiled: rational Bezier pieces of curves, and when two of them cannot meet.

`lifted` (degree + 1, 3) holds the homogeneous control points of a piece, its parameter t runs from
0 to 1.  A leg is the vector between neighbouring control points.  With positive weights all
tangents of a piece lie in the cone that its legs span (Saito, Wang and Sederberg 1995).

Decides: where a piece and its tangents are, how it is halved.  Must not know: which pairs of
pieces are compared, or what an intersection is.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import compiled
from coordinator.curves.nurbs_kernels import W, X, Y

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

X0, Y0, X1, Y1 = range(4)
"""Columns of a box [m]: least x and y, greatest x and y."""

CHORD_X, CHORD_Y, LENGTH, LEAST_SLOPE, MOST_SLOPE, LEAST_OFFSET, MOST_OFFSET, SIZE = range(4, 12)
"""Columns 4 to 11 of a piece's shape (12,), which `survey` writes; columns 0 to 3 are its box.

They are the unit vector along the chord, the chord's length [m], least and greatest slope of the
legs against the chord (infinite if a leg runs backwards), least and greatest offset of control
points from the chord [m], the larger side of the box [m]."""

_STEPS: Final = 64
_NO_LENGTH: Final = 1e-300

_SHRUNK: Final = 0.75
"""`facing` trims both curves again if trimming left less than this share of the pairs of pieces."""


class Pieces(NamedTuple):
    """Curves as rational Bezier pieces; curve c has those from first[c] to first[c + 1] - 1.

    Of n curves: first (n + 1,) and degree (n,).  Of p pieces: start (p,), the first row of each in
    `control` (m, 3), the homogeneous control points of all; borders (p, 2), the parameters of the
    curve where the piece begins and ends; boxes (p, 4) [m], which hold the pieces.
    """

    first: Indices
    degree: Indices
    start: Indices
    control: Array
    borders: Array
    boxes: Array


class CurvePair(NamedTuple):
    """Two curves among the pieces, by their numbers; `one` and `other` may be the same."""

    pieces: Pieces
    one: int
    other: int


class Facing(NamedTuple):
    """The pieces of two curves that may meet.

    Of the first curve those from `begin` to `end` - 1, of the second from `its_begin` to
    `its_end` - 1.
    """

    begin: int
    end: int
    its_begin: int
    its_end: int


class Tangent(NamedTuple):
    """A point x, y [m] of a curve and the derivative dx, dy by the parameter there."""

    x: float
    y: float
    dx: float
    dy: float


class Foot(NamedTuple):
    """A point x, y [m] of a piece and its parameter t."""

    t: float
    x: float
    y: float


@compiled
def place(lifted: Array, degree: int, t: float, work: Array) -> Tangent:
    """Return a piece's point and derivative at t; outside [0, 1] the piece is extended straight."""
    at = min(max(t, 0.0), 1.0)
    rest = 1.0 - at
    for i in range(degree + 1):
        for axis in range(3):
            work[i, axis] = lifted[i, axis]
    for level in range(degree, 1, -1):
        for i in range(level):
            for axis in range(3):
                work[i, axis] = rest * work[i, axis] + at * work[i + 1, axis]
    w = rest * work[0, W] + at * work[1, W]
    x = (rest * work[0, X] + at * work[1, X]) / w
    y = (rest * work[0, Y] + at * work[1, Y]) / w
    rate = work[1, W] - work[0, W]
    dx = degree * (work[1, X] - work[0, X] - rate * x) / w
    dy = degree * (work[1, Y] - work[0, Y] - rate * y) / w
    return Tangent(x + (t - at) * dx, y + (t - at) * dy, dx, dy)


@compiled
def survey(lifted: Array, degree: int, corners: Array, shape: Array) -> None:
    """Write a piece's control points to `corners` (degree + 1, 2) [m], and its shape to `shape`."""
    for axis in range(2):
        low, high = X0 + axis, X1 + axis
        shape[low], shape[high] = math.inf, -math.inf
        for i in range(degree + 1):
            corners[i, axis] = lifted[i, axis] / lifted[i, W]
            shape[low] = min(shape[low], corners[i, axis])
            shape[high] = max(shape[high], corners[i, axis])
    ex, ey = corners[degree, 0] - corners[0, 0], corners[degree, 1] - corners[0, 1]
    size = math.sqrt(ex * ex + ey * ey)
    ex, ey = (ex / size, ey / size) if size > _NO_LENGTH else (1.0, 0.0)
    shape[CHORD_X], shape[CHORD_Y], shape[LENGTH] = ex, ey, size
    shape[LEAST_SLOPE], shape[MOST_SLOPE] = math.inf, -math.inf
    shape[LEAST_OFFSET] = shape[MOST_OFFSET] = 0.0
    for i in range(degree):
        dx, dy = corners[i + 1, 0] - corners[i, 0], corners[i + 1, 1] - corners[i, 1]
        along, across = dx * ex + dy * ey, ex * dy - ey * dx
        if along > 0.0:
            shape[LEAST_SLOPE] = min(shape[LEAST_SLOPE], across / along)
            shape[MOST_SLOPE] = max(shape[MOST_SLOPE], across / along)
        elif along < 0.0 or across != 0.0 or size <= _NO_LENGTH:
            shape[LEAST_SLOPE], shape[MOST_SLOPE] = -math.inf, math.inf
        dx, dy = corners[i + 1, 0] - corners[0, 0], corners[i + 1, 1] - corners[0, 1]
        offset = ex * dy - ey * dx
        shape[LEAST_OFFSET] = min(shape[LEAST_OFFSET], offset)
        shape[MOST_OFFSET] = max(shape[MOST_OFFSET], offset)
    shape[SIZE] = max(shape[X1] - shape[X0], shape[Y1] - shape[Y0])


@compiled
def beside(shape: Array, corners: Array, others: Array, degree: int, tolerance: float) -> bool:
    """Tell whether another piece is outside the strip along a piece's chord that holds this piece.

    shape, corners: of the piece; others (degree + 1, 2) [m]: control points of the other piece.
    """
    least, greatest = math.inf, -math.inf
    for i in range(degree + 1):
        dx, dy = others[i, 0] - corners[0, 0], others[i, 1] - corners[0, 1]
        offset = shape[CHORD_X] * dy - shape[CHORD_Y] * dx
        least, greatest = min(least, offset), max(greatest, offset)
    return bool(
        least > shape[MOST_OFFSET] + tolerance or greatest < shape[LEAST_OFFSET] - tolerance
    )


@compiled
def boxes_apart(one: Array, other: Array, tolerance: float) -> bool:
    """Tell whether two boxes are farther apart than the tolerance."""
    return bool(
        one[X0] > other[X1] + tolerance
        or other[X0] > one[X1] + tolerance
        or one[Y0] > other[Y1] + tolerance
        or other[Y0] > one[Y1] + tolerance
    )


@compiled
def facing(pair: CurvePair, tolerance: float, box: Array) -> Facing:
    """Return which pieces of two curves may come within the tolerance [m] of each other.

    Pieces at either end of one curve are left out while their boxes are apart from the box around
    the pieces of the other curve; the other curve is trimmed in the same way, in turn.  box (4,) is
    scratch memory.
    """
    pieces, one, other = pair
    begin, end = pieces.first[one], pieces.first[one + 1]
    its_begin, its_end = pieces.first[other], pieces.first[other + 1]
    left, before = (end - begin) * (its_end - its_begin), math.inf
    while 0 < left < _SHRUNK * before:
        _cover(pieces.boxes, its_begin, its_end, box)
        begin, end = _trimmed(pieces.boxes, begin, end, box, tolerance)
        _cover(pieces.boxes, begin, end, box)
        its_begin, its_end = _trimmed(pieces.boxes, its_begin, its_end, box, tolerance)
        left, before = (end - begin) * (its_end - its_begin), float(left)
    return Facing(begin, end, its_begin, its_end)


@compiled
def _cover(boxes: Array, begin: int, end: int, box: Array) -> None:
    """Write the box around boxes[begin:end] to `box`."""
    box[X0], box[Y0], box[X1], box[Y1] = math.inf, math.inf, -math.inf, -math.inf
    for i in range(begin, end):
        box[X0], box[Y0] = min(box[X0], boxes[i, X0]), min(box[Y0], boxes[i, Y0])
        box[X1], box[Y1] = max(box[X1], boxes[i, X1]), max(box[Y1], boxes[i, Y1])


@compiled
def _trimmed(boxes: Array, begin: int, end: int, box: Array, tolerance: float) -> tuple[int, int]:
    """Return boxes[begin:end] as a range, without those at its ends that are apart from `box`."""
    while begin < end and boxes_apart(boxes[begin], box, tolerance):
        begin += 1
    while begin < end and boxes_apart(boxes[end - 1], box, tolerance):
        end -= 1
    return begin, end


@compiled
def cones_apart(a: Array, b: Array) -> bool:
    """Tell whether no tangent of a piece is parallel to one of another, given their shapes.

    The slopes have to be between -1 and 1.
    """
    sense = 1.0 if a[CHORD_X] * b[CHORD_X] + a[CHORD_Y] * b[CHORD_Y] >= 0.0 else -1.0
    right, left = a[CHORD_X] - a[LEAST_SLOPE] * a[CHORD_Y], a[CHORD_X] - a[MOST_SLOPE] * a[CHORD_Y]
    right_y, left_y = (
        a[CHORD_Y] + a[LEAST_SLOPE] * a[CHORD_X],
        a[CHORD_Y] + a[MOST_SLOPE] * a[CHORD_X],
    )
    its_right, its_left = (
        sense * (b[CHORD_X] - b[LEAST_SLOPE] * b[CHORD_Y]),
        sense * (b[CHORD_X] - b[MOST_SLOPE] * b[CHORD_Y]),
    )
    its_right_y, its_left_y = (
        sense * (b[CHORD_Y] + b[LEAST_SLOPE] * b[CHORD_X]),
        sense * (b[CHORD_Y] + b[MOST_SLOPE] * b[CHORD_X]),
    )
    ahead = left * its_right_y - left_y * its_right
    behind = right * its_left_y - right_y * its_left
    return bool((ahead > 0.0 and behind > 0.0) or (ahead < 0.0 and behind < 0.0))


@compiled
def rises(shape: Array, ex: float, ey: float) -> bool:
    """Tell whether all tangents of a piece clearly point in the direction of the unit vector e."""
    along, across = (
        shape[CHORD_X] * ex + shape[CHORD_Y] * ey,
        shape[CHORD_X] * ey - shape[CHORD_Y] * ex,
    )
    return bool(min(along + shape[LEAST_SLOPE] * across, along + shape[MOST_SLOPE] * across) > 0.1)


@compiled
def foot(lifted: Array, degree: int, ex: float, ey: float, at: float, work: Array) -> Foot:
    """Return the point p of a piece with p . e = `at` [m], for a unit vector e.

    Along the piece p . e has to increase everywhere or decrease everywhere.  Newton's method, kept
    between bounds by bisection.
    """
    p = place(lifted, degree, 0.0, work)
    begin = p.x * ex + p.y * ey
    p = place(lifted, degree, 1.0, work)
    end = p.x * ex + p.y * ey
    low, high, t = 0.0, 1.0, (at - begin) / (end - begin)
    for _ in range(_STEPS):
        t = min(max(t, 0.0), 1.0)
        p = place(lifted, degree, t, work)
        miss = at - (p.x * ex + p.y * ey)
        step = miss / (p.dx * ex + p.dy * ey)
        if miss == 0.0 or abs(step) < 1e-15:
            break
        if (miss > 0.0) == (end > begin):
            low = t
        else:
            high = t
        t = t + step if low < t + step < high else 0.5 * (low + high)
        if high - low < 1e-15:
            break
    return Foot(t, p.x, p.y)


@compiled
def halve(lifted: Array, degree: int, halves: Array) -> None:
    """Write both halves of a piece to `halves` (2, degree + 1, 3), by de Casteljau's algorithm."""
    for i in range(degree + 1):
        for axis in range(3):
            halves[1, i, axis] = lifted[i, axis]
    for i in range(degree + 1):
        for axis in range(3):
            halves[0, i, axis] = halves[1, 0, axis]
            for j in range(degree - i):
                halves[1, j, axis] = 0.5 * (halves[1, j, axis] + halves[1, j + 1, axis])
