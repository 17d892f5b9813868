"""The command that examines a robot that somebody else wrote: conformance.

Decides: its options, how findings are shown, and its exit codes.
"""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coordinator.base.console import answer_json, answers, tell, tell_now
from coordinator.cli.option_checks import named, not_with, reached
from coordinator.cli.plan_commands import Json
from coordinator.service.key_option import Insecure

if TYPE_CHECKING:
    from coordinator.conformance.examiner import Examiner

commands = typer.Typer()


def _near(at: tuple[float, float, float]) -> tuple[float, float, float]:
    """Accept a place whose numbers are below 1000."""
    if not all(math.isfinite(number) and abs(number) < 1e3 for number in at):
        raise typer.BadParameter(f"{' '.join(f'{number:g}' for number in at)} is not a place")
    return at


@commands.command(rich_help_panel="Inspect")
def conformance(
    listen: Annotated[
        str | None,
        typer.Option(
            callback=reached, help="tcp/HOST:PORT to listen on; by default this machine only."
        ),
    ] = None,
    connect: Annotated[
        str | None,
        typer.Option(callback=not_with("listen", check=reached), help="tcp/HOST:PORT of a router."),
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option(callback=named, help="The robot's name; by default the first that is heard."),
    ] = None,
    fleet: Annotated[str, typer.Option(callback=named, help="Name of the fleet.")] = "conformance",
    at: Annotated[
        tuple[float, float, float],
        typer.Option(
            metavar="X Y HEADING",
            callback=_near,
            help="Where the robot stands: x, y in metres, heading in radians.",
        ),
    ] = (0.0, 0.0, 0.0),
    speed: Annotated[
        float, typer.Option(min=0.02, max=10.0, help="Speed to drive with, m/s.")
    ] = 0.4,
    accel: Annotated[
        float, typer.Option(min=0.02, max=10.0, help="Greatest acceleration, m/s^2.")
    ] = 0.5,
    radius: Annotated[
        float, typer.Option(min=0.1, max=20.0, help="Radius of the circle to drive on, metres.")
    ] = 0.5,
    wait: Annotated[
        float, typer.Option(min=1.0, max=3600.0, help="Seconds to wait for the robot.")
    ] = 60.0,
    restart: Annotated[
        bool,
        typer.Option("--restart", help="Also ask for the robot's program to be started again."),
    ] = False,
    blackbox: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            callback=not_with(
                "restart", why=", because a program that is started again begins another box"
            ),
            help="The robot's black box; also judge its true places.",
        ),
    ] = None,
    insecure: Insecure = False,
    as_json: Json = False,
) -> None:
    """Play coordinator to one robot, and tell which requirements of docs/protocol.md hold.

    The robot drives to the left around a circle, for about two minutes.  It needs a floor of a
    metre more than the circle, and nobody on it.  The exit code is 1 if it does not conform.

    Example: splinefleet conformance --listen tcp/127.0.0.1:7447 --robot R1
    """
    from coordinator.conformance.courses import Pace
    from coordinator.conformance.examiner import Examiner
    from coordinator.conformance.exchanges import EXCHANGES, RESTART
    from coordinator.conformance.track import judge_track
    from coordinator.service.conformance_run import examine, read_box
    from coordinator.service.meeting_place import meeting_place

    place = meeting_place(listen, connect, None, insecure)
    boot = 2 + int.from_bytes(os.urandom(4)) % (2**32 - 8)
    exchanges = (*EXCHANGES, RESTART) if restart else EXCHANGES
    pace = Pace(speed, accel, radius)
    examiner = Examiner(fleet, robot, boot, pace, at, round(wait * 1e9), exchanges)
    with place.open() as transport:
        tell(f"{place}, waits for {robot or 'a robot'} of fleet {fleet}")
        examine(examiner, fleet, transport, tell_now)
    if blackbox is not None:
        judge_track(examiner.exam, read_box(blackbox))
    _show(examiner, as_json)
    if not examiner.conforms:
        raise typer.Exit(1)


def _show(examiner: Examiner, as_json: bool) -> None:
    """Write the findings, one line for each requirement and one for each thing seen."""
    found, name = examiner.findings(), examiner.stage.robot
    if as_json:
        rows = [
            {
                "id": one.number,
                "text": one.requirement.text,
                "section": one.requirement.section,
                "verdict": one.verdict,
                "seen": list(one.seen),
            }
            for one in found
        ]
        answer_json({"robot": name, "conforms": examiner.conforms, "requirements": rows})
        return
    for one in found:
        style = "red" if one.verdict == "fails" else ""
        line = f"{one.verdict:<10} {one.number:<9} {one.requirement.text}"
        answers.print(line, style=style, markup=False)
        for seen in one.seen:
            answers.print(f"{'':<20} {seen}", style=style, markup=False)
        if one.seen:
            page = f"{'':<20} see docs/protocol.md, {one.requirement.section}"
            answers.print(page, markup=False)
    counts = [sum(one.verdict == verdict for one in found) for verdict in ("holds", "fails")]
    word = "conforms" if examiner.conforms else "does not conform"
    left = len(found) - sum(counts)
    answers.print(
        f"{name or 'the robot'} {word}: {counts[0]} requirements hold, {counts[1]} fail, "
        f"{left} were not tried"
    )
