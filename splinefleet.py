"""The command line: gathers the packages' commands and turns errors into exit codes.

Everything else is imported when it is needed: a request to end may come while that happens.
"""

from __future__ import annotations

import functools
import gc
import sys
from importlib import import_module
from typing import TYPE_CHECKING, Final

from coordinator.base.interrupts import (
    INTERRUPTED,
    is_interrupt,
    leave_at_once,
    listen,
    stop_listening,
    was_asked,
)

if TYPE_CHECKING:
    import typer

    app: typer.Typer

_COMMANDS: Final = (
    "coordinator.cli.plan_commands",
    "coordinator.cli.vda5050_commands",
    "robot_agent.commands",
    "coordinator.cli.order_commands",
    "coordinator.cli.block_commands",
    "coordinator.cli.roster_commands",
    "coordinator.cli.operator_commands",
    "sim.cli.run_commands",
    "coordinator.cli.info_commands",
    "coordinator.cli.conformance_command",
    "coordinator.cli.view_commands",
    "sim.cli.replay_commands",
    "coordinator.cli.log_commands",
    "coordinator.cli.keys_commands",
)
"""In the order in which the help shows them, and their panels."""


def __getattr__(name: str) -> object:
    """Return `app`, all the commands."""
    if name != "app":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return _gathered()


def main() -> None:
    """Run the command line; exit codes as in the contract."""
    leave_at_once()
    # What plans are made of has no cycles: this saves seconds at 1,000 robots.
    gc.set_threshold(100_000, 50, 100)
    commands = _gathered()
    try:
        listen()
        code = _run(commands)
        stop_listening()
    except BaseException as error:
        stop_listening()
        if not was_asked():
            raise
        code = INTERRUPTED
        if not is_interrupt(error):
            sys.stderr.write(f"while ending: {type(error).__name__}: {error}\n")
    # What is left ends with the process: this saves a search through all of it for cycles.
    gc.freeze()
    sys.exit(code)


@functools.cache
def _gathered() -> typer.Typer:
    """Return all the commands."""
    import typer

    from coordinator.cli.checked_command import CommandGroup, check_all

    gathered = typer.Typer(
        cls=CommandGroup,
        name="splinefleet",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
    )
    version: bool = typer.Option(
        False, "--version", is_eager=True, callback=_tell_version, help="Print it and exit."
    )

    @gathered.callback()
    def of_all(_version: bool = version) -> None:
        """Coordinates robots that never tell each other where they are."""

    for module in _COMMANDS:
        gathered.add_typer(import_module(module).commands)
    check_all(gathered)
    return gathered


def _tell_version(is_asked: bool) -> None:
    """Print the version and end the command, if it was asked for."""
    import typer

    from coordinator.base.console import answers
    from coordinator.log.versions import WRITTEN_BY, ours

    if is_asked:
        answers.print(f"{WRITTEN_BY} {ours()[WRITTEN_BY]}", markup=False)
        raise typer.Exit


def _run(commands: typer.Typer) -> int:
    """Run the command that the command line names and return its exit code."""
    import typer

    from coordinator.base.console import tell
    from coordinator.base.errors import ClusterError, InputError, LogError, PlanError
    from coordinator.cli.quick_options import read_quickly
    from coordinator.cli.usage import usage_lines
    from protocol.transport import NoAnswerError, TransportError

    read_quickly()
    try:
        code = commands(standalone_mode=False, prog_name="splinefleet")
    except (PlanError, ClusterError, LogError, NoAnswerError) as error:
        tell(str(error), "red")
        code = 1
    except (InputError, TransportError) as error:
        tell(str(error), "red")
        code = 2
    except typer.Abort:
        code = INTERRUPTED
    except typer.TyperException as error:
        for line in usage_lines(error):
            tell(line, "red")
        code = 2
    if was_asked():
        return INTERRUPTED
    return code if isinstance(code, int) else 0


if __name__ == "__main__":
    main()
