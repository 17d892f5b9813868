"""What the coordinator's clock shows, and how wrong that may be.

Decides: the offset between two clocks from exchanged time stamps, as NTP does.  Must not know: who
sends the stamps, or what the time is for.  Firmware: no imports beyond the shared periods.

One exchange has four stamps: the robot sends at t1 and hears at t4 (its own clock), the coordinator
hears at t2 and answers at t3 (its clock).  The offset lies within half the delay of
((t2 - t1) + (t3 - t4)) / 2, whatever the two ways took.
"""

from protocol.timing import SECOND

DRIFT_PPM = 50
"""How much faster or slower one clock may run than the other: widens a bound as it ages."""

_LONGEST_DELAY = SECOND
_UNKNOWN = 1 << 62


class ClockSync:
    """Offset of the coordinator's clock over the robot's, by the best exchange so far.

    The best is the one with the smallest error bound now: half its delay plus the drift since.  So
    one lucky exchange serves until drift has made it worse than a new one, and no window of
    unlucky ones can widen the bound.  `offset_ns` is what to add to the robot's clock; `good`
    counts the exchanges accepted.
    """

    def __init__(self) -> None:
        self.offset_ns = 0
        self.good = 0
        self._since_ns = -_UNKNOWN
        self._at_ns = 0
        self._half_delay_ns = _UNKNOWN

    def reset(self, now_ns: int) -> None:
        """Forget everything: another coordinator, another clock; older questions do not count."""
        self._since_ns = now_ns
        self.offset_ns = self.good = 0
        self._half_delay_ns = _UNKNOWN

    def add(self, sent_ns: int, received_ns: int, answered_ns: int, now_ns: int) -> bool:
        """Take one exchange, heard at now_ns; False when its stamps cannot be true."""
        delay = (now_ns - sent_ns) - (answered_ns - received_ns)
        if sent_ns < self._since_ns or answered_ns < received_ns:
            return False
        if not 0 <= delay <= now_ns - sent_ns <= _LONGEST_DELAY:
            return False
        self.good += 1
        half_delay = (delay + 1) // 2
        if half_delay <= self.error_ns(now_ns):
            self._at_ns, self._half_delay_ns = now_ns, half_delay
            self.offset_ns = ((received_ns - sent_ns) + (answered_ns - now_ns)) // 2
        return True

    def error_ns(self, now_ns: int) -> int:
        """Return the bound on the offset's error now; enormous before the first exchange."""
        return self._half_delay_ns + (now_ns - self._at_ns) * DRIFT_PPM // 1_000_000
