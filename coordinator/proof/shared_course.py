"""Up to when two courses of one robot are the same: where a robot may change over while it drives.

Both courses are compared from their bytes, as straight pieces with a proven deviation.  A share of
the margin covers what they may differ by.

Decides: until which plan time a newer course is the course before it.  Must not know: how courses
are found.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from coordinator.base.kept import kept
from coordinator.curves.nurbs import Array
from coordinator.plan.wire import Driven
from coordinator.proof.motion_pieces import Flights, Part
from coordinator.proof.separation_kernels import BEGIN, DEVIATION, END, X0, X1, Y0, Y1
from coordinator.scenario.margin import SAME

_DEVIATION: Final = 0.2 * SAME
"""Greatest deviation [m] of the pieces that are compared."""

_STEP: Final = 0.01
"""Courses are compared at plan times that are multiples of this [s]; the result is one of them."""

_LONGEST: Final = 8.0
"""No more than this [s] is compared."""

_SPEED: Final = 1e-3
_TURN: Final = 2e-3
"""By how much speeds [m/s] and directions [rad] may differ."""


@kept
def shared_until(old: Driven, new: Driven) -> float:
    """Return the plan time [s] until which a newer course is the old one, from its beginning on.

    A course that begins at rest, or whose robot stops at once, shares nothing: the result is its
    beginning.
    """
    begin = 0.001 * new.plan.begin_ms
    end = min(old.timeline.finish, new.timeline.finish, begin + _LONGEST)
    if not new.timeline.v_at(begin) > 0.0 or not new.plan.brake_mmps2 or end <= begin:
        return begin
    both = [_pieces(one, begin, end) for one in (old, new)]
    steps = np.arange(math.ceil(begin / _STEP), math.floor(end / _STEP) + 1) * _STEP
    times = np.unique(np.concatenate((*(rows[:, BEGIN] for rows in both), steps)))
    times = times[(times >= begin) & (times < end)]
    places = [_places(rows, times) for rows in both]
    apart = np.hypot(*(places[0] - places[1]).T)
    rooms = [rows[_piece_at(rows, times), DEVIATION] for rows in both]
    near = np.maximum(apart[:-1], apart[1:]) + rooms[0][:-1] + rooms[1][:-1] <= SAME
    speeds, ways = zip(*(_motion(one, times) for one in (old, new)), strict=True)
    alike = np.abs(speeds[0] - speeds[1]) <= _SPEED
    alike &= (ways[0] * ways[1]).sum(axis=1) >= math.cos(_TURN)
    differ = np.flatnonzero(~(near & alike[:-1] & alike[1:]))
    until = float(times[differ[0] if len(differ) else -1])
    return max(math.floor(until / _STEP + 1e-6) * _STEP, begin)


def _pieces(driven: Driven, begin: float, end: float) -> Array:
    """Return a motion in a span of time [s] as rows of pieces, in order."""
    return Flights((driven,), Part([(begin, end)], [True])).pieces(_DEVIATION).rows


def _piece_at(rows: Array, times: Array) -> npt.NDArray[np.int64]:
    return np.clip(np.searchsorted(rows[:, BEGIN], times, side="right") - 1, 0, None)


def _places(rows: Array, times: Array) -> Array:
    """Return the places (m, 2) [m] at times (m,) on the chords of pieces."""
    at = rows[_piece_at(rows, times)]
    part = (times - at[:, BEGIN]) / (at[:, END] - at[:, BEGIN])
    return np.asarray(
        at[:, X0 : Y0 + 1] + part[:, None] * (at[:, X1 : Y1 + 1] - at[:, X0 : Y0 + 1])
    )


def _motion(driven: Driven, times: Array) -> tuple[Array, Array]:
    """Return speeds (m,) [m/s] and directions (m, 2) at plan times (m,) [s]."""
    line = driven.timeline
    arcs = np.array([line.s_at(time) for time in times.tolist()])
    _, ahead = driven.curve.derivatives(driven.curve.parameter_at(arcs), 1)
    sizes = np.maximum(np.hypot(*ahead.T), 1e-12)
    return np.array([line.v_at(time) for time in times.tolist()]), ahead / sizes[:, None]
