"""The commands by which an operator takes robots into a running fleet and out of it.

Decides: their options and exit codes.
"""

from __future__ import annotations

from typing import Annotated

import typer

from coordinator.base.console import tell
from coordinator.cli.fleet_line import Connect, FleetLine, FleetName, Patience, fleet_line
from coordinator.cli.option_checks import if_given, named, numbers_of, place_of, within
from coordinator.service.key_option import Keys
from protocol import keys as places
from protocol.messages import CANCELLED, ORDER_DONE, REFUSED, Join, Leave, OrderState
from protocol.phases import STOP

commands = typer.Typer()

Robot = Annotated[str, typer.Argument(metavar="ROBOT", callback=named, help="The robot.")]


@commands.command(rich_help_panel="Operate")
def join(
    robot: Robot,
    at: Annotated[
        str,
        typer.Option(callback=place_of(3), help="X,Y,HEADING in m and rad: where it stands."),
    ],
    connect: Connect,
    fleet: FleetName = None,
    radius: Annotated[float, typer.Option(callback=within(0.001, 100.0), help="Metres.")] = 0.2,
    max_speed: Annotated[float, typer.Option(callback=within(0.001, 100.0), help="m/s.")] = 0.5,
    max_accel: Annotated[
        float | None,
        typer.Option(
            callback=if_given(within(0.001, 1000.0)),
            help="m/s^2; by default it reaches its speed within 1 s.",
        ),
    ] = None,
    min_turn_radius: Annotated[
        float, typer.Option(callback=within(0.0, 1000.0), help="Metres.")
    ] = 0.0,
    max_turn_rate: Annotated[
        float, typer.Option(callback=within(0.001, 1000.0), help="rad/s, on the spot.")
    ] = 2.0,
    patience: Patience = 60.0,
    keys: Keys = None,
) -> None:
    """Take a robot into a running fleet; start its program while this command waits for it.

    Its place has to be clear of everybody's course.  The exit code is 1 if it cannot join, or has
    not joined within --patience.

    Example: splinefleet join R9 --at 1,2,0 --connect tcp/127.0.0.1:7447
    """
    x, y, heading = numbers_of(at, 3)
    accel = 0.0 if max_accel is None else max_accel
    with fleet_line(connect, fleet, patience, keys) as line:
        limits = (radius, max_speed, accel, min_turn_radius, max_turn_rate)
        _ask(line, f"join-{robot}", Join(line.boot, robot, (x, y, heading), *limits))


@commands.command(rich_help_panel="Operate")
def leave(
    robot: Robot,
    connect: Connect,
    fleet: FleetName = None,
    patience: Patience = 20.0,
    keys: Keys = None,
) -> None:
    """Take a robot that rests, or is lost, out of a running fleet: its place is free then.

    Carry it away first: others drive where it stood at once.  If it is not heard, it may still be
    on the floor; the command says so, and the coordinator calls if it is heard again.

    The exit code is 1 if it is under way, or is no robot of the fleet.

    Example: splinefleet leave R3 --connect tcp/127.0.0.1:7447
    """
    with fleet_line(connect, fleet, patience, keys) as line:
        _ask(line, f"leave-{robot}", Leave(line.boot, robot))


def _ask(line: FleetLine, answer: str, message: Join | Leave) -> None:
    """Send a message until the order that answers it is done or refused."""
    state: OrderState | None = None

    def say(known: str) -> None:
        line.put(places.roster(known), message)

    for heard in line.messages(say):
        if isinstance(heard, OrderState) and heard.id == answer:
            state = heard
            if state.state in (ORDER_DONE, CANCELLED, REFUSED):
                break
    if state is not None and state.state == ORDER_DONE:
        done = "has joined" if isinstance(message, Join) else "has left"
        tell(f"{message.robot} {done} {line.fleet}")
        if state.reason:
            tell(state.reason, "yellow")
        return
    if state is None:
        raise line.unanswered()
    late = "is its program running, and newer than when it was last in the fleet?"
    if line.phase == STOP:
        late = "the fleet is stopped: it joins when the fleet goes on (`splinefleet resume`)"
    why = "was cancelled" if state.state == CANCELLED else f"has not joined yet; {late}"
    tell(state.reason or f"{message.robot} {why}", "red")
    raise typer.Exit(1)
