"""The clock that all programs of one computer share; it runs on while the computer sleeps.

Decides: which of the system's clocks that is.  The coordinator and the agents read the same clock,
so that on one computer their times agree exactly.
"""

from __future__ import annotations

import time

_ID = getattr(time, "CLOCK_BOOTTIME", None)
"""Linux: like the monotonic clock, but it counts the time that the computer was suspended."""


def host_clock_ns() -> int:
    """Return the time [ns] since some moment before the program began; it never decreases."""
    return time.monotonic_ns() if _ID is None else time.clock_gettime_ns(_ID)


def time_of_day(at: float | None = None) -> str:
    """Return the local time of day as text for people; nothing is computed from it.

    `at`: seconds since 1970; None for now.
    """
    return time.strftime("%H:%M:%S", time.localtime(at))
