"""The commands by which an operator closes places of a running fleet's floor and opens them.

Decides: their options and exit codes.
"""

from __future__ import annotations

import os
from typing import Annotated

import typer

from coordinator.base.console import answer_json, answers, tell
from coordinator.cli.fleet_line import Connect, FleetName, Patience, fleet_line
from coordinator.cli.order_commands import name_of, numbers_of
from coordinator.cli.plan_commands import Json
from coordinator.service.key_option import Keys
from protocol import keys as places
from protocol.messages import Block, Unblock

commands = typer.Typer()


@commands.command(
    rich_help_panel="Operate",
    context_settings={"allow_extra_args": True, "ignore_unknown_options": True},
)
def block(
    context: typer.Context,
    polygon: Annotated[str, typer.Option(help="X,Y X,Y X,Y ...: the corners in m, three or more.")],
    connect: Connect,
    fleet: FleetName = None,
    block_id: Annotated[
        str | None, typer.Option("--id", help="The same id again is the same place.")
    ] = None,
    patience: Patience = 20.0,
    keys: Keys = None,
) -> None:
    """Close a place for all robots that have not passed it; a robot inside is told to leave.

    The exit code is 1 if no coordinator answers within --patience, or if the id is that of another
    place.

    Example: splinefleet block --polygon 2,2 4,2 4,4 2,4 --connect tcp/127.0.0.1:7447
    """
    corners = [numbers_of(one, (2,), "--polygon") for one in (*polygon.split(), *context.args)]
    ring = tuple((x, y) for x, y in corners)
    from coordinator.scenario.checks import corners_fault

    if problem := corners_fault(ring):
        raise typer.BadParameter(problem, param_hint="--polygon")
    name = name_of(block_id, "--id") if block_id is not None else f"block-{os.urandom(3).hex()}"
    with fleet_line(connect, fleet, patience, keys) as line:
        asked = Block(line.boot, name, ring)
        closed = line.ask_until(
            places.block, asked, lambda one: isinstance(one, Block) and one.id == name
        )
    if not isinstance(closed, Block):
        raise line.unanswered()
    if closed.polygon != ring:
        tell(f"{name} is another place, which is closed already; use another --id", "red")
        raise typer.Exit(1)
    answers.print(f"{name} is closed", markup=False)


@commands.command(rich_help_panel="Operate")
def unblock(
    block_id: Annotated[str, typer.Argument(metavar="ID", help="The id of the place.")],
    connect: Connect,
    fleet: FleetName = None,
    patience: Patience = 20.0,
    keys: Keys = None,
) -> None:
    """Open a place again.

    The exit code is 1 if no place of this id is closed, or if no coordinator answers within
    --patience.

    Example: splinefleet unblock block-1 --connect tcp/127.0.0.1:7447
    """
    name = name_of(block_id, "ID")
    with fleet_line(connect, fleet, patience, keys) as line:
        closed = line.blocks()
        line.must_be_heard()
        if name not in closed:
            known = f"; closed are {', '.join(closed)}" if closed else ""
            tell(f"no place {name} is closed{known}", "red")
            raise typer.Exit(1)
        asked = Unblock(line.boot, name)
        opened = line.ask_until(
            places.block, asked, lambda one: isinstance(one, Unblock) and one.id == name
        )
    if opened is None:
        raise line.unanswered()
    tell(f"{name} is open")


@commands.command(rich_help_panel="Operate")
def blocks(
    connect: Connect,
    fleet: FleetName = None,
    patience: Patience = 5.0,
    keys: Keys = None,
    as_json: Json = False,
) -> None:
    """List the places of a running fleet's floor that are closed.

    Example: splinefleet blocks --connect tcp/127.0.0.1:7447
    """
    with fleet_line(connect, fleet, patience, keys) as line:
        found = line.blocks()
        line.must_be_heard()
    if as_json:
        answer_json([{"id": one.id, "polygon": one.polygon} for one in found.values()])
        return
    for one in found.values():
        corners = " ".join(f"{x:g},{y:g}" for x, y in one.polygon)
        answers.print(f"{one.id} {corners}", markup=False)
    if not found:
        tell("no place is closed")
