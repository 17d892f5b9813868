"""A command line that cannot be run is told in one line: option, value, what is allowed."""

from typing import Annotated, Literal

import pytest
import typer

from coordinator.cli.option_checks import within
from coordinator.cli.usage import usage_line

commands = typer.Typer()


@commands.command()
def fly(
    place: Annotated[str, typer.Argument(help="Where to.")],
    height: Annotated[float, typer.Option("-h", "--height", min=0.0, max=9.0)] = 1.0,
    times: Annotated[int, typer.Option()] = 1,
    how: Annotated[Literal["high", "low"], typer.Option()] = "high",
    far: Annotated[float, typer.Option(callback=within(0.5, 7.0))] = 1.0,
    over: Annotated[tuple[float, float] | None, typer.Option(metavar="X Y")] = None,
) -> None:
    """Fly."""


@commands.command()
def land() -> None:
    """Land."""


SHAPE = "it is --over X Y, separated by spaces"
USAGE = "usage: splinefleet fly [OPTIONS] PLACE"


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("fly", f"PLACE is missing; {USAGE}"),
        ("fly a --height low", "--height: 'low' is not a number"),
        ("fly a -h -1", "--height: -1 is less than 0, the least allowed"),
        ("fly a --height 10", "--height: 10 is more than 9, the most allowed"),
        ("fly a --height nan", "--height: 'nan' is not a number"),
        ("fly a --times 1.5", "--times: '1.5' is not a whole number"),
        ("fly a --how deep", "--how: 'deep' is not one of 'high', 'low'"),
        ("fly a --far 8", "--far: 8.0 is not a finite number from 0.5 to 7"),
        ("fly a --over 1 east", f"--over: 'east' is not a number; {SHAPE}"),
        ("fly a --over 1,2 -h 2", f"--over: '1,2' is not a number; {SHAPE}"),
        ("fly a --over 1", "Option '--over' requires 2 arguments"),
        ("fly a b", f"Got unexpected extra argument(s) (b); {USAGE}"),
        ("fly a --depth 3", f"No such option: --depth; {USAGE}"),
        ("dive", "No such command 'dive'; usage: splinefleet [OPTIONS] COMMAND [ARGS]..."),
    ],
)
def test_what_is_wrong_with_a_command_line_is_told_in_one_line(line, told):
    with pytest.raises(typer.TyperException) as caught:
        commands(line.split(), standalone_mode=False, prog_name="splinefleet")
    assert usage_line(caught.value) == told


def test_after_the_help_nothing_is_left_to_tell():
    imports = typer.Typer(no_args_is_help=True)
    imports.command()(fly)
    imports.command()(land)
    with pytest.raises(typer.TyperException) as caught:
        imports([], standalone_mode=False, prog_name="splinefleet")
    assert usage_line(caught.value) == ""


def test_a_check_inside_a_command_names_its_option_too():
    error = typer.BadParameter("R% is no name", param_hint="ROBOT")
    assert usage_line(error) == "ROBOT: R% is no name"
    assert usage_line(typer.BadParameter("of no option")) == "of no option"
