"""When an epoch started and froze, and so between which plan times its robots may stand.

Decides: how long robots may still have moved.  Must not know: which robots, phases, messages.
"""

from __future__ import annotations

from coordinator.fleet.phases import GO_LEAD, TASK_GRACE, UNLOGGED
from protocol.timing import SECOND


class EpochTimes:
    """The times of the newest epoch that has a plan; all in ns on the coordinator's clock.

    `settling_ns`: how long after a FREEZE a robot may still move, even if it hears nothing.
    `behind_ns`: the most that a robot that reports MOVING can have been behind its plan.
    """

    def __init__(
        self,
        epoch: int,
        duration_ns: int,
        settling_ns: int = 2 * SECOND,
        behind_ns: int = SECOND // 2,
    ) -> None:
        self.epoch = epoch
        self.has_gone = False
        self.start_ns = self.frozen_ns = 0
        self.duration_ns = duration_ns
        self.settling_ns, self.behind_ns = settling_ns, behind_ns

    def begin(self, epoch: int, duration_ns: int) -> None:
        """Begin an epoch that has a plan and has not started to drive."""
        self.epoch, self.duration_ns, self.has_gone = epoch, duration_ns, False

    def go(self, now_ns: int) -> None:
        """Record the GO; the common start is GO_LEAD later."""
        self.start_ns, self.has_gone = now_ns + GO_LEAD, True

    def freeze(self, now_ns: int) -> None:
        """Record the FREEZE."""
        self.frozen_ns = now_ns

    def lose_sight(self, last_ns: int) -> None:
        """Record that the fleet lost its coordinator, which was last known alive at `last_ns`."""
        self.frozen_ns = last_ns + UNLOGGED

    @property
    def deadline_ns(self) -> int:
        """When all robots must have arrived."""
        return self.start_ns + self.duration_ns + TASK_GRACE

    @property
    def zero_ns(self) -> int:
        """The plan's time zero, later by as much as a robot may be behind its plan."""
        return self.start_ns + self.behind_ns

    @property
    def until_ns(self) -> int:
        """When all robots rest, later by `behind_ns` so that it can be compared with `zero_ns`."""
        return self.frozen_ns + self.settling_ns + self.behind_ns
