"""The coordinator that a robot obeys, and its newest Command.

Decides: which Command counts, and when the coordinator is silent.  Must not know: what a Command
makes the robot do.  Firmware: imports nothing but the shared numbers.

A Command older than the last one received changes nothing.  A robot obeys another coordinator (one
with another boot id) when its epoch is higher.  Before motion the robot also does so when the epoch
is the same and the boot id is higher (of two coordinators the one with the lower id gives way), or
when its own coordinator is silent.  So a former coordinator's messages, if somebody replays them,
are ignored while there is another coordinator.
"""

from protocol.phases import HOLD
from protocol.timing import LEASE

_NEVER = -(1 << 62)


class Leader:
    """The coordinator that the robot obeys.

    boot: its boot id, -1 as long as no coordinator was heard; epoch, phase, sequence: those of its
    newest Command.  `has_other_clock`: whether the robot's time comes from another coordinator's
    clock.
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
        """Return whether a Command is to be obeyed.

        Once in motion a robot changes its coordinator only for a higher epoch.
        """
        if boot == self.boot:
            return sequence > self.sequence
        if epoch > self.epoch:
            return True
        higher = epoch == self.epoch and boot > self.boot
        return before_motion and (higher or self.is_silent(LEASE, now_ns))

    def hear(
        self, boot: int, sequence: int, epoch: int, phase: int, now_ns: int, said_ns: int
    ) -> bool:
        """Store a Command that is to be obeyed; return whether it is of a new coordinator.

        `said_ns`: when it was sent, on the robot's clock; it may have been under way for long.
        """
        one_clock = boot == self.boot and not self.has_other_clock
        self._heard_ns = min(now_ns, said_ns) if one_clock else now_ns
        another = self.boot not in (-1, boot)
        self.has_other_clock = self.has_other_clock or another
        self.boot, self.sequence = boot, sequence
        self.epoch, self.phase = epoch, phase
        return another

    def is_silent(self, lease_ns: int, now_ns: int) -> bool:
        """Return whether the newest Command was sent longer than a lease ago."""
        return now_ns - self._heard_ns > lease_ns
