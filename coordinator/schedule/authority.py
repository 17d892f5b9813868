"""How far each robot is known to have driven, and how far it may drive.

A robot's progress is the plan time that has it where it is; its authority is the plan time that it
does not pass.  Authorities are granted such that no robot comes to where another one may still be,
however late robots or messages are (design section 3).

Decides: what is known of progress, and which authorities follow.  Must not know: messages, phases.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from coordinator.plan.staircases import Staircases
from coordinator.schedule.authority_kernels import Integers, Table, breaks, grant, holder

EVER: Final = 2**40
"""The progress [ms] of a robot that is at its goal: it has passed all plan times."""

SLACK_MS: Final = 2_000
"""A robot is granted no more than this beyond its known progress, apart from the headroom: one that
is late or silent is told little ahead of what it is known to have driven."""


class Authority:
    """Progress and authority of the robots of one plan, in ms of plan time; both only grow.

    `told`: the most that a robot may have been told.  It is what is granted, unless another
    coordinator granted more before.  Robots are numbered as in the staircases.
    """

    def __init__(self, staircases: Staircases, robots: int) -> None:
        self._table = _table_of(staircases, robots)
        self.progress: Integers = np.zeros(robots, np.int64)
        self.granted: Integers = np.zeros(robots, np.int64)
        self.told: Integers = np.zeros(robots, np.int64)

    def renew(self, staircases: Staircases) -> bool:
        """Grant by other staircases from now on, unless one forbids what was told already.

        Returns whether that is so.
        """
        table = _table_of(staircases, len(self.told))
        if breaks(table, self.progress, self.told):
            return False
        self._table = table
        return True

    def know(self, robot: int, progress_ms: int) -> None:
        """Take in that a robot has driven up to a plan time; never more than it was told."""
        known = min(progress_ms, int(self.told[robot]))
        self.progress[robot] = max(int(self.progress[robot]), known)

    def arrive(self, robot: int) -> None:
        """Take in that a robot is at its goal, where its plan has it from then on."""
        self.progress[robot] = self.told[robot] = EVER

    def set_out(self, robot: int, begin_ms: int) -> None:
        """Take in that a robot at its goal has a course from there that begins at a plan time."""
        self.progress[robot] = self.told[robot] = self.granted[robot] = begin_ms

    def wanted(self, now_ms: int, headroom_ms: int) -> Integers:
        """Return how far (n,) [ms] robots would be let at a plan time if nobody were in the way."""
        wanted: Integers = np.minimum(now_ms, self.progress + SLACK_MS) + headroom_ms
        return wanted

    def grant(self, now_ms: int, headroom_ms: int, most_ms: int) -> None:
        """Grant what is safe, up to the headroom beyond a plan time, and at most `most_ms`."""
        wanted = np.minimum(self.wanted(now_ms, headroom_ms), most_ms)
        grant(self._table, self.progress, wanted, self.granted)
        np.maximum(self.told, self.granted, out=self.told)

    def holder_of(self, robot: int) -> int | None:
        """Return the robot that leaves a robot the least authority; None if nobody limits it."""
        found = int(holder(self._table, self.progress, robot))
        return None if found < 0 else found

    def may_have_told(self, until_ms: int) -> None:
        """Take in that any robot may have been told that it may drive up to a plan time."""
        np.maximum(self.told, until_ms, out=self.told)


def _table_of(staircases: Staircases, robots: int) -> Table:
    return Table(
        staircases.tau_ms,
        np.searchsorted(staircases.behind, np.arange(robots + 1)),
        staircases.ahead,
        staircases.first,
        staircases.at,
        staircases.need,
        staircases.first[:-1].copy(),
    )
