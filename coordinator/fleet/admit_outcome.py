"""The outcome of an operator's request to admit a robot.

Decides: from a fleet's messages, whether the robot was admitted, and what to report.  Must not
know: how to listen, how long to wait (cli/operator_commands.py).
"""

from __future__ import annotations

from typing import Final

from protocol.messages import WAITING, Command, Message, OrderState, Plan, Refusal
from protocol.phases import COMMAND_NAMES, FREEZE, GO, OVER, STOP
from protocol.timing import MILLISECOND

NOT_BACK: Final = "has not come back"
"""What is said of a robot that may still come: who asks goes on asking."""

_MOST_WITHOUT: Final = 2
"""The request ends after this many epochs without the robot, so that the fleet can drive on."""


class Asking:
    """A request to admit a robot, with its outcome as the fleet's messages show it.

    The robot is admitted when, after a freeze, the fleet is in an epoch of which the robot has a
    Plan, or when it is sent a further course without a freeze, one that begins after it was asked:
    an earlier one is only said again.  `answer` is empty until the outcome is known, and then says
    it in words.  `admitted` is true if the outcome is that the robot was admitted.  As long as
    there is no outcome, `waits_for` says what keeps it from that.
    """

    def __init__(self, robot: str, boot: int) -> None:
        self.answer = self.waits_for = ""
        self.admitted = False
        self._robot, self._boot = robot, boot
        self._frozen = self._asked = False
        self._without = 0
        self._epoch = -1
        self._asked_ms = 0
        """The plan time of the last Command before it was asked, in a fleet that drove."""

    def asked(self) -> None:
        """Record that the request was sent."""
        self._asked = True

    def hear(self, message: Message) -> None:
        """Take in the fleet's Command, a Plan for the robot, its orders, or a Refusal."""
        if isinstance(message, Refusal):
            if message.boot == self._boot and NOT_BACK in message.reason:
                self.waits_for = message.reason
            elif message.boot == self._boot:
                self.answer = message.reason
        elif isinstance(message, Plan) and message.robot == self._robot:
            self._epoch = max(self._epoch, message.epoch)
            is_new = message.revision > 0 and message.begin_ms >= self._asked_ms
            if self._asked and is_new:
                self.admitted, self.answer = True, f"{self._robot} goes on from where it stands"
        elif isinstance(message, Command):
            self._hear_command(message)
        elif isinstance(message, OrderState) and message.robot == self._robot:
            is_kept = self._asked and message.state == WAITING and message.reason
            self.waits_for = f"{message.id} waits: {message.reason}" if is_kept else ""

    def _hear_command(self, command: Command) -> None:
        self._frozen |= self._asked and command.phase == FREEZE
        if not self._asked and command.phase == GO:
            self._asked_ms = (command.said_ns - command.start_ns) // MILLISECOND
        stopped = f"the fleet is stopped; {self._robot} gets a course when it goes on"
        if self._asked and command.phase == STOP:
            self.waits_for = stopped
        elif self.waits_for == stopped:
            self.waits_for = ""
        if command.phase == OVER:
            self.answer = f"the fleet has ended without {self._robot}"
        elif self._frozen and command.phase != FREEZE and command.epoch == self._epoch:
            self.admitted = True
            self.answer = f"epoch {command.epoch}, {COMMAND_NAMES[command.phase]}"
        elif self._frozen and command.phase == GO:
            self._frozen = False  # That freeze may have been for another robot.
            self._without += 1
            if self._without == _MOST_WITHOUT:
                without = f"goes on without {self._robot}; the coordinator's output says why"
                self.answer = f"epoch {command.epoch} {without}"
