"""What an operator says to a running fleet: admit.

Decides: options and exit codes.
"""

from __future__ import annotations

import os
import queue
import time
from typing import Annotated, Final

import typer

from coordinator.console import tell
from coordinator.key_option import Keys, given_keys
from protocol import keys as places
from protocol.codec import decode, encode
from protocol.messages import Admit, Command, Message, Plan, Refusal
from protocol.phases import COMMAND_NAMES, FREEZE, GO, OVER

commands = typer.Typer()

_PERIOD_S: Final = 0.2
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
        """Take a Command of the fleet, or what it says to the robot or to who asks for it.

        Once the fleet has frozen the next epoch tells: asked again, it says "already".
        """
        if isinstance(message, Refusal):
            if message.boot == self._boot and not self._frozen:
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


@commands.command()
def admit(
    robot: Annotated[str, typer.Argument(help="The robot that has come back.")],
    connect: Annotated[str, typer.Option(help="tcp/HOST:PORT of the coordinator or router.")],
    fleet: Annotated[str | None, typer.Option(help="Fleet; without it the first heard.")] = None,
    wait: Annotated[
        float, typer.Option(min=0.5, max=600.0, help="Seconds to wait for the fleet to take it in.")
    ] = 20.0,
    keys: Keys = None,
) -> None:
    """Let a restarted robot take part again: the fleet freezes and is planned anew with it.

    Exit code 1 when it cannot be taken in, or the fleet does not begin a new epoch in time.

    Example: splinefleet admit R3 --connect tcp/127.0.0.1:7447
    """
    from protocol.zenoh_transport import ZenohTransport

    heard: queue.SimpleQueue[tuple[str, Message]] = queue.SimpleQueue()
    boot = int.from_bytes(os.urandom(4))

    def hear(key: str, payload: bytes, _sent_ns: int | None) -> None:
        place = places.split(key)
        message = decode(place[1], payload) if place is not None else None
        if place is not None and message is not None:
            heard.put((place[0], message))

    for option, given in (("ROBOT", robot), ("--fleet", fleet)):
        if given is not None and not places.NAME.fullmatch(given):
            what = f"{given[:60]!r} is not {places.NAME_IN_WORDS}"
            raise typer.BadParameter(what, param_hint=option)
    files = given_keys(keys, "operator")
    asking = Asking(robot, boot)
    with ZenohTransport.connect(connect, timeout_s=wait, keys=files) as transport:
        transport.subscribe(places.command(fleet or "*"), hear)
        transport.subscribe(places.plan(fleet or "*", robot), hear)
        deadline, due = time.monotonic() + wait, 0.0
        while (now := time.monotonic()) < deadline:
            try:
                name, message = heard.get(timeout=_PERIOD_S)
            except queue.Empty:
                continue
            if fleet is None and isinstance(message, Command):
                fleet = name
            if name != fleet:
                continue  # another fleet on the same router
            asking.hear(message)
            if asking.answer:
                break
            if now >= due:
                asking.asked()
                transport.put(places.admit(name, robot), encode(Admit(boot)))
                due = now + _PERIOD_S
    if asking.admitted:
        tell(f"{fleet}: {asking.answer}")
        return
    late = f"no new epoch with {robot} within {wait:g} s; is it back, the fleet under way?"
    tell(asking.answer or late, "red")
    raise typer.Exit(1)
