"""The command line: gathers the three packages' commands and turns errors into exit codes."""

from __future__ import annotations

import _thread
import gc
import signal
import sys
import threading
from types import FrameType
from typing import Final

import typer

import coordinator.commands
import coordinator.info_commands
import coordinator.keys_commands
import coordinator.log_commands
import coordinator.operator_commands
import coordinator.vda5050_commands
import coordinator.view_commands
import robot_agent.commands
import sim.commands
import sim.replay_commands
from coordinator.console import tell
from coordinator.errors import InputError, LogError, PlanError
from coordinator.quick_options import read_quickly
from coordinator.usage import usage_line
from protocol.transport import NoAnswerError, TransportError

_ENDING: Final = (signal.SIGINT, signal.SIGTERM)

_SOON_S: Final = 0.02

app = typer.Typer(
    name="splinefleet",
    help="Coordinates robots that never tell each other where they are.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
for package in (
    coordinator.commands,
    coordinator.info_commands,
    coordinator.keys_commands,
    coordinator.log_commands,
    coordinator.operator_commands,
    coordinator.vda5050_commands,
    coordinator.view_commands,
    robot_agent.commands,
    sim.commands,
    sim.replay_commands,
):
    app.add_typer(package.commands)


def main() -> None:
    """Run the command line; exit codes as in the contract."""
    # What plans are made of has no cycles: this saves seconds at 1,000 robots.
    gc.set_threshold(100_000, 50, 100)
    read_quickly()
    _listen()
    sys.unraisablehook = _missed
    try:
        code = app(standalone_mode=False, prog_name="splinefleet")
    except (PlanError, LogError, NoAnswerError) as error:
        tell(str(error), "red")
        code = 1
    except (InputError, TransportError) as error:
        tell(str(error), "red")
        code = 2
    except typer.Abort:
        code = 130
    except typer.TyperException as error:
        if line := usage_line(error):
            tell(line, "red")
        code = 2
    except KeyboardInterrupt:
        code = 130
    # What is left ends with the process: this saves a search through all of it for cycles.
    gc.freeze()
    sys.exit(code if isinstance(code, int) else 0)


def _listen() -> None:
    """From now on a request to end interrupts the program."""
    for number in _ENDING:
        signal.signal(number, _interrupt)


def _missed(missed: sys.UnraisableHookArgs) -> None:
    """Interrupt again when the first interrupt fell where Python swallows it, as in an import."""
    if missed.exc_type is not KeyboardInterrupt:
        sys.__unraisablehook__(missed)
        return
    _listen()
    threading.Timer(_SOON_S, _thread.interrupt_main).start()


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    """Treat a request to end as Ctrl-C, once: closing the log is not to be cut short."""
    for number in _ENDING:
        signal.signal(number, _ignore)
    raise KeyboardInterrupt


def _ignore(_number: int, _frame: FrameType | None) -> None:
    """Do nothing; SIG_IGN would make Python complain about a signal that is already pending."""


if __name__ == "__main__":
    main()
