"""The coordinator that a robot obeys, and its newest Command.

Decides: which Command counts, and when the coordinator is silent.  Must not know: what a Command
makes the robot do.  Firmware: imports nothing but the shared numbers.

A Command older than the last one heard changes nothing.  Another coordinator (boot) is believed
when its epoch is higher; before motion also when its boot id is, at the same epoch (of two
coordinators the lower one gives way), or when nothing is heard of the robot's own any more.  So
what a former coordinator said, put on the wire once more, is not believed while there is another.
"""

from protocol.phases import HOLD
from protocol.timing import LEASE

_NEVER = -(1 << 62)


class Leader:
    """boot: -1 as long as none was heard; epoch, phase, sequence: of its newest Command.

    `has_other_clock`: it is not the one that the robot's time comes from.
    """

    def __init__(self) -> None:
        self.boot = self.sequence = -1
        self.epoch = 0
        self.phase = HOLD
        self.has_other_clock = False
        self._heard_ns = _NEVER

    def counts(
        self, boot: int, sequence: int, epoch: int, before_motion: bool, now_ns: int
    ) -> bool:
        """Tell whether a Command counts; one that moves the robot keeps its coordinator."""
        if boot == self.boot:
            return sequence > self.sequence
        if epoch > self.epoch:
            return True
        higher = epoch == self.epoch and boot > self.boot
        return before_motion and (higher or self.is_silent(LEASE, now_ns))

    def hear(
        self, boot: int, sequence: int, epoch: int, phase: int, now_ns: int, said_ns: int
    ) -> bool:
        """Take a Command that counts; tell whether another coordinator leads from now on.

        `said_ns`: when it was said, on the robot's clock; it may have been long on its way.
        """
        one_clock = boot == self.boot and not self.has_other_clock
        self._heard_ns = min(now_ns, said_ns) if one_clock else now_ns
        another = self.boot not in (-1, boot)
        self.has_other_clock = self.has_other_clock or another
        self.boot, self.sequence = boot, sequence
        self.epoch, self.phase = epoch, phase
        return another

    def is_silent(self, lease_ns: int, now_ns: int) -> bool:
        """Tell whether what was heard last was said longer than a lease ago."""
        return now_ns - self._heard_ns > lease_ns
