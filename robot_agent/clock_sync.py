"""What the coordinator's clock shows, and how wrong that may be.

Decides: the offset between two clocks from exchanged time stamps, as NTP does.  Must not know: who
sends the stamps, or what the time is for.  Firmware: no imports beyond the shared periods.

One exchange has four stamps: the robot sends at t1 and hears at t4 (its own clock), the coordinator
hears at t2 and answers at t3 (its clock).  The offset lies within half the delay of
((t2 - t1) + (t3 - t4)) / 2, whatever the two ways took.
"""

from protocol.timing import CLOCK_SAMPLES, SECOND

DRIFT_PPM = 50
"""How much faster or slower one clock may run than the other: widens a bound as it ages."""

_LONGEST_DELAY = SECOND
_UNKNOWN = 1 << 62


class ClockSync:
    """Offset of the coordinator's clock over the robot's, by the best of the last exchanges.

    The best is the one with the smallest error bound now: half its delay and the drift since.
    `offset_ns` is what to add to the robot's clock; `good` counts the exchanges accepted.
    """

    def __init__(self) -> None:
        self.offset_ns = 0
        self.good = 0
        self._since_ns = -_UNKNOWN
        self._next = 0
        self._at = [0] * CLOCK_SAMPLES
        self._offset = [0] * CLOCK_SAMPLES
        self._half_delay = [_UNKNOWN] * CLOCK_SAMPLES

    def reset(self, now_ns: int) -> None:
        """Forget everything: another coordinator, another clock; older questions do not count."""
        self._since_ns = now_ns
        self.offset_ns = self.good = 0
        for i in range(CLOCK_SAMPLES):
            self._half_delay[i] = _UNKNOWN

    def add(self, sent_ns: int, received_ns: int, answered_ns: int, now_ns: int) -> bool:
        """Take one exchange, heard at now_ns; False when its stamps cannot be true."""
        delay = (now_ns - sent_ns) - (answered_ns - received_ns)
        if sent_ns < self._since_ns or answered_ns < received_ns:
            return False
        if not 0 <= delay <= now_ns - sent_ns <= _LONGEST_DELAY:
            return False
        slot = self._next
        self._at[slot] = now_ns
        self._offset[slot] = ((received_ns - sent_ns) + (answered_ns - now_ns)) // 2
        self._half_delay[slot] = (delay + 1) // 2
        self._next = (slot + 1) % CLOCK_SAMPLES
        self.good += 1
        best = 0
        for i in range(1, CLOCK_SAMPLES):
            if self._bound(i, now_ns) < self._bound(best, now_ns):
                best = i
        self.offset_ns = self._offset[best]
        return True

    def error_ns(self, now_ns: int) -> int:
        """Return the bound on the offset's error now; enormous before the first exchange."""
        least = self._bound(0, now_ns)
        for i in range(1, CLOCK_SAMPLES):
            bound = self._bound(i, now_ns)
            if bound < least:
                least = bound
        return least

    def _bound(self, slot: int, now_ns: int) -> int:
        return self._half_delay[slot] + (now_ns - self._at[slot]) * DRIFT_PPM // 1_000_000
