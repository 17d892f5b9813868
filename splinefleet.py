"""The command line: gathers the three packages' commands and turns errors into exit codes."""

from __future__ import annotations

import signal
import sys
from types import FrameType

import click
import robot_agent.commands
import typer

import coordinator.commands
import sim.commands
from coordinator.console import tell
from coordinator.errors import InputError, PlanError
from protocol.transport import TransportError

app = typer.Typer(
    name="splinefleet",
    help="Coordinates robots that never tell each other where they are.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
for package in (coordinator.commands, robot_agent.commands, sim.commands):
    app.add_typer(package.commands)


def main() -> None:
    """Run the command line; exit codes as in the contract."""
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        code = app(standalone_mode=False)
    except (InputError, TransportError) as error:
        tell(str(error), "red")
        code = 2
    except PlanError as error:
        tell(str(error), "red")
        code = 1
    except click.exceptions.Abort:
        code = 130
    except click.ClickException as error:
        tell(error.format_message(), "red")
        code = 2
    except KeyboardInterrupt:
        code = 130
    sys.exit(code if isinstance(code, int) else 0)


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    """Treat a request to end as Ctrl-C: everything is shut down and the log closed."""
    raise KeyboardInterrupt


if __name__ == "__main__":
    main()
