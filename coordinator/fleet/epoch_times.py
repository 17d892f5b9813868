"""When the newest epoch that has a plan started.

Decides: when plan time begins.  Must not know: which robots, phases, messages.
"""

from __future__ import annotations

import msgspec

from coordinator.fleet.phases import GO_LEAD
from protocol.timing import MILLISECOND, SECOND


class PlainTimes(msgspec.Struct, frozen=True):
    """An EpochTimes as plain data."""

    epoch: int
    settling_ns: int
    has_gone: bool
    start_ns: int


class EpochTimes:
    """The times of the newest epoch that has a plan; all in ns on the coordinator's clock.

    `settling_ns`: how long after a FREEZE a robot may still move, even if it hears nothing.
    """

    def __init__(self, epoch: int, settling_ns: int = 2 * SECOND) -> None:
        self.epoch = epoch
        self.has_gone = False
        self.start_ns = 0
        self.settling_ns = settling_ns

    def plain(self) -> PlainTimes:
        """Return the times as plain data."""
        return PlainTimes(self.epoch, self.settling_ns, self.has_gone, self.start_ns)

    @classmethod
    def of_plain(cls, told: PlainTimes) -> EpochTimes:
        """Return the times."""
        made = cls(told.epoch, told.settling_ns)
        made.has_gone, made.start_ns = told.has_gone, told.start_ns
        return made

    def begin(self, epoch: int) -> None:
        """Begin an epoch that has a plan and has not started to drive."""
        self.epoch, self.has_gone = epoch, False

    def plan_ms(self, now_ns: int) -> int:
        """Return the plan time [ms]; 0 before the epoch has started to drive."""
        return (now_ns - self.start_ns) // MILLISECOND if self.has_gone else 0

    def put_off(self, later_ns: int) -> None:
        """Put off plan time, because the fleet stood still for so long."""
        if self.has_gone:
            self.start_ns += later_ns

    def go(self, now_ns: int) -> None:
        """Record the GO; the common start is GO_LEAD later."""
        self.start_ns, self.has_gone = now_ns + GO_LEAD, True
