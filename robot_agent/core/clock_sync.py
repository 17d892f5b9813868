"""An estimate of the coordinator's clock, with a bound on its error.

Decides: the offset between two clocks from exchanged time stamps, as NTP does, when to ask for the
time, and which questions are open.  Must not know: who sends the stamps, or what the time is for.
Firmware: it imports only the shared periods.

One exchange has four stamps: the robot sends at t1 and gets the answer at t4 (on its own clock);
the coordinator receives at t2 and answers at t3 (on its clock).  No message arrives before it is
sent, so the offset lies between t3 - t4 and t2 - t1, whatever the two delays were (Marzullo and
Owicki 1983).  The offset lies in the intersection of the intervals of several exchanges, each
widened by drift as it ages.  If the intersection is empty, one of the clocks was stopped or set,
and all earlier exchanges are discarded.

An answer counts only for a question that is open, and closes it: a message that is sent twice, or
made up by somebody who has not heard the question, changes nothing.
"""

from protocol.timing import CLOCK_PERIOD, CLOCK_PERIOD_FAST, CLOCK_SAMPLES, SECOND

DRIFT_PPM = 100
"""How much faster or slower one clock may run than the other: widens an interval as it ages."""

SLEW_SHARE = 50
"""A slewing clock gains or loses 1 s in this many seconds; plans have a speed reserve for that."""

MOST_OPEN = 16
"""A robot keeps so many questions open.  At the pace of CLOCK_PERIOD_FAST that is enough for
answers that take 1 s; while there are none, it asks less often."""

_LONGEST_DELAY = 10 * SECOND
_UNKNOWN = 1 << 62
_CLOSED = -(1 << 63)
"""No message can name this time: stamps are between -2^62 and 2^62."""


class ClockSync:
    """The offset of the coordinator's clock from the robot's, as an interval.

    `offset_ns` is what to add to the robot's clock: the middle of the interval.  While the robot
    moves, its plan time must not jump, so the offset slews towards the middle (`follow`).  `good`
    counts the exchanges since the last start; 0 means that the offset is not known.
    """

    def __init__(self) -> None:
        self.offset_ns = self.good = 0
        self._low_ns, self._high_ns, self._at_ns = -_UNKNOWN, _UNKNOWN, 0
        self._middle_ns = 0
        self._asked_ns = self._since_ns = -_UNKNOWN
        self._open = [_CLOSED] * MOST_OPEN  # When open questions were asked; a ring.
        self._place = 0  # Where the next question goes.
        self._asked = self._followed_ns = 0
        self._period_ns = CLOCK_PERIOD_FAST  # How long to wait with the next question while unsure.
        self._slewing = self._compares = False

    def start_over(self, now_ns: int) -> None:
        """Discard all exchanges; the questions that were asked before now are closed.

        The offset then steps to what the first exchange says, even while the robot moves.
        """
        self._doubt(now_ns)
        self._compares = self._slewing = False

    def doubt(self, now_ns: int) -> None:
        """Distrust the offset until an exchange that begins after now confirms it."""
        if self.good:
            self._doubt(now_ns)
            self._compares = True

    def ask(self, now_ns: int) -> None:
        """Open a question; it takes the place of the oldest one."""
        self._open[self._place] = self._asked_ns = now_ns
        self._place = (self._place + 1) % MOST_OPEN

    def add(self, sent_ns: int, received_ns: int, answered_ns: int, now_ns: int) -> bool:
        """Add one exchange, whose answer arrived at now_ns; False if it contradicts earlier ones.

        Impossible stamps are ignored, and so are answers to questions that are not open.
        """
        if sent_ns < self._since_ns or answered_ns < received_ns or sent_ns not in self._open:
            return True
        self._open[self._open.index(sent_ns)] = _CLOSED
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
        self._middle_ns = (low + high) // 2
        self._compares = False
        self.good += 1
        if not self._slewing:
            self.offset_ns = self._middle_ns
        return True

    def is_said_in_future(self, said_ns: int, now_ns: int) -> bool:
        """Return whether a message's time stamp is later than the coordinator's clock can be."""
        return self.good > 0 and said_ns - now_ns > self._widened(now_ns)[1]

    def follow(self, now_ns: int, slewing: bool) -> None:
        """Move the offset to the middle of the interval: gradually if `slewing`, else at once."""
        before_ns = self._followed_ns
        self._followed_ns, self._slewing = now_ns, slewing
        left = self._middle_ns - self.offset_ns
        if not left or not self.good:
            return
        most = (now_ns - before_ns) // SLEW_SHARE
        if slewing and abs(left) > most:
            self.offset_ns += most if left > 0 else -most
        else:
            self.offset_ns = self._middle_ns

    def due(self, now_ns: int, enough_ns: int, moving: bool) -> bool:
        """Return whether to ask for the time now; if so, the question counts as asked.

        The robot asks often at first, and less and less often as long as the error stays above
        `enough_ns`, because a crowd of robots must not overload the coordinator.  It asks rarely
        while it moves.
        """
        passed = now_ns - self._asked_ns
        if passed < self._period_ns:
            return False
        rarely = (moving or self.good >= CLOCK_SAMPLES) and self.is_within(enough_ns, now_ns)
        if rarely and passed < CLOCK_PERIOD:
            return False
        self.ask(now_ns)
        self._asked = 0 if rarely else self._asked + 1
        self._period_ns = min(CLOCK_PERIOD_FAST * (1 + self._asked // CLOCK_SAMPLES), CLOCK_PERIOD)
        return True

    def quiet_until(self, enough_ns: int) -> int:
        """Return a time [ns] before which a robot that stands asks nothing, if it hears nothing."""
        until_ns = self._asked_ns + CLOCK_PERIOD
        if self.good >= CLOCK_SAMPLES and self.is_within(enough_ns, until_ns):
            return until_ns
        return self._asked_ns + self._period_ns

    def error_ns(self, now_ns: int) -> int:
        """Return the bound [ns] on the offset's error; enormous while the offset is not known."""
        if not self.good:
            return _UNKNOWN
        above, below = self._high_ns - self.offset_ns, self.offset_ns - self._low_ns
        return max(above, below) + _drift(now_ns - self._at_ns)

    def is_within(self, limit_ns: int, now_ns: int) -> bool:
        """Return whether `error_ns` is at most `limit_ns`; asked in every tick, so spelled out."""
        above, below = self._high_ns - self.offset_ns, self.offset_ns - self._low_ns
        room = limit_ns - (above if above > below else below)
        return self.good > 0 and (now_ns - self._at_ns) * DRIFT_PPM < room * 1_000_000

    def _doubt(self, now_ns: int) -> None:
        self._since_ns, self._asked_ns = now_ns, -_UNKNOWN
        self.good = self._asked = 0
        self._period_ns = CLOCK_PERIOD_FAST

    def _widened(self, now_ns: int) -> tuple[int, int]:
        """Return the interval [ns] that the offset is in now."""
        drift = _drift(now_ns - self._at_ns)
        return self._low_ns - drift, self._high_ns + drift


def _drift(passed_ns: int) -> int:
    """Return how far [ns] two clocks may have drifted apart; 1 ns allows for rounded readings."""
    return 1 + passed_ns * DRIFT_PPM // 1_000_000
