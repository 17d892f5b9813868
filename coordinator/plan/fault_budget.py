"""The fault budget: what tau has to cover, and which faults a given tau survives.

Decides: the terms of the sum.  The plan times of any two robots, whether moving, braking or dead,
never differ by more than this sum, and a tau-safe plan keeps robots apart for all differences up to
tau.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from coordinator.plan.document import Limits
from coordinator.scenario.link_times import link_times
from coordinator.scenario.model import Link
from protocol.timing import LATENESS, SECOND, late_share


@dataclass(frozen=True)
class Budget:
    """Shares of tau, all in seconds."""

    lateness: float
    """How far a healthy robot may run behind its plan."""
    clocks: float
    """Sum of the clock errors of two robots."""
    notice: float
    """Time until the coordinator notices a robot's silence."""
    lease: float
    """Time until a robot that no longer hears the coordinator brakes; longer than the period of
    Commands."""
    brake: float
    """Time that the robot with the longest braking time needs to come to rest."""
    travel: float = 0.0
    """Time that a message is under way."""

    @property
    def late(self) -> float:
        """The tau that lateness alone needs [s]."""
        return self.lateness + self.clocks

    @property
    def cut_off(self) -> float:
        """The tau [s] for a robot that stops because it no longer hears a living coordinator."""
        return self.late + self.notice + self.lease + self.brake + 2.0 * self.travel

    @property
    def lost_coordinator(self) -> float:
        """The tau [s] for a lost coordinator: leases run out at most one Command period apart."""
        return self.late + self.lease + self.brake + self.travel

    def survives(self, tau: float) -> list[str]:
        """Return the names of the faults that a tau [s] covers: "late", "stop", "coordinator"."""
        covered = (
            ("late", self.late),
            ("stop", self.cut_off),
            ("coordinator", self.lost_coordinator),
        )
        return [name for name, need in covered if tau >= need - 1e-9]


def budget_for(fleet: Iterable[Limits], link: Link) -> Budget:
    """Return the budget of a fleet, from the timing that its link allows and from its brakes."""
    brake = max(
        (0.0 if one.max_accel is None else one.max_speed / one.max_accel for one in fleet),
        default=0.0,
    )
    times = link_times(link)
    return Budget(
        lateness=LATENESS / SECOND,
        clocks=2 * times.clock_error_ns / SECOND,
        notice=times.report_timeout_ns / SECOND,
        lease=times.lease_ns / SECOND,
        brake=brake,
        travel=link.delay,
    )


def resolve_tau(tau: float | str, budget: Budget) -> float:
    """Return tau in seconds: "auto" is the whole budget, rounded up to milliseconds."""
    if isinstance(tau, str):
        return math.ceil(budget.cut_off * 1000.0 - 1e-9) / 1000.0
    return tau


def share_for_lateness(tau: float) -> float:
    """Return a robot's share of lateness [s] (docs/glossary.md): less when tau is smaller."""
    return late_share(round(tau * SECOND)) / SECOND
