"""The VDA 5050 commands: their import, and the part of export that writes orders.

Decides: their options, files and exit codes.  Heavy modules are imported when a command needs them.
"""

from __future__ import annotations

from collections import Counter
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer

from coordinator.base.console import tell, write_file
from coordinator.base.errors import InputError
from coordinator.cli.import_commands import imports, write_scenario
from coordinator.cli.option_checks import within, writable
from coordinator.cli.plan_commands import make_folder, newest_plan
from coordinator.exchange.vda5050 import Version

if TYPE_CHECKING:
    from coordinator.exchange.vda5050_reading import Ordered

commands = typer.Typer()
commands.add_typer(imports, name="import", rich_help_panel="Plan")


@imports.command("vda5050")
def import_vda5050(
    orders: Annotated[list[Path], typer.Argument(help="JSON files, each with one order.")],
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", help="FILE.toml or FILE.json", callback=writable(".toml", ".json")
        ),
    ],
    like: Annotated[
        Path | None,
        typer.Option(
            help="Scenario from which to take the floor, and the limits of robots of the same name."
        ),
    ] = None,
    radius: Annotated[
        float,
        typer.Option(callback=within(1e-3, 1e3), help="Radius in metres of robots not in --like."),
    ] = 0.3,
    max_speed: Annotated[
        float,
        typer.Option(
            callback=within(1e-3, 999.0), help="Speed limit in m/s if an order states none."
        ),
    ] = 0.5,
    rounding: Annotated[
        float,
        typer.Option(
            callback=within(0.0, 1.0),
            help="Greatest distance in metres by which corners may be cut.",
        ),
    ] = 0.02,
) -> None:
    """Make a scenario whose robots drive the paths of VDA 5050 orders.

    Example: splinefleet import vda5050 orders/*.json --like hall.toml -o theirs.toml
    """
    from coordinator.exchange.vda5050_reading import Assumed, scenario_of
    from coordinator.scenario_files.scenario_reader import default_name, read_scenario

    asked = None if like is None else read_scenario(like)
    found = _read_all(orders)
    made = scenario_of(
        found, default_name(str(output)), Assumed(radius, max_speed, rounding), asked
    )
    for robot in made.robots:
        if robot.path is not None and robot.path.rounding > 0.0:
            tell(
                f"{robot.id}: the path has corners; they are cut by up to {robot.path.rounding:g} m"
            )
    write_scenario(made, output, "Paths from VDA 5050 orders")


def _read_all(files: list[Path]) -> list[Ordered]:
    """Read all orders; raise InputError with the problems of all of them."""
    from coordinator.exchange.vda5050_reading import read_order

    problems: list[str] = []
    found = []
    for file in files:
        try:
            order = read_order(file.read_bytes(), str(file), problems)
        except OSError as error:
            problems.append(f"{file}: {error.strerror}")
            continue
        if order is not None:
            found.append((file, order))
    names = Counter(order.robot for _, order in found)
    problems += dict.fromkeys(
        f"{file}: serialNumber: {order.robot} has {names[order.robot]} orders; give each robot one"
        for file, order in found
        if names[order.robot] > 1
    )
    if problems:
        raise InputError(problems)
    return [order for _, order in found]


def write_orders(source: Path, folder: Path, version: Version) -> None:
    """Write orders for a plan file, or for the newest plan in a log, into a folder."""
    from coordinator.exchange.vda5050_orders import orders_of

    now = datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    orders = orders_of(newest_plan(source, "to order"), now, version)
    make_folder(folder)
    for robot, order in orders.items():
        text = msgspec.json.format(msgspec.json.encode(order), indent=1)
        write_file(folder / f"{robot}.json", text + b"\n")
    tell(f"wrote {len(orders)} orders into {folder}")
