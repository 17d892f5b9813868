"""What becomes of an operator's asking that a robot be admitted.

Decides: from what a fleet says, whether the robot was taken in, and what there is to tell.  Must
not know: how to listen, how long to wait (cli/operator_commands.py).
"""

from __future__ import annotations

from typing import Final

from protocol.messages import Command, Message, Plan, Refusal
from protocol.phases import COMMAND_NAMES, FREEZE, GO, OVER

_MOST_WITHOUT: Final = 2
"""Who cannot be planned for must not have the fleet freeze more often."""


class Asking:
    """What becomes of asking for a robot to be admitted, by what its fleet says meanwhile.

    It is taken in when, after a freeze, the fleet's epoch is one that it has a plan of.
    `answer` is what there is to tell then, or once it is known not to be; `admitted` says which.
    """

    def __init__(self, robot: str, boot: int) -> None:
        self.answer = ""
        self.admitted = False
        self._robot, self._boot = robot, boot
        self._frozen = self._asked = False
        self._without = 0
        self._epoch = -1

    def asked(self) -> None:
        """Take note that the robot was asked for."""
        self._asked = True

    def hear(self, message: Message) -> None:
        """Take a Command of the fleet, or what it says to the robot or to who asks for it."""
        if isinstance(message, Refusal):
            if message.boot == self._boot:
                self.answer = message.reason
        elif isinstance(message, Plan):
            self._epoch = max(self._epoch, message.epoch)
        elif isinstance(message, Command):
            self._hear_command(message)

    def _hear_command(self, command: Command) -> None:
        self._frozen |= self._asked and command.phase == FREEZE
        if command.phase == OVER:
            self.answer = f"the fleet is over, without {self._robot}"
        elif self._frozen and command.phase != FREEZE and command.epoch == self._epoch:
            self.admitted = True
            self.answer = f"epoch {command.epoch}, {COMMAND_NAMES[command.phase]}"
        elif self._frozen and command.phase == GO:
            self._frozen = False  # That freeze may have been for another robot.
            self._without += 1
            if self._without == _MOST_WITHOUT:
                without = f"goes on without {self._robot}, its coordinator says why"
                self.answer = f"epoch {command.epoch} {without}"
