"""Which plans a passive listener has not heard, and when to ask for them.

All plans of an epoch are sent in a burst, and a busy listener may lose some of them.  A robot's
reports name the epoch whose plan it has.  The listener asks for plans that robots have and that it
has not heard.

Decides: which robots' plans are missing, which answers are new, how often to ask.  Must not know:
links, clocks, what a plan contains.
"""

from __future__ import annotations

from typing import Final

from protocol.messages import Command, Message, Plan, Report

_ASK_AGAIN: Final = 0.5
"""How long to wait for answers, which may be lost, before asking again [s]."""


class UnheardPlans:
    """The plans of the current epoch that were not heard; times are in seconds of any clock.

    `known` is an epoch whose plans are known without having been heard; 0 if there is none.
    """

    def __init__(self, known: int = 0) -> None:
        self._epoch = 0
        self._known = known
        self._held: dict[str, int] = {}
        self._heard: dict[str, int] = {}
        self._asked = -_ASK_AGAIN

    def take(self, message: Message, robot: str) -> None:
        """Take in a message from or to a robot; `robot` is empty for a message to all."""
        if isinstance(message, Command):
            self._epoch = message.epoch
        elif isinstance(message, Report):
            self._held[robot] = message.epoch
        elif isinstance(message, Plan):
            self._heard[robot] = message.epoch

    def is_news(self, message: Message, robot: str) -> bool:
        """Return whether an answer is new: a robot's plan that was not heard."""
        return isinstance(message, Plan) and message.epoch > self._heard.get(robot, self._known)

    @property
    def robots(self) -> set[str]:
        """The robots whose plan was not heard."""
        return {
            robot
            for robot, held in list(self._held.items())  # another thread may call take() meanwhile
            if held == self._epoch and self._heard.get(robot, self._known) < held
        }

    def asks(self, now: float) -> bool:
        """Return whether to ask now; if so, record that the question was asked."""
        if not self.robots or now - self._asked < _ASK_AGAIN:
            return False
        self._asked = now
        return True
