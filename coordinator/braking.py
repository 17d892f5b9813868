"""When a robot began to brake, told from where it came to rest.

Decides: that it braked evenly, with the rate of its plan.  Must not know: logs.
"""

from __future__ import annotations

import math
from typing import Final

from protocol.timeline import Timeline

_HALVINGS: Final = 60


def brakes_at(line: Timeline, s: float, rate: float) -> float:
    """Return when a robot that rests at arc length s [m] began to brake [s]; inf: it did not.

    rate: how it brakes [m/s^2]; 0: at once.
    """

    def rests(t: float) -> float:
        return line.s_at(t) + (line.v_at(t) ** 2 / (2.0 * rate) if rate > 0.0 else 0.0)

    low, high = 0.0, line.finish
    if rests(high) <= s:
        return math.inf
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if rests(middle) >= s else (middle, high)
    return high
