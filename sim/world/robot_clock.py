"""A robot's own clock in simulation: it may be ahead, run faster or slower, be stopped or set.

Decides: how the clock deviates from the true time.
"""

from __future__ import annotations

from collections.abc import Callable


class RobotClock:
    """Shows a true time [ns] with an offset and a drift; it can be stopped and set."""

    def __init__(self, truth: Callable[[], int], offset_ns: int, drift_ppm: int) -> None:
        self._truth = truth
        self._began_ns = truth()
        self._offset_ns = offset_ns
        self._drift_ppm = drift_ppm
        self._stopped_ns: int | None = None

    def __call__(self) -> int:
        """Return what the clock shows."""
        return self.at(self._truth())

    def at(self, now_ns: int) -> int:
        """Return what the clock shows at a true time since it was last set, stopped or started."""
        if self._stopped_ns is not None:
            return self._stopped_ns
        return now_ns + self._offset_ns + (now_ns - self._began_ns) * self._drift_ppm // 1_000_000

    def set(self, by_ns: int) -> None:
        """Jump forwards, or backwards if `by_ns` is negative."""
        if self._stopped_ns is None:
            self._offset_ns += by_ns
        else:
            self._stopped_ns += by_ns

    def drift(self, ppm: int) -> None:
        """Run faster or slower from now on."""
        now_ns = self._truth()
        self._offset_ns += (now_ns - self._began_ns) * self._drift_ppm // 1_000_000
        self._began_ns, self._drift_ppm = now_ns, ppm

    def stop(self) -> None:
        """Stop the clock."""
        self._stopped_ns = self()

    def go_on(self) -> None:
        """Let the clock run again from where it stopped."""
        stopped_ns, self._stopped_ns = self._stopped_ns, None
        if stopped_ns is not None:
            self._offset_ns += stopped_ns - self()
