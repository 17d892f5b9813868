"""What the coordinator's clock shows, how wrong that may be, and when it is not known at all.

Decides: the offset between two clocks from exchanged time stamps, as NTP does, and when to ask.
Must not know: who sends the stamps, or what the time is for.  Firmware: no imports beyond the
shared periods.

One exchange has four stamps: the robot sends at t1 and hears at t4 (its own clock), the coordinator
hears at t2 and answers at t3 (its clock).  No message arrives before it is sent, so the offset lies
between t3 - t4 and t2 - t1, whatever the two ways took (Marzullo and Owicki 1983).  Intervals of
several exchanges, widened by drift as they age, have the offset in common.  Where they have nothing
in common one of the clocks was stopped or set, and nothing learnt before holds any more.
"""

from protocol.timing import CLOCK_PERIOD, CLOCK_PERIOD_FAST, CLOCK_SAMPLES, SECOND

DRIFT_PPM = 100
"""How much faster or slower one clock may run than the other: widens an interval as it ages."""

SLEW_SHARE = 50
"""A slewing clock gains or loses a part in so many: the speed reserve of plans makes up for it."""

_LONGEST_DELAY = 10 * SECOND
_UNKNOWN = 1 << 62


class ClockSync:
    """Offset of the coordinator's clock over the robot's, as an interval.

    `offset_ns` is what to add to the robot's clock: the middle of the interval, but for a robot on
    the move, whose plan must not jump; it slews there (`follow`).  `good` counts the exchanges
    since the last start; 0 means that the offset is not known.
    """

    def __init__(self) -> None:
        self.offset_ns = self.good = 0
        self._low_ns, self._high_ns, self._at_ns = -_UNKNOWN, _UNKNOWN, 0
        self._asked_ns = self._since_ns = -_UNKNOWN
        self._asked = self._followed_ns = 0
        self._slewing = self._compares = False

    def start_over(self, now_ns: int) -> None:
        """Forget everything; answers to questions from before do not count."""
        self._doubt(now_ns)
        self._compares = False

    def doubt(self, now_ns: int) -> None:
        """Believe nothing learnt so far before an exchange that begins now confirms it."""
        if self.good:
            self._doubt(now_ns)
            self._compares = True

    def add(self, sent_ns: int, received_ns: int, answered_ns: int, now_ns: int) -> bool:
        """Take one exchange, heard at now_ns; False when it contradicts the ones before.

        Stamps that no exchange has, and answers to questions from before the last start, are left
        out.
        """
        if sent_ns < self._since_ns or answered_ns < received_ns:
            return True
        if not 0 <= now_ns - sent_ns <= _LONGEST_DELAY:
            return True
        drift = _drift(now_ns - sent_ns)
        low, high = answered_ns - now_ns - drift, received_ns - sent_ns + drift
        old_low, old_high = self._widened(now_ns)
        if low > high or ((self.good or self._compares) and (low > old_high or high < old_low)):
            return False
        if self.good:
            low, high = max(low, old_low), min(high, old_high)
        self._low_ns, self._high_ns, self._at_ns = low, high, now_ns
        self._compares = False
        self.good += 1
        if not self._slewing:
            self._step()
        return True

    def is_said_in_future(self, said_ns: int, now_ns: int) -> bool:
        """Tell whether a message heard by now was sent later, on the coordinator's clock."""
        return self.good > 0 and said_ns - now_ns > self._widened(now_ns)[1]

    def follow(self, now_ns: int, slewing: bool) -> None:
        """Come nearer to the middle of the interval; at once unless `slewing`."""
        most = (now_ns - self._followed_ns) // SLEW_SHARE
        self._followed_ns, self._slewing = now_ns, slewing
        if not self.good:
            return
        left = self._middle() - self.offset_ns
        if slewing and abs(left) > most:
            self.offset_ns += most if left > 0 else -most
        else:
            self._step()

    def due(self, now_ns: int, enough_ns: int, moving: bool) -> bool:
        """Tell whether to ask for the time now, which then counts as done.

        Often at first, less and less often as long as no answer makes the error `enough_ns` or less
        (a crowd of robots must not keep the coordinator from answering), rarely on the move.
        """
        sure = self.error_ns(now_ns) <= enough_ns
        rarely = sure and (moving or self.good >= CLOCK_SAMPLES)
        period = min(CLOCK_PERIOD_FAST * (1 + self._asked // CLOCK_SAMPLES), CLOCK_PERIOD)
        if now_ns - self._asked_ns < (CLOCK_PERIOD if rarely else period):
            return False
        self._asked_ns = now_ns
        self._asked = 0 if rarely else self._asked + 1
        return True

    def error_ns(self, now_ns: int) -> int:
        """Return the bound on the offset's error now; enormous while the offset is not known."""
        if not self.good:
            return _UNKNOWN
        low, high = self._widened(now_ns)
        return max(high - self.offset_ns, self.offset_ns - low)

    def _doubt(self, now_ns: int) -> None:
        self._since_ns, self._asked_ns = now_ns, -_UNKNOWN
        self.good = self._asked = 0

    def _widened(self, now_ns: int) -> tuple[int, int]:
        """Return the interval [ns] that the offset is in now."""
        drift = _drift(now_ns - self._at_ns)
        return self._low_ns - drift, self._high_ns + drift

    def _middle(self) -> int:
        return (self._low_ns + self._high_ns) // 2

    def _step(self) -> None:
        self.offset_ns = self._middle()


def _drift(passed_ns: int) -> int:
    """Return how much two clocks may have drifted apart; their readings are rounded."""
    return 1 + passed_ns * DRIFT_PPM // 1_000_000
