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
from protocol.messages import Admit, Command, Refusal
from protocol.phases import COMMAND_NAMES, FREEZE

commands = typer.Typer()

_PERIOD_S: Final = 0.2


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

    heard: queue.SimpleQueue[tuple[str, Command | Refusal]] = queue.SimpleQueue()
    boot = int.from_bytes(os.urandom(4))

    def hear(key: str, payload: bytes, _sent_ns: int | None) -> None:
        place = places.split(key)
        message = decode(place[1], payload) if place is not None else None
        if place is not None and isinstance(message, Command | Refusal):
            heard.put((place[0], message))

    if not places.NAME.fullmatch(robot):
        raise typer.BadParameter(f"{robot[:60]!r} is no robot's name", param_hint="ROBOT")
    files = given_keys(keys, "operator")
    with ZenohTransport.connect(connect, timeout_s=wait, keys=files) as transport:
        transport.subscribe(places.command(fleet or "*"), hear)
        transport.subscribe(places.plan(fleet or "*", robot), hear)
        deadline = time.monotonic() + wait
        frozen, said = False, 0.0
        while (now := time.monotonic()) < deadline:
            try:
                name, command = heard.get(timeout=_PERIOD_S)
            except queue.Empty:
                continue
            fleet = fleet or name
            if name != fleet:
                continue  # another fleet on the same router
            if isinstance(command, Refusal):
                if command.boot != boot:
                    continue  # to a robot of this name
                tell(command.reason, "red")
                raise typer.Exit(1)
            if not frozen and now - said > _PERIOD_S:
                transport.put(places.admit(name, robot), encode(Admit(boot)))
                said = now
            frozen |= said > 0.0 and command.phase == FREEZE
            if frozen and command.phase != FREEZE:
                tell(f"{name}: epoch {command.epoch}, {COMMAND_NAMES[command.phase]}")
                return
    tell(f"no new epoch with {robot} within {wait:g} s; is it back, the fleet under way?", "red")
    raise typer.Exit(1)
