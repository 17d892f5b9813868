"""What the coordinator knows of one robot: who it is, what it said last, and when.

Decides: when a robot counts as armed, lost or at rest.  Must not know: the other robots.
"""

from __future__ import annotations

from dataclasses import dataclass

from protocol.messages import Hello, Report
from protocol.phases import ARMED, BRAKING, DONE, FROZEN, IDLE, MOVING
from protocol.timing import REPORT_TIMEOUT


@dataclass
class Member:
    """One robot of the fleet, as heard; boot None means that it has not been accepted yet."""

    id: str
    radius: float
    speed: float
    """The speed that its plan needs [m/s]."""
    plan: bytes
    boot: int | None = None
    heard_ns: int = 0
    sequence: int = -1
    epoch: int = 0
    phase: int = IDLE
    fault: int = 0
    rest_s: float | None = None
    plan_sent_ns: int | None = None
    done_ns: int | None = None
    lost: bool = False

    def accept(self, hello: Hello, now_ns: int) -> None:
        """Take a robot in, forgetting what an earlier process of that name said."""
        self.heard_ns = now_ns
        if hello.boot == self.boot:
            return
        self.boot, self.sequence, self.epoch, self.phase, self.fault = hello.boot, -1, 0, IDLE, 0
        self.rest_s = self.plan_sent_ns = self.done_ns = None

    def hear(self, report: Report, now_ns: int) -> bool:
        """Take a report in; False when it is not this robot's newest."""
        if report.boot != self.boot or report.sequence <= self.sequence:
            return False
        self.heard_ns, self.sequence, self.lost = now_ns, report.sequence, False
        self.epoch, self.phase, self.fault = report.epoch, report.phase, report.fault
        if report.s_m is not None and report.phase == FROZEN:
            self.rest_s = report.s_m
        if report.phase == DONE and self.done_ns is None:
            self.done_ns = now_ns
        return True

    def is_silent(self, now_ns: int) -> bool:
        """Tell whether nothing has been heard for too long."""
        return now_ns - self.heard_ns > REPORT_TIMEOUT

    def is_armed(self, epoch: int, now_ns: int) -> bool:
        """Tell whether the robot stands ready with this epoch's plan."""
        return self.phase == ARMED and self.epoch == epoch and not self.is_silent(now_ns)

    def has_stopped(self) -> bool:
        """Tell whether the robot has given up its time-table."""
        return self.phase in (BRAKING, FROZEN) or (self.phase != MOVING and self.fault != 0)

    def is_at_rest(self) -> bool:
        """Tell whether it is known where the robot stands for good."""
        return self.phase == DONE or (self.phase == FROZEN and self.rest_s is not None)
