"""The robot's command: agent.

Decides: the options of `agent`, and which driver it uses.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Annotated, Final

import typer

from protocol.endpoint import endpoint_of
from protocol.host_clock import host_clock_ns, time_of_day
from protocol.keys import NAME, NAME_IN_WORDS
from protocol.timing import SECOND
from protocol.transport import TransportError
from robot_agent.driver import Driver, Pose
from robot_agent.driver_file import DriverNameError, make_driver
from robot_agent.loop import FixedRateLoop

commands = typer.Typer()

_FARTHEST: Final = 1e6
"""Coordinates of `--at` beyond this [m] are refused."""


def _named(name: str | None) -> str | None:
    """Accept a name that can be one on the wire."""
    if name is not None and not NAME.fullmatch(name):
        raise typer.BadParameter(f"{name[:60]!r} is not {NAME_IN_WORDS}")
    return name


def _reached(endpoint: str) -> str:
    """Accept a well-formed endpoint."""
    try:
        endpoint_of(endpoint, locked=endpoint.startswith("tls/"))
    except TransportError as error:
        raise typer.BadParameter(str(error)) from None
    return endpoint


def _finite(value: float) -> float:
    """Accept a finite number."""
    if not math.isfinite(value):
        raise typer.BadParameter(f"{value} is not a finite number")
    return value


def _near(at: Pose | None) -> Pose | None:
    """Accept a place that is not too far away."""
    if at is not None and not all(abs(number) < _FARTHEST for number in at):
        raise typer.BadParameter(f"{' '.join(f'{number:g}' for number in at)} is not a place")
    return at


def _in_folder(file: Path | None) -> Path | None:
    """Accept a file in an existing folder."""
    if file is not None and not file.parent.is_dir():
        raise typer.BadParameter(f"{file}: there is no folder {file.parent}")
    return file


@commands.command(rich_help_panel="Run")
def agent(
    robot: Annotated[
        str, typer.Argument(callback=_named, help="The robot's name in the scenario.")
    ],
    connect: Annotated[
        str, typer.Option(callback=_reached, help="tcp/HOST:PORT of the coordinator or router.")
    ],
    fleet: Annotated[
        str | None,
        typer.Option(callback=_named, help="Name of the fleet; by default the first one heard."),
    ] = None,
    driver: Annotated[str, typer.Option(help="The driver: MODULE:CLASS or FILE.py:CLASS.")] = (
        "sim.world.body:SimulatedBody"
    ),
    core: Annotated[
        Path | None,
        typer.Option(
            metavar="PROGRAM",
            help="A program that decides in place of the agent's core: firmware in the loop.",
        ),
    ] = None,
    radius: Annotated[
        float, typer.Option(min=0.0, help="Radius of the body, metres; 0: as in the scenario.")
    ] = 0.0,
    max_speed: Annotated[
        float, typer.Option(min=0.0, help="Greatest speed, m/s; 0: as in the scenario.")
    ] = 0.0,
    max_accel: Annotated[
        float,
        typer.Option(
            min=0.0, help="Greatest acceleration, m/s^2; 0: as in the scenario, inf: no limit."
        ),
    ] = 0.0,
    holds: Annotated[
        tuple[int, int, int],
        typer.Option(
            metavar="POINTS STOPS BYTES",
            min=0,
            max=65_535,
            help="The largest plan that the robot can hold; 0: not stated.",
        ),
    ] = (0, 0, 0),
    blackbox: Annotated[
        Path | None,
        typer.Option(callback=_in_folder, help="Write the true poses to this CSV file."),
    ] = None,
    speed: Annotated[
        float,
        typer.Option(
            min=0.01,
            max=1000.0,
            callback=_finite,
            help="Speed of the fleet's clock; 1 is real time, 2 twice as fast.",
        ),
    ] = 1.0,
    wait: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=86_400.0,
            callback=_finite,
            help="Seconds to wait for a link to the coordinator.",
        ),
    ] = 10.0,
    give_up: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=1e6,
            callback=_finite,
            help="End after this many seconds without the coordinator; 0: never.",
        ),
    ] = 0.0,
    rate: Annotated[int, typer.Option(min=20, max=1000, help="Control ticks per second.")] = 100,
    stats: Annotated[
        bool,
        typer.Option(
            "--stats", help="Print how long ticks take: a JSON line per phase, and one at the end."
        ),
    ] = False,
    at: Annotated[
        tuple[float, float, float] | None,
        typer.Option(
            metavar="X Y HEADING",
            callback=_near,
            help="Where the robot stands: x, y in metres, heading in radians.",
        ),
    ] = None,
    keys: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder of the robot's keys; the link is tls/HOST:PORT then."
        ),
    ] = None,
    quiet: Annotated[
        bool, typer.Option("--quiet", help="Print nothing but why the agent ends.")
    ] = False,
) -> None:
    """Run the agent of one robot.

    Without --driver the robot's body is simulated.

    Example: splinefleet agent R1 --connect tcp/127.0.0.1:7447
    """
    from protocol.key_files import read_key_files
    from protocol.zenoh_transport import ZenohTransport
    from robot_agent.program import Program, ProgramError, ProgramService
    from robot_agent.service import RefusedError, Robot, RobotService, Service, run_robot

    files = None if keys is None else read_key_files(keys, "robot", robot)
    if files is not None and (warning := files.warning()):
        typer.echo(warning, err=True)
    body = _body(driver, max_accel, at)
    me = Robot(robot, radius, max_speed, max_accel, holds)

    def clock() -> int:
        return int(host_clock_ns() * speed)

    def sleep(left_ns: int) -> None:
        time.sleep(left_ns / 1e9 / speed)

    serve: Callable[..., Service] = RobotService
    try:
        with ExitStack() as stack:
            stack.callback(body.close)
            if core is not None:
                serve = partial(ProgramService, stack.enter_context(Program(core)))
            transport = ZenohTransport.connect(connect, timeout_s=wait, keys=files)
            code = run_robot(
                me,
                transport,
                body,
                clock=clock,
                sleep=sleep,
                fleet=fleet,
                blackbox=blackbox,
                give_up_ns=round(give_up * SECOND),
                period_ns=SECOND // rate,
                tell=(lambda _: None)
                if quiet
                else partial(_tell, connect, locked=files is not None),
                count=_print_counts if stats else _count_nothing,
                serve=serve,
            )
    except ProgramError as error:
        raise typer.BadParameter(str(error), param_hint="--core") from None
    except RefusedError as error:
        typer.echo(str(error), err=True)
        code = 2
    except OSError as error:
        typer.echo(f"{error.filename or robot}: {error.strerror or error}", err=True)
        code = 2
    raise typer.Exit(code)


def _tell(endpoint: str, text: str, *, locked: bool) -> None:
    """Print a line with the time of day on stderr; commands in it name the endpoint.

    `locked`: whether they need keys, which are not the robot's.
    """
    from robot_agent.words import SOMEWHERE

    reach = f"--connect {endpoint}" + (" --keys ..." if locked else "")
    typer.echo(f"{time_of_day()} {text.replace(SOMEWHERE, reach)}", err=True)


def _print_counts(state: str, loop: FixedRateLoop) -> None:
    """Print what the loop counted, when the phase changes."""
    counts = {
        "state": state,
        "ticks": loop.ticks,
        "overruns": loop.overruns,
        "failures": loop.failures,
        "worst_tick_us": loop.worst_ns // 1000,
        "cpu_s": round(time.process_time(), 3),
    }
    typer.echo(json.dumps(counts))


def _count_nothing(_state: str, _loop: FixedRateLoop) -> None:
    """Print nothing about the loop."""


def _body(driver: str, max_accel: float, at: Pose | None) -> Driver:
    """Create the driver, at its place if that is given."""
    try:
        body = make_driver(driver, max_accel)
    except DriverNameError as error:
        raise typer.BadParameter(str(error), param_hint="--driver") from None
    if at is not None:
        body.place(*at)
    return body
