"""The import commands: scenarios from files of other tools; VDA 5050 has a module of its own.

Decides: their options and files.  Heavy modules are imported when a command needs them.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coordinator.base.console import tell, write_file
from coordinator.cli.checked_command import CommandGroup
from coordinator.cli.option_checks import within, writable

if TYPE_CHECKING:
    from coordinator.scenario.model import Scenario

_BESIDE_TRACK = 0.05
"""The default margin, in cells and in metres: the less of the two counts."""


class _ByFile(CommandGroup):
    """Takes `import MAP SCEN` for `import movingai MAP SCEN`."""

    def parse_args(self, ctx: typer.Context, args: list[str]) -> list[str]:  # type: ignore[override]
        named = bool(args) and args[0] in self.commands
        if not named and any(arg.lower().endswith((".map", ".scen")) for arg in args):
            args = ["movingai", *args]
        return super().parse_args(ctx, args)


imports = typer.Typer(
    cls=_ByFile, no_args_is_help=True, help="Make a scenario from files of other tools."
)


def _as_in_scenario(param: typer.CallbackParam, value: float | None) -> float | None:
    """Accept a number that a scenario may state under the option's name."""
    from coordinator.scenario.checks import ROBOT_QUANTITIES, SCENARIO_QUANTITIES

    allowed = {**ROBOT_QUANTITIES, **SCENARIO_QUANTITIES}[str(param.name)]
    if value is not None and (problem := allowed.complaint(value)):
        raise typer.BadParameter(problem)
    return value


@imports.command()
def movingai(
    map_file: Annotated[Path, typer.Argument(metavar="MAP", help="MovingAI map, FILE.map.")],
    scen_file: Annotated[Path, typer.Argument(metavar="SCEN", help="Its scenario, FILE.scen.")],
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", help="FILE.toml or FILE.json", callback=writable(".toml", ".json")
        ),
    ],
    robots: Annotated[
        int | None, typer.Option(min=1, help="Take this many agents; by default all.")
    ] = None,
    radius: Annotated[
        float, typer.Option(callback=within(1e-3, 0.5), help="Radius of the robots in cells.")
    ] = 0.35,
    cell: Annotated[
        float, typer.Option(callback=within(0.01, 8000.0), help="Width of a cell in metres.")
    ] = 1.0,
    max_speed: Annotated[
        float, typer.Option(callback=_as_in_scenario, help="Speed limit in m/s.")
    ] = 1.0,
    max_accel: Annotated[
        float | None,
        typer.Option(
            callback=_as_in_scenario,
            help="Limit of acceleration in m/s^2, or inf; by default --max-speed within 1 s.",
        ),
    ] = None,
    tau: Annotated[
        float | None,
        typer.Option(callback=_as_in_scenario, help="tau in seconds; by default auto."),
    ] = None,
    margin: Annotated[
        float | None,
        typer.Option(
            callback=_as_in_scenario,
            help="Tracking error allowed between two robots, in metres; by default 0.05, or a "
            "twentieth of a cell if that is less.",
        ),
    ] = None,
) -> None:
    """Make a scenario from a map and the agents of a MovingAI benchmark.

    `movingai` may be left out.

    Example: splinefleet import room-32-32-4.map room-32-32-4-random-1.scen --robots 50 -o room.toml
    """
    from coordinator.exchange.movingai import Bodies, scenario_of
    from coordinator.scenario_files.scenario_reader import default_name

    bodies = Bodies(
        radius,
        max_speed,
        max_speed if max_accel is None else max_accel,
        tau,
        _BESIDE_TRACK * min(1.0, cell) if margin is None else margin,
    )
    made = scenario_of(map_file, scen_file, robots, cell, bodies, default_name(str(output)))
    write_scenario(made, output, f"Agents of {scen_file.name}")


def write_scenario(made: Scenario, output: Path, comment: str) -> None:
    """Write a scenario, and tell that it was written."""
    from coordinator.scenario_files.scenario_reader import scenario_to_json
    from coordinator.scenario_files.toml_writer import scenario_to_toml

    if output.suffix.lower() == ".json":
        write_file(output, scenario_to_json(made))
    else:
        write_file(output, scenario_to_toml(made, comment))
    tell(f"wrote {output}")
