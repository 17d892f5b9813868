"""The fixed-rate loop: the robot's heartbeat.

Decides: when the next tick is due and that a failed one stops the motors.  Must not know: what a
tick does.  The only place in the project that catches every exception, because a robot must
outlive a bug in its own program.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

PERIOD_NS = 10_000_000
"""100 Hz."""


class FixedRateLoop:
    """Calls `tick(now_ns)` every period until it returns False.

    Deadlines are `start += period`, so that lateness does not add up; a tick that ends after the
    next deadline counts as an overrun, and deadlines already gone are left out rather than made up
    for.  A tick that raises counts as a failure and is answered by `rescues(error)`, in order,
    each of them called even when the one before failed.
    """

    def __init__(
        self,
        tick: Callable[[int], bool],
        rescues: Sequence[Callable[[Exception], None]],
        clock: Callable[[], int],
        sleep: Callable[[int], None],
        period_ns: int = PERIOD_NS,
    ) -> None:
        self.overruns = 0
        self.failures = 0
        self._tick = tick
        self._rescues = rescues
        self._clock = clock
        self._sleep = sleep
        self._period_ns = period_ns

    def run(self) -> None:
        """Run until a tick returns False."""
        deadline = self._clock()
        while self._guarded_tick():
            deadline += self._period_ns
            left = deadline - self._clock()
            if left < 0:
                self.overruns += 1
                deadline += -left // self._period_ns * self._period_ns
            else:
                self._sleep(left)

    def _guarded_tick(self) -> bool:
        try:
            return self._tick(self._clock())
        except Exception as error:
            self._rescue(error)
            return True

    def _rescue(self, error: Exception) -> None:
        self.failures += 1
        for rescue in self._rescues:
            try:
                rescue(error)
            except Exception:
                self.failures += 1
