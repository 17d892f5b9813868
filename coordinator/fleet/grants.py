"""The authority of a fleet's robots, as Commands state it.

Decides: which authorities a Command states, when it cannot name all that have less than the others.
Must not know: phases, when a Command is sent.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from coordinator.plan.staircases import Staircases
from coordinator.schedule.authority import Authority
from protocol.messages import MOST_HELD, Report
from protocol.timing import LATE_STEP_MS

LATELY_MS: Final = 3_000
"""For so long after a robot was held, others are to blame if it is late."""


class Stated(NamedTuple):
    """What a Command states: the plan time [ms] that nobody may pass, and who has less."""

    authority_ms: int | None = None
    held: tuple[tuple[str, int], ...] = ()


class Grants:
    """The authorities of the robots of one plan; `robots` in the order of its staircases.

    `headroom_ms`: how far ahead of the plan's time a robot may drive when nobody holds it.  That is
    enough to drive on without hearing a Command until the lease ends, and then to brake.
    """

    def __init__(self, staircases: Staircases, robots: Sequence[str], headroom_ms: int) -> None:
        self._rule = Authority(staircases, len(robots))
        self._robots = list(robots)
        self._index = {name: number for number, name in enumerate(robots)}
        self._headroom_ms = headroom_ms
        self._held_ms = np.full(len(robots), -2 * LATELY_MS)
        """The last plan time at which each robot had less than the headroom."""

    def hear(self, robot: str, report: Report) -> None:
        """Take in how far a robot says that it has driven."""
        if report.stamp_ms is not None and robot in self._index:
            progress = report.stamp_ms - LATE_STEP_MS * report.late
            self._rule.know(self._index[robot], progress)

    def grant(self, now_ms: int) -> Stated:
        """Grant what is safe at a plan time [ms] and return what a Command states of it.

        If more than MOST_HELD robots have less than the headroom, everybody else gets no more than
        the least of those that cannot be named; a robot keeps what it was granted before.
        """
        rule, most = self._rule, now_ms + self._headroom_ms
        rule.grant(now_ms, self._headroom_ms)
        less = np.flatnonzero(rule.granted < most)
        self._held_ms[less] = now_ms
        less = less[np.argsort(rule.granted[less], kind="stable")]
        if len(less) > MOST_HELD:
            most, less = int(rule.granted[less[MOST_HELD]]), less[:MOST_HELD]
        granted = rule.granted[less].tolist()
        names = [self._robots[index] for index in less.tolist()]
        return Stated(most, tuple(zip(names, granted, strict=True)))

    def was_held(self, robot: str, now_ms: int) -> bool:
        """Return whether a robot was held shortly before a plan time [ms]."""
        return bool(now_ms - self._held_ms[self._index[robot]] < LATELY_MS)
