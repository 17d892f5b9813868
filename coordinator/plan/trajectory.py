"""A plan as rows over time, for other tools: robot, t, x, y, heading, s, v.

Decides: the sampling.  Must not know: files.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike

from coordinator.curves.nurbs import Array
from coordinator.plan.document import PlanDocument
from coordinator.plan.wire import Driven, drive

HEADER = "robot,t,x,y,heading,s,v"


def csv_rows(document: PlanDocument, step: float) -> Iterator[str]:
    """Yield CSV lines, header first; a robot's rows are `step` [s] apart, its last at arrival."""
    yield HEADER
    for driven in drive(document):
        times = until(step, driven.timeline.finish)
        yield from rows(driven.id, times, sample(driven, times))


def sample(driven: Driven, times: Sequence[float]) -> Array:
    """Return x, y [m], heading [rad], s [m], v [m/s] at plan times [s], (m, 5)."""
    line = driven.timeline
    return at_arcs(driven, np.array([line.s_at(t) for t in times]), [line.v_at(t) for t in times])


def at_arcs(driven: Driven, s: Array, v: ArrayLike) -> Array:
    """Return x, y, heading, s, v, (m, 5), at arc lengths s [m] driven at v [m/s]."""
    place, first = driven.curve.derivatives(driven.curve.parameter_at(s), 1)
    return np.column_stack((place, np.arctan2(first[:, 1], first[:, 0]), s, v))


def rows(robot: str, times: Sequence[float], samples: Array) -> Iterator[str]:
    """Yield a CSV line per sample."""
    for t, (x, y, heading, s, v) in zip(times, samples.tolist(), strict=True):
        yield f"{robot},{t:.6f},{x:.6f},{y:.6f},{heading:.6f},{s:.6f},{v:.6f}"


def until(step: float, finish: float) -> list[float]:
    """Return times from 0 in steps [s] up to and including the finish [s]."""
    return [*(step * i for i in range(math.ceil(finish / step))), finish]
