"""The control loop, which calls a tick at a fixed rate.

Decides: when the next tick is due, and that the motors stop after a tick that failed.  Must not
know: what a tick does.  This is the only module that catches every exception, because a robot must
keep running when its program has a bug.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

PERIOD_NS = 10_000_000
"""100 Hz."""


class FixedRateLoop:
    """Calls `tick(now_ns)` every period until it returns False.

    Each deadline is the previous one plus the period, so delays do not add up.  A tick that ends
    after the next deadline counts as an overrun; missed deadlines are skipped.  A tick that raises
    counts as a failure: each function in `rescues` is called with the error, in order, even when
    the one before it raised.  The loop counts `ticks`, `overruns`, `failures` and `worst_ns`, the
    duration of the longest tick [ns].
    """

    def __init__(
        self,
        tick: Callable[[int], bool],
        rescues: Sequence[Callable[[Exception], None]],
        clock: Callable[[], int],
        sleep: Callable[[int], None],
        period_ns: int = PERIOD_NS,
    ) -> None:
        self.ticks = self.overruns = self.failures = self.worst_ns = 0
        self._tick = tick
        self._rescues = rescues
        self._clock = clock
        self._sleep = sleep
        self._period_ns = period_ns

    def run(self) -> None:
        """Run until a tick returns False."""
        deadline = began = self._clock()
        while self._guarded_tick(began):
            ended = self._clock()
            self.ticks += 1
            self.worst_ns = max(self.worst_ns, ended - began)
            deadline += self._period_ns
            left = deadline - ended
            if left < 0:
                self.overruns += 1
                deadline += -left // self._period_ns * self._period_ns
            else:
                self._sleep(left)
            began = self._clock()

    def _guarded_tick(self, now_ns: int) -> bool:
        try:
            return self._tick(now_ns)
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
