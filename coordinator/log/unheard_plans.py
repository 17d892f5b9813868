"""Which plans a passive listener has not heard, and when to ask for them.

All plans of an epoch are sent in a burst, and a busy listener may lose some of them.  A robot's
reports name the epoch whose plan it has, the course that it drives and the newest that it holds.
The listener asks for courses that robots have and that it has not heard.

Decides: which robots' plans are missing, which answers are new, how often to ask.  Must not know:
links, clocks, what a plan contains.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from protocol.messages import Command, Message, Plan, Report

_ASK_AGAIN: Final = 0.5
"""How long to wait for answers, which may be lost, before asking again [s]."""


class _Courses(NamedTuple):
    """Courses of one robot in one epoch."""

    epoch: int
    revisions: frozenset[int]


class UnheardPlans:
    """The courses of the current epoch that were not heard; times are in seconds of any clock.

    `known` is an epoch whose first courses are known without having been heard; 0: there is none.
    """

    def __init__(self, known: int = 0) -> None:
        self._epoch = 0
        self._known = known
        self._held: dict[str, _Courses] = {}
        self._heard: dict[str, _Courses] = {}
        self._asked = -_ASK_AGAIN

    def take(self, message: Message, robot: str) -> None:
        """Take in a message from or to a robot; `robot` is empty for a message to all."""
        if isinstance(message, Command):
            self._epoch = message.epoch
        elif isinstance(message, Report):
            revisions = frozenset((message.revision, message.holds))
            self._held[robot] = _Courses(message.epoch, revisions)
        elif isinstance(message, Plan):
            heard = self._heard_of(robot)
            if message.epoch >= heard.epoch:
                kept = heard.revisions if message.epoch == heard.epoch else frozenset[int]()
                kept = frozenset(one for one in kept if one >= self._oldest(robot, heard.epoch))
                self._heard[robot] = _Courses(message.epoch, kept | {message.revision})

    def is_news(self, message: Message, robot: str) -> bool:
        """Return whether an answer is new: a robot's course that was not heard."""
        if not isinstance(message, Plan):
            return False
        heard = self._heard_of(robot)
        is_known = message.epoch == heard.epoch and message.revision in heard.revisions
        return message.epoch >= heard.epoch and not is_known

    @property
    def robots(self) -> set[str]:
        """The robots of which a course was not heard."""
        return {
            robot
            for robot, held in list(self._held.items())  # another thread may call take() meanwhile
            if held.epoch == self._epoch and self._lacks(held, self._heard_of(robot))
        }

    def _lacks(self, held: _Courses, heard: _Courses) -> bool:
        is_same = held.epoch == heard.epoch
        return held.epoch > heard.epoch or (is_same and not held.revisions <= heard.revisions)

    def _heard_of(self, robot: str) -> _Courses:
        return self._heard.get(robot, _Courses(self._known, frozenset((0,))))

    def _oldest(self, robot: str, epoch: int) -> int:
        """Return the oldest course that still matters: the one that the robot drives."""
        held = self._held.get(robot)
        return min(held.revisions) if held is not None and held.epoch == epoch else 0

    def asks(self, now: float) -> bool:
        """Return whether to ask now; if so, record that the question was asked."""
        if not self.robots or now - self._asked < _ASK_AGAIN:
            return False
        self._asked = now
        return True
