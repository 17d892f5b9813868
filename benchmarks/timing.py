"""Measuring how long an action takes."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable


def median_of(action: Callable[[], object], runs: int = 7) -> float:
    """Return the median time [s] of an action, after one run to warm up."""
    action()
    times = []
    for _ in range(runs):
        begin = time.perf_counter()
        action()
        times.append(time.perf_counter() - begin)
    return statistics.median(times)
