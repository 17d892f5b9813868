"""Finds who was in a fleet when: robots join it and leave it while it drives.

Decides: from when until when a robot counts.  Must not know: files, plans.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from coordinator.fleet.task import JOIN, LEAVE
from protocol.messages import (
    CANCELLED,
    ORDER_DONE,
    REFUSED,
    WAITING,
    Join,
    Message,
    OrderState,
    Plan,
)


@dataclass
class Stay:
    """A time in the fleet [ns]; None: from its beginning, to its end.

    `join`: what the operator said of the robot; None for one of the scenario.
    """

    since_ns: int | None = None
    until_ns: int | None = None
    join: Join | None = None


class Attendance:
    """The stays of a fleet's robots, in the order of their times; `robots`: the scenario's."""

    def __init__(self, robots: Iterable[str]) -> None:
        self.stays: dict[str, list[Stay]] = {robot: [Stay()] for robot in robots}
        self._asked: dict[str, Join] = {}

    def is_in(self, robot: str) -> bool:
        """Return whether a robot is in the fleet now."""
        return robot in self.stays and self.stays[robot][-1].until_ns is None

    def take(self, message: Message | None, now_ns: int) -> None:
        """Take in a message of the fleet; those that say nothing of joining and leaving too."""
        if isinstance(message, Join):
            if not self.is_in(message.robot):
                self._asked.setdefault(message.robot, message)
        elif isinstance(message, Plan):
            self._begin(message.robot, now_ns)
        elif isinstance(message, OrderState):
            if message.id.startswith(JOIN):
                self._take_join(message.id.removeprefix(JOIN), message.state, now_ns)
            elif message.id.startswith(LEAVE) and message.state == ORDER_DONE:
                self._end(message.id.removeprefix(LEAVE), now_ns)

    def _take_join(self, robot: str, state: int, now_ns: int) -> None:
        if state in (CANCELLED, REFUSED):
            self._asked.pop(robot, None)
        elif state != WAITING:
            self._begin(robot, now_ns)
        if state == CANCELLED and self.is_in(robot):
            self.stays[robot].pop()  # It never joined.
            if not self.stays[robot]:
                del self.stays[robot]

    def _end(self, robot: str, now_ns: int) -> None:
        if self.is_in(robot):
            self.stays[robot][-1].until_ns = now_ns

    def _begin(self, robot: str, now_ns: int) -> None:
        join = self._asked.pop(robot, None)
        if join is not None and not self.is_in(robot):
            self.stays.setdefault(robot, []).append(Stay(now_ns, None, join))
