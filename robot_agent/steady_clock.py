"""A robot's own clock as its program sees it: it never runs backwards.

Decides: that a clock which was set back continues from where it was plus LEAP.  The jump looks like
a late tick, after which the robot no longer trusts its time (agent.py).
"""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock
from typing import Final

from protocol.timing import MILLISECOND

LEAP: Final = 200 * MILLISECOND
"""How far [ns] the time jumps forwards when the clock was set back."""

_READING_ORDER: Final = MILLISECOND
"""A clock that runs back by this much [ns] was not set back."""


class SteadyClock:
    """Reads a clock [ns]; what it returns never falls.

    One thread at a time reads it: a reading that is taken in late would look like a clock set back.
    """

    def __init__(self, clock: Callable[[], int]) -> None:
        self._clock, self._lock = clock, Lock()
        self._read_ns = clock()
        self._added_ns = 0

    def __call__(self) -> int:
        """Return the time."""
        with self._lock:
            now_ns, before_ns = self._clock(), self._read_ns
            if now_ns < before_ns - _READING_ORDER:
                self._added_ns += before_ns - now_ns + LEAP
            elif now_ns < before_ns:
                now_ns = before_ns
            self._read_ns = now_ns
            return now_ns + self._added_ns

    def read_before(self, now_ns: int) -> int:
        """Take in that the clock showed a time since it was last set; return it as `__call__`."""
        with self._lock:
            self._read_ns = max(self._read_ns, now_ns)
            return now_ns + self._added_ns
