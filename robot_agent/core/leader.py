"""The coordinator that a robot obeys, and its newest Command.

Decides: which Command counts, and when the coordinator is silent.  Must not know: what a Command
makes the robot do.  Firmware: imports nothing but the shared numbers.

A robot obeys the highest (term, boot id) that it has heard; sequences count within them.  Before
motion it also obeys another coordinator when its own is silent.  So a former coordinator's
messages, if somebody replays them, are ignored while there is another coordinator.
"""

from protocol.phases import HOLD
from protocol.timing import COORDINATOR_TIMEOUT

_NEVER = -(1 << 62)


class Leader:
    """The coordinator that the robot obeys.

    term, boot: who it is, -1 as long as no coordinator was heard; epoch, phase, sequence: those of
    its newest Command; run: the run of the fleet that it leads.
    """

    def __init__(self) -> None:
        self.term = self.boot = self.sequence = -1
        self.epoch = self.run = 0
        self.phase = HOLD
        self._heard_ns = _NEVER

    def is_known(self) -> bool:
        """Whether the robot has heard a Command."""
        return self.term >= 0

    def counts(self, term: int, boot: int, sequence: int, before_motion: bool, now_ns: int) -> bool:
        """Return whether a Command is to be obeyed."""
        if term == self.term and boot == self.boot:
            return sequence > self.sequence
        if term > self.term or (term == self.term and boot > self.boot):
            return True
        return before_motion and now_ns - self._heard_ns > COORDINATOR_TIMEOUT

    def hear(
        self, term: int, boot: int, sequence: int, epoch: int, phase: int, now_ns: int
    ) -> bool:
        """Store a Command that is to be obeyed; return whether it is of a new coordinator."""
        another = self.boot not in (-1, boot) or self.term not in (-1, term)
        self.term, self.boot, self.sequence = term, boot, sequence
        self.epoch, self.phase, self._heard_ns = epoch, phase, now_ns
        return another
