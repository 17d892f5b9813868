"""Compiled: one rational Bezier piece of a curve, and when two of them cannot meet.

With positive weights the tangents of a piece lie in the cone of the legs of its control polygon
(Saito, Wang and Sederberg 1995).

Decides: where a piece and its tangents are, how it is halved.  Must not know: which pairs are
looked at, what their meeting is.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import compiled

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

CHORD_X, CHORD_Y, LENGTH, LEAST_SLOPE, MOST_SLOPE, LEAST_OFFSET, MOST_OFFSET, SIZE = range(4, 12)
"""Columns of a shape (12,), which `survey` writes, after the four of its box: the unit vector along
the chord, the chord's length [m], least and greatest slope of the legs against the chord (infinite
when a leg runs back), least and greatest offset from the chord [m], the larger side of the box
[m]."""

_STEPS: Final = 64
_NO_LENGTH: Final = 1e-300

_SHRUNK: Final = 0.75
"""Curves are trimmed again as long as that leaves fewer pairs of pieces, by this share."""


class Pieces(NamedTuple):
    """Curves as rational Bezier pieces; curve c has those from first[c] to first[c + 1] - 1.

    first (n + 1,), degree (n,); of each piece: start (p,), its first row in `control` (m, 3), the
    homogeneous control points; borders (p, 2) of its parameter; boxes (p, 4): least x, y, greatest.
    """

    first: Indices
    degree: Indices
    start: Indices
    control: Array
    borders: Array
    boxes: Array


@compiled
def place(lifted: Array, degree: int, t: float, work: Array) -> tuple[float, float, float, float]:
    """Return point and derivative x, y, x', y' of a piece at t; beyond [0, 1] it runs straight."""
    at = min(max(t, 0.0), 1.0)
    rest = 1.0 - at
    for i in range(degree + 1):
        for axis in range(3):
            work[i, axis] = lifted[i, axis]
    for level in range(degree, 1, -1):
        for i in range(level):
            for axis in range(3):
                work[i, axis] = rest * work[i, axis] + at * work[i + 1, axis]
    w = rest * work[0, 2] + at * work[1, 2]
    x = (rest * work[0, 0] + at * work[1, 0]) / w
    y = (rest * work[0, 1] + at * work[1, 1]) / w
    rate = work[1, 2] - work[0, 2]
    dx = degree * (work[1, 0] - work[0, 0] - rate * x) / w
    dy = degree * (work[1, 1] - work[0, 1] - rate * y) / w
    return x + (t - at) * dx, y + (t - at) * dy, dx, dy


@compiled
def survey(lifted: Array, degree: int, corners: Array, shape: Array) -> None:
    """Write down where a piece is: its box (least x, y, greatest) and the columns named above."""
    for axis in range(2):
        shape[axis], shape[2 + axis] = math.inf, -math.inf
        for i in range(degree + 1):
            corners[i, axis] = lifted[i, axis] / lifted[i, 2]
            shape[axis] = min(shape[axis], corners[i, axis])
            shape[2 + axis] = max(shape[2 + axis], corners[i, axis])
    ex, ey = corners[degree, 0] - corners[0, 0], corners[degree, 1] - corners[0, 1]
    size = math.sqrt(ex * ex + ey * ey)
    ex, ey = (ex / size, ey / size) if size > _NO_LENGTH else (1.0, 0.0)
    shape[CHORD_X], shape[CHORD_Y], shape[LENGTH] = ex, ey, size
    shape[LEAST_SLOPE], shape[MOST_SLOPE], shape[LEAST_OFFSET], shape[MOST_OFFSET] = (
        math.inf,
        -math.inf,
        0.0,
        0.0,
    )
    for i in range(degree):
        dx, dy = corners[i + 1, 0] - corners[i, 0], corners[i + 1, 1] - corners[i, 1]
        along, across = dx * ex + dy * ey, ex * dy - ey * dx
        if along > 0.0:
            shape[LEAST_SLOPE], shape[MOST_SLOPE] = (
                min(shape[LEAST_SLOPE], across / along),
                max(shape[MOST_SLOPE], across / along),
            )
        elif along < 0.0 or across != 0.0 or size <= _NO_LENGTH:
            shape[LEAST_SLOPE], shape[MOST_SLOPE] = -math.inf, math.inf
        dx, dy = corners[i + 1, 0] - corners[0, 0], corners[i + 1, 1] - corners[0, 1]
        offset = ex * dy - ey * dx
        shape[LEAST_OFFSET], shape[MOST_OFFSET] = (
            min(shape[LEAST_OFFSET], offset),
            max(shape[MOST_OFFSET], offset),
        )
    shape[SIZE] = max(shape[2] - shape[0], shape[3] - shape[1])


@compiled
def beside(shape: Array, corners: Array, others: Array, degree: int, tolerance: float) -> bool:
    """Tell whether another piece's hull is off the strip along a piece's chord."""
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
        one[0] > other[2] + tolerance
        or other[0] > one[2] + tolerance
        or one[1] > other[3] + tolerance
        or other[1] > one[3] + tolerance
    )


@compiled
def facing(
    pieces: Pieces, one: int, other: int, tolerance: float, box: Array
) -> tuple[int, int, int, int]:
    """Return the first piece and the one after the last of two curves that may meet.

    Every piece before and after them is apart from all of the other curve that are left.  `box`
    (4,): room to work in.
    """
    begin, end = pieces.first[one], pieces.first[one + 1]
    its_begin, its_end = pieces.first[other], pieces.first[other + 1]
    left, before = (end - begin) * (its_end - its_begin), math.inf
    while 0 < left < _SHRUNK * before:
        _cover(pieces.boxes, its_begin, its_end, box)
        begin, end = _trimmed(pieces.boxes, begin, end, box, tolerance)
        _cover(pieces.boxes, begin, end, box)
        its_begin, its_end = _trimmed(pieces.boxes, its_begin, its_end, box, tolerance)
        left, before = (end - begin) * (its_end - its_begin), float(left)
    return begin, end, its_begin, its_end


@compiled
def _cover(boxes: Array, begin: int, end: int, box: Array) -> None:
    """Write down the box around some of the boxes."""
    box[0], box[1], box[2], box[3] = math.inf, math.inf, -math.inf, -math.inf
    for i in range(begin, end):
        for axis in range(2):
            box[axis] = min(box[axis], boxes[i, axis])
            box[2 + axis] = max(box[2 + axis], boxes[i, 2 + axis])


@compiled
def _trimmed(boxes: Array, begin: int, end: int, box: Array, tolerance: float) -> tuple[int, int]:
    """Return which of some boxes are left without those at both ends that are apart from a box."""
    while begin < end and boxes_apart(boxes[begin], box, tolerance):
        begin += 1
    while begin < end and boxes_apart(boxes[end - 1], box, tolerance):
        end -= 1
    return begin, end


@compiled
def cones_apart(a: Array, b: Array) -> bool:
    """Tell whether no line is parallel to a tangent of both; slopes are between -1 and 1."""
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
    """Tell whether all tangents of a piece clearly point along e."""
    along, across = (
        shape[CHORD_X] * ex + shape[CHORD_Y] * ey,
        shape[CHORD_X] * ey - shape[CHORD_Y] * ex,
    )
    return bool(min(along + shape[LEAST_SLOPE] * across, along + shape[MOST_SLOPE] * across) > 0.1)


@compiled
def foot(
    lifted: Array, degree: int, ex: float, ey: float, at: float, work: Array
) -> tuple[float, float, float]:
    """Return the t at which a piece that rises or falls along e is `at` there, and its place."""
    x, y, dx, dy = place(lifted, degree, 0.0, work)
    begin = x * ex + y * ey
    x, y, dx, dy = place(lifted, degree, 1.0, work)
    end = x * ex + y * ey
    low, high, t = 0.0, 1.0, (at - begin) / (end - begin)
    for _ in range(_STEPS):
        t = min(max(t, 0.0), 1.0)
        x, y, dx, dy = place(lifted, degree, t, work)
        miss = at - (x * ex + y * ey)
        step = miss / (dx * ex + dy * ey)
        if miss == 0.0 or abs(step) < 1e-15:
            break
        if (miss > 0.0) == (end > begin):
            low = t
        else:
            high = t
        t = t + step if low < t + step < high else 0.5 * (low + high)
        if high - low < 1e-15:
            break
    return t, x, y


@compiled
def halve(lifted: Array, degree: int, halves: Array) -> None:
    """Halve a piece by de Casteljau: its middle becomes a knot as often as the degree."""
    for i in range(degree + 1):
        for axis in range(3):
            halves[1, i, axis] = lifted[i, axis]
    for i in range(degree + 1):
        for axis in range(3):
            halves[0, i, axis] = halves[1, 0, axis]
            for j in range(degree - i):
                halves[1, j, axis] = 0.5 * (halves[1, j, axis] + halves[1, j + 1, axis])
