"""What tau has to cover so that robots on time never slow down before each other.

A robot's authority ends where another one may still be.  It is renewed in time if tau is at least
the sum of these shares (design section 3).  A smaller tau, down to LEAST_TAU, is as safe; robots
then slow down where they follow each other closely.

Decides: the terms of the sum, and the least tau.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import astuple, dataclass
from typing import Final

from coordinator.plan.document import Limits
from coordinator.scenario.link_times import link_times
from coordinator.scenario.model import Link
from protocol.timing import COMMAND_PERIOD, LATENESS, REPORT_PERIOD, SECOND

LEAST_TAU: Final = 0.2
"""With a smaller tau [s] robots that follow each other in a ring could wait for ever: it has to
exceed the rounding of reports and staircases, and the shortest move of a robot."""

BRAKING_SHARE: Final = 0.8
"""Plans brake with this share of the deceleration that robots have."""

SURVIVED: Final = ("late", "stop", "coordinator")
"""The faults that a proven plan survives: robots that are late, that stop, that hear nothing."""

_TICKS: Final = 0.05
"""Ticks [s] of both sides: until a Report is sent, a Command is obeyed, and a robot reacts."""


@dataclass(frozen=True)
class Shares:
    """The shares of tau, all in seconds."""

    lateness: float
    """How far behind its plan a robot may be that keeps to it as well as it can."""
    report: float
    """Age of the newest Report when the next one is heard."""
    command: float
    """Age of the newest Command when the next one is heard, when some are lost."""
    braking: float
    """Plan time that a robot needs to come to rest, at most."""
    ticks: float

    @property
    def total(self) -> float:
        """The least tau [s] with which robots on time never slow down."""
        return math.fsum(astuple(self))

    @property
    def headroom(self) -> float:
        """How far [s] ahead of the plan's time robots are let: until they stop without Commands."""
        return self.command + COMMAND_PERIOD / SECOND + self.braking + self.ticks


def shares_of(fleet: Iterable[Limits], link: Link) -> Shares:
    """Return the shares of a fleet, from the times that its link allows and from its brakes."""
    times = link_times(link)
    return Shares(
        lateness=LATENESS / SECOND,
        report=REPORT_PERIOD * (1 + times.lost) / SECOND + link.delay,
        command=COMMAND_PERIOD * (1 + max(times.lost, 1)) / SECOND + link.delay,
        braking=max((_braking(one) for one in fleet), default=0.0),
        ticks=_TICKS,
    )


def _braking(robot: Limits) -> float:
    """Return the least T [s] in which every course gets on by the braking distance v^2 / 2a.

    Where the plan brakes at BRAKING_SHARE of a, it gets on the least.
    """
    if robot.max_accel is None:
        return 0.0
    share = BRAKING_SHARE
    return robot.max_speed / robot.max_accel * (1.0 - math.sqrt(1.0 - share)) / share


def resolve_tau(tau: float | str, shares: Shares) -> float:
    """Return tau in seconds: "auto" is the sum of the shares, rounded up to milliseconds."""
    if isinstance(tau, str):
        return math.ceil(shares.total * 1000.0 - 1e-9) / 1000.0
    return tau


def survived(tau: float) -> list[str]:
    """Return the names of the faults that a plan with this tau [s] survives, if it is proven."""
    return list(SURVIVED) if tau >= LEAST_TAU else []
