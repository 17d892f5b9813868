"""A plan as rows over time, for other tools: robot, t, x, y, heading, s, v.

Decides: the sampling.  Must not know: files.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from coordinator.plan import PlanDocument
from coordinator.wire import Driven, drive

HEADER = "robot,t,x,y,heading,s,v"


def csv_rows(document: PlanDocument, step: float) -> Iterator[str]:
    """Yield CSV lines, header first; `step` in seconds, the last row is each robot's arrival."""
    yield HEADER
    for driven in drive(document):
        yield from _robot_rows(driven, step)


def _robot_rows(driven: Driven, step: float) -> Iterator[str]:
    line = driven.timeline
    times = [*(step * i for i in range(math.ceil(line.finish / step))), line.finish]
    s = np.array([line.s_at(t) for t in times])
    place, first = driven.curve.derivatives(driven.curve.parameter_at(s), 1)
    heading = np.arctan2(first[:, 1], first[:, 0])
    for t, at, angle, arc in zip(times, place.tolist(), heading.tolist(), s.tolist(), strict=True):
        yield (
            f"{driven.id},{t:.6f},{at[0]:.6f},{at[1]:.6f},{angle:.6f},{arc:.6f},{line.v_at(t):.6f}"
        )
