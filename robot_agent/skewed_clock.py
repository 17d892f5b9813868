"""A robot's own clock in simulation: ahead of another one, and faster or slower.

Decides: how it is off.
"""

from __future__ import annotations

from collections.abc import Callable


def skewed_clock(clock: Callable[[], int], offset_ns: int, drift_ppm: int) -> Callable[[], int]:
    """Return a clock that is ahead of another and gains on it: a robot's own, in simulation."""
    began = clock()

    def skewed() -> int:
        now = clock()
        return now + offset_ns + (now - began) * drift_ppm // 1_000_000

    return skewed
