"""The command by which an operator acts on a running fleet: admit.

Decides: its options and exit codes.
"""

from __future__ import annotations

import os
import queue
import time
from typing import Annotated, Final

import typer

from coordinator.base.console import tell
from coordinator.cli.fleet_line import Connect, FleetName, sender
from coordinator.cli.option_checks import named, within
from coordinator.fleet.admit_outcome import Asking
from coordinator.service.key_option import Keys, given_keys
from protocol import keys as places
from protocol.codec import decode, encode
from protocol.messages import Admit, Command, Message

commands = typer.Typer()

_PERIOD_S: Final = 0.2


@commands.command(rich_help_panel="Operate")
def admit(
    robot: Annotated[str, typer.Argument(callback=named, help="The robot to admit.")],
    connect: Connect,
    fleet: FleetName = None,
    patience: Annotated[
        float,
        typer.Option(
            "--patience",
            "--wait",
            callback=within(0.5, 86_400.0),
            help="Seconds to wait for the fleet to admit the robot.",
        ),
    ] = 20.0,
    keys: Keys = None,
) -> None:
    """Let a robot take part again: it gets a course from where it stands.

    Use it for a robot that was restarted, or that was lost and is heard again.  For one that is not
    heard the command says so, and goes on asking: start its program first.

    The exit code is 1 if the robot cannot be admitted, or gets no course within --patience.

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

    files = given_keys(keys, "operator")
    asking = Asking(robot, boot)
    with ZenohTransport.connect(connect, timeout_s=patience, keys=files) as transport:
        transport.subscribe(places.command(fleet or "*"), hear)
        transport.subscribe(places.plan(fleet or "*", robot), hear)
        transport.subscribe(places.orders(fleet or "*", "*"), hear)
        deadline, due = time.monotonic() + patience, 0.0
        while (now := time.monotonic()) < deadline:
            try:
                name, message = heard.get(timeout=_PERIOD_S)
            except queue.Empty:
                continue
            if fleet is None and isinstance(message, Command):
                fleet = name
            if name != fleet:
                continue  # another fleet on the same router
            told = asking.waits_for
            asking.hear(message)
            if asking.answer:
                break
            if asking.waits_for not in (told, ""):
                tell(asking.waits_for)
            if now >= due:
                asking.asked()
                transport.put(places.admit(name, robot), encode(Admit(boot, sender(files))))
                due = now + _PERIOD_S
    if asking.admitted:
        tell(f"{fleet}: {asking.answer}")
        return
    late = f"no course for {robot} within {patience:g} s"
    why = asking.waits_for or "is the robot back and the fleet under way?"
    tell(asking.answer or f"{late}; {why}", "red")
    raise typer.Exit(1)
