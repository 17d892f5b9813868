"""Which plans a passive listener has not heard, and when to ask for them.

All plans of an epoch are sent in a burst, and a busy listener may lose some of them.  A robot's
reports name the epoch whose plan it has, and its Pace messages the revision of its times.  The
listener asks for plans and times that robots have and that it has not heard.

Decides: which robots' plans are missing, which answers are new, how often to ask.  Must not know:
links, clocks, what a plan contains.
"""

from __future__ import annotations

from typing import Final

from protocol.messages import Command, Message, NewTimes, Pace, Plan, Report

_ASK_AGAIN: Final = 0.5
"""How long to wait for answers, which may be lost, before asking again [s]."""


class UnheardPlans:
    """The plans of the current epoch that were not heard; times are in seconds of any clock.

    `known` is an epoch whose plans are known without having been heard; 0 if there is none.
    """

    def __init__(self, known: int = 0) -> None:
        self._epoch = 0
        self._known = (known, 0)
        self._held: dict[str, tuple[int, int]] = {}
        self._heard: dict[str, tuple[int, int]] = {}
        self._asked = -_ASK_AGAIN

    def take(self, message: Message, robot: str) -> None:
        """Take in a message from or to a robot; `robot` is empty for a message to all."""
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
        """Return whether an answer is new: a robot's plan or newest times that were not heard."""
        epoch, revision = self._heard.get(robot, self._known)
        if isinstance(message, Plan):
            return message.epoch > epoch
        return isinstance(message, NewTimes) and (
            message.epoch == epoch and message.revision > revision
        )

    @property
    def robots(self) -> set[str]:
        """The robots whose plan or newest times were not heard."""
        return {
            robot
            for robot, held in list(self._held.items())  # another thread may call take() meanwhile
            if held[0] == self._epoch and self._heard.get(robot, self._known) < held
        }

    def asks(self, now: float) -> bool:
        """Return whether to ask now; if so, record that the question was asked."""
        if not self.robots or now - self._asked < _ASK_AGAIN:
            return False
        self._asked = now
        return True
