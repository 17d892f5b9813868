"""What the coordinator's clock shows, and how wrong that may be.

Decides: the offset between two clocks from exchanged time stamps, as NTP does, and when to ask.
Must not know: who sends the stamps, or what the time is for.  Firmware: no imports beyond the
shared periods.

One exchange has four stamps: the robot sends at t1 and hears at t4 (its own clock), the coordinator
hears at t2 and answers at t3 (its clock).  The offset lies within half the delay of
((t2 - t1) + (t3 - t4)) / 2, whatever the two ways took.
"""

from protocol.timing import CLOCK_PERIOD, CLOCK_PERIOD_FAST, CLOCK_SAMPLES, SECOND

DRIFT_PPM = 50
"""How much faster or slower one clock may run than the other: widens a bound as it ages."""

SLEW_SHARE = 50
"""A slewing clock gains or loses a part in so many: the speed reserve of plans makes up for it."""

_LONGEST_DELAY = 10 * SECOND
_UNKNOWN = 1 << 62


class ClockSync:
    """Offset of the coordinator's clock over the robot's, by the best exchange so far.

    The best is the one with the smallest error bound now: half its delay plus the drift since.  So
    one lucky exchange serves until drift has made it worse than a new one, and no window of
    unlucky ones can widen the bound.  `offset_ns` is what to add to the robot's clock; `good`
    counts the exchanges accepted.

    A robot on the move does not step to a better offset but slews (`follow`): its plan must not
    jump.  On the way it is between two offsets, so the wider of their bounds holds.
    """

    def __init__(self) -> None:
        self.offset_ns = 0
        self.good = 0
        self._since_ns = self._asked_ns = -_UNKNOWN
        self._asked = 0
        self._best_ns = self._at_ns = self._used_at_ns = self._followed_ns = 0
        self._half_delay_ns = self._used_half_ns = _UNKNOWN
        self._slewing = False

    def reset(self, now_ns: int) -> None:
        """Forget everything: another coordinator, another clock; older questions do not count."""
        self._since_ns = now_ns
        self.offset_ns = self.good = self._best_ns = 0
        self._half_delay_ns = self._used_half_ns = _UNKNOWN
        self._slewing = False

    def add(self, sent_ns: int, received_ns: int, answered_ns: int, now_ns: int) -> bool:
        """Take one exchange, heard at now_ns; False when its stamps cannot be true."""
        delay = (now_ns - sent_ns) - (answered_ns - received_ns)
        if sent_ns < self._since_ns or answered_ns < received_ns:
            return False
        if not 0 <= delay <= now_ns - sent_ns <= _LONGEST_DELAY:
            return False
        self.good += 1
        half_delay = (delay + 1) // 2
        if half_delay <= self._half_delay_ns + _drift(now_ns - self._at_ns):
            self._at_ns, self._half_delay_ns = now_ns, half_delay
            self._best_ns = ((received_ns - sent_ns) + (answered_ns - now_ns)) // 2
            if not self._slewing:
                self._use_best()
        return True

    def follow(self, now_ns: int, slewing: bool) -> None:
        """Come nearer to the best offset; at once unless `slewing`."""
        most = (now_ns - self._followed_ns) // SLEW_SHARE
        self._followed_ns, self._slewing = now_ns, slewing
        left = self._best_ns - self.offset_ns
        if slewing and abs(left) > most:
            self.offset_ns += most if left > 0 else -most
        else:
            self._use_best()

    def _use_best(self) -> None:
        self.offset_ns = self._best_ns
        self._used_at_ns, self._used_half_ns = self._at_ns, self._half_delay_ns

    def due(self, now_ns: int, enough_ns: int, moving: bool) -> bool:
        """Tell whether to ask for the time now, which then counts as done.

        Often at first, less and less often as long as no answer makes the error `enough_ns` or less
        (a crowd of robots must not keep the coordinator from answering), rarely on the move.
        """
        certain = self.good >= CLOCK_SAMPLES and self.error_ns(now_ns) <= enough_ns
        rarely = certain or moving
        period = min(CLOCK_PERIOD_FAST * (1 + self._asked // CLOCK_SAMPLES), CLOCK_PERIOD)
        if now_ns - self._asked_ns < (CLOCK_PERIOD if rarely else period):
            return False
        self._asked_ns = now_ns
        self._asked = 0 if rarely else self._asked + 1
        return True

    def error_ns(self, now_ns: int) -> int:
        """Return the bound on the offset's error now; enormous before the first exchange."""
        return self._used_half_ns + _drift(now_ns - self._used_at_ns)


def _drift(passed_ns: int) -> int:
    return passed_ns * DRIFT_PPM // 1_000_000
