"""Which plans somebody who only listens has not heard, and when to ask for them.

A plan is said in a burst, and a busy listener loses part of it.  A robot's reports name the epoch
whose plan it holds, and the revision of its times: what was not heard of these is asked for.

Decides: whose plan is missing, which answers are news, how often to ask.  Must not know: links,
clocks, what a plan says.
"""

from __future__ import annotations

from typing import Final

from protocol.messages import Command, Message, NewTimes, Pace, Plan, Report

_ASK_AGAIN: Final = 0.5
"""Answers may be lost: a question is asked again after so many seconds."""


class UnheardPlans:
    """The plans of the epoch under way that were not heard; times in seconds of any clock.

    known: an epoch whose plans are known without having been heard; 0: none.
    """

    def __init__(self, known: int = 0) -> None:
        self._epoch = 0
        self._known = (known, 0)
        self._held: dict[str, tuple[int, int]] = {}
        self._heard: dict[str, tuple[int, int]] = {}
        self._asked = -_ASK_AGAIN

    def take(self, message: Message, robot: str) -> None:
        """Take in what was said by a robot or to it; to all, when `robot` is empty."""
        if isinstance(message, Command):
            self._epoch = message.epoch
        elif isinstance(message, Report):
            epoch, revision = self._held.get(robot, (0, 0))
            self._held[robot] = (message.epoch, revision if epoch == message.epoch else 0)
        elif isinstance(message, Pace):
            self._held[robot] = (message.epoch, message.revision)
        elif isinstance(message, Plan) and self._heard.get(robot, self._known)[0] != message.epoch:
            self._heard[robot] = (message.epoch, 0)
        elif isinstance(message, NewTimes) and self.is_news(message, robot):
            self._heard[robot] = (message.epoch, message.revision)

    def is_news(self, message: Message, robot: str) -> bool:
        """Tell whether an answer is what was not heard: a robot's plan, or its newest times."""
        epoch, revision = self._heard.get(robot, self._known)
        if isinstance(message, Plan):
            return message.epoch > epoch
        return isinstance(message, NewTimes) and (
            message.epoch == epoch and message.revision > revision
        )

    @property
    def robots(self) -> set[str]:
        """The robots whose plan, or newest times, was not heard."""
        return {
            robot
            for robot, held in list(self._held.items())  # another thread may hear meanwhile
            if held[0] == self._epoch and self._heard.get(robot, self._known) < held
        }

    def asks(self, now: float) -> bool:
        """Tell whether to ask now; the question then counts as asked."""
        if not self.robots or now - self._asked < _ASK_AGAIN:
            return False
        self._asked = now
        return True
