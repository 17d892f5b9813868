"""When an epoch went and froze, and so between which plan times its robots may stand.

Decides: how long robots may still have moved.  Must not know: who they are, phases, messages.
"""

from __future__ import annotations

from coordinator.fleet.phases import GO_LEAD, TASK_GRACE, UNLOGGED
from protocol.timing import SECOND


class EpochTimes:
    """The times of the newest epoch that has a plan; all in ns on the coordinator's clock.

    `settling_ns`: how long after FREEZE even a robot that hears nothing may still move;
    `behind_ns`: how far behind its plan one may have been when it said that it moves.
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
        """Have a plan for an epoch, which has not gone."""
        self.epoch, self.duration_ns, self.has_gone = epoch, duration_ns, False

    def go(self, now_ns: int) -> None:
        """Be sent on the way: the common start is a little later."""
        self.start_ns, self.has_gone = now_ns + GO_LEAD, True

    def freeze(self, now_ns: int) -> None:
        """Be told to freeze."""
        self.frozen_ns = now_ns

    def lose_sight(self, last_ns: int) -> None:
        """Be without a coordinator, which was last sure to be there at `last_ns`."""
        self.frozen_ns = last_ns + UNLOGGED

    @property
    def deadline_ns(self) -> int:
        """Until when everybody has to have arrived."""
        return self.start_ns + self.duration_ns + TASK_GRACE

    @property
    def zero_ns(self) -> int:
        """The plan's time zero for robots as far behind as they may be."""
        return self.start_ns + self.behind_ns

    @property
    def until_ns(self) -> int:
        """When all rest at last, counted so that the robots may be as far behind as they may."""
        return self.frozen_ns + self.settling_ns + self.behind_ns
