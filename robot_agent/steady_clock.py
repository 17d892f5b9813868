"""A robot's own clock as its program sees it: it never runs backwards.

Decides: that a clock which was set back continues from where it was plus LEAP.  The jump looks like
a late tick, after which the robot no longer trusts its time (agent.py).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from protocol.timing import MILLISECOND

LEAP: Final = 200 * MILLISECOND
"""How far [ns] the time jumps forwards when the clock was set back."""

_READING_ORDER: Final = MILLISECOND
"""Threads that read the clock at once may see it run back by this much [ns], which is harmless."""


class SteadyClock:
    """Reads a clock [ns]; what it returns never falls."""

    def __init__(self, clock: Callable[[], int]) -> None:
        self._clock = clock
        self._read_ns = clock()
        self._added_ns = 0

    def __call__(self) -> int:
        """Return the time."""
        now_ns, before_ns = self._clock(), self._read_ns
        if now_ns < before_ns - _READING_ORDER:
            self._added_ns += before_ns - now_ns + LEAP
        elif now_ns < before_ns:
            now_ns = before_ns
        self._read_ns = now_ns
        return now_ns + self._added_ns

    def read_before(self, now_ns: int) -> int:
        """Take in that the clock showed a time since it was last set; return it as `__call__`."""
        self._read_ns = max(self._read_ns, now_ns)
        return now_ns + self._added_ns
