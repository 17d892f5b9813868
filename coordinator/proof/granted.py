"""Checks that what a coordinator sent was safe, from its messages alone.

Plans have to be the proven ones; a robot with the number of another would drive on its authority.

At every Command, need_ij(A_j) < P_i has to hold for all ordered pairs (design section 3).  A_j is
the authority of the robot behind, P_i the progress that the robot ahead has reported.  Within tau
of each other robots need nothing.

Decides: whether Plans are as proven and Commands keep to the invariant.  Must not know: the rule
that grants authority, logs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import msgspec
import numpy as np

from coordinator.plan.wire import PackedPlan
from protocol.codec import encode
from protocol.messages import Command, Plan, Report
from protocol.phases import DONE, GO
from protocol.timing import LATE_STEP_MS

_NEAR: Final = 1_000
"""A robot is held when it is let drive for less than this [ms]."""


class Granted:
    """What one epoch's Commands granted and its Reports told [ms of plan time]; both only grow.

    `plan` has its staircases.
    """

    def __init__(self, plan: PackedPlan) -> None:
        assert plan.staircases is not None
        self.commands = 0
        self.failures: list[str] = []
        self._staircases = plan.staircases
        self._messages = plan.messages
        self._robots = robots = [robot.id for robot in plan.document.robots]
        self._index: Mapping[str, int] = {name: index for index, name in enumerate(robots)}
        self._granted = np.zeros(len(robots))
        self._passed = np.zeros(len(robots))
        self._at_goal = np.zeros(len(robots), bool)

    def take_plan(self, robot: str, plan: Plan) -> None:
        """Check that a robot was sent the course that was proven, with its own number."""
        if encode(msgspec.structs.replace(plan, boot=0)) == self._messages.get(robot):
            return
        name = self._robots[plan.number] if plan.number < len(self._robots) else "nobody"
        whose = "" if name == robot else f"; its number {plan.number} is that of {name}"
        self.failures.append(
            f"the Plan of epoch {plan.epoch} that {robot} was sent is not the one proven{whose}"
        )

    def take_report(self, robot: str, report: Report) -> None:
        """Take in a robot's progress; it counts no further than what the robot was granted.

        A robot at its goal has passed all plan times, and no Command lets it drive on.
        """
        index = self._index.get(robot)
        if index is not None and report.phase == DONE:
            self._passed[index], self._at_goal[index] = np.inf, True
        elif index is not None and report.stamp_ms is not None:
            passed = report.stamp_ms - LATE_STEP_MS * report.late
            passed = min(passed, int(self._granted[index]))
            self._passed[index] = max(self._passed[index], passed)

    def take_command(self, command: Command) -> None:
        """Take in what a Command grants, and check the invariant."""
        if command.phase != GO:
            return
        self.commands += 1
        for number in range(command.first, min(command.last + 1, len(self._robots))):
            stated = command.authority_of(number)
            if not self._at_goal[number]:
                self._granted[number] = max(self._granted[number], stated or 0)
        stairs = self._staircases
        ahead, behind = self._passed[stairs.ahead], self._granted[stairs.behind]
        for pair in np.flatnonzero(behind - stairs.tau_ms >= ahead).tolist():
            need = stairs.need_at(pair, float(behind[pair]))
            if need >= ahead[pair]:
                self.failures.append(self._text(command, pair, need))

    def names(self, numbers: Sequence[int]) -> list[str]:
        """Return the robots with these numbers."""
        return [self._robots[number] for number in numbers if number < len(self._robots)]

    def holder(self, robot: str) -> str | None:
        """Return a robot that another one has to wait for; None when nobody holds it.

        Beyond what it was granted, it needs the robot returned to have passed more than it has.  A
        robot that has _NEAR or more of that left to drive is not held yet.
        """
        stairs, index = self._staircases, self._index[robot]
        if self._granted[index] - self._passed[index] >= _NEAR:
            return None
        next_ms = float(self._granted[index]) + 1.0
        for pair in np.flatnonzero(stairs.behind == index).tolist():
            ahead = int(stairs.ahead[pair])
            if stairs.need_at(pair, next_ms) >= self._passed[ahead]:
                return self._robots[ahead]
        return None

    def _text(self, command: Command, pair: int, need: float) -> str:
        stairs = self._staircases
        who, other = self._robots[stairs.behind[pair]], self._robots[stairs.ahead[pair]]
        granted, passed = self._granted[stairs.behind[pair]], self._passed[stairs.ahead[pair]]
        return (
            f"Command {command.sequence} of epoch {command.epoch} grants {who} plan time "
            f"{granted / 1000.0:.3f} s; {other} must have passed {need / 1000.0:.3f} s and has "
            f"reported {passed / 1000.0:.3f} s"
        )
