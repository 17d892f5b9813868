"""The command that sums up a log or a plan: info.

Decides: its options, and where it looks for black boxes.  Heavy modules are imported when needed.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coordinator.base.console import answer_json, answers, tell
from coordinator.base.errors import InputError
from coordinator.cli.plan_commands import Json, Source, given_log

if TYPE_CHECKING:
    from coordinator.findings.true_course import TrueCourse
    from coordinator.log.records import Log

commands = typer.Typer()


@commands.command(rich_help_panel="Inspect")
def info(
    source: Source,
    blackbox: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Folder of the black boxes ROBOT.csv; by default blackbox/ beside the log, "
            "then the log's own folder.",
            exists=True,
            file_okay=False,
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Sum up a log (epochs, waits, faults, latencies, traffic) or a plan (who waits and why).

    With the robots' black boxes it also shows when robots truly arrived, how near they came to
    each other, and how far they were from their plans.

    Example: splinefleet info runs/demo/run.mcap --json
    """
    from coordinator.findings.info import summarise
    from coordinator.findings.info_table import render
    from coordinator.findings.plan_facts import summarise_plan
    from coordinator.log.log_file import readable_logs_before
    from coordinator.plan.plan_file import read

    if source.suffix == ".json":
        summary = summarise_plan(read(source))
    else:
        log = given_log(source)
        boxes = _boxes_of(log, source, blackbox)
        summary = summarise(log, boxes, readable_logs_before(log))
    if as_json:
        answer_json(summary)
    else:
        answers.print(render(summary))


def _boxes_of(log: Log, source: Path, asked: Path | None) -> dict[str, TrueCourse]:
    """Return a log's black boxes by robot.

    If one of them cannot be read, raise InputError if the user named the folder; otherwise print a
    message and return none.
    """
    from coordinator.findings.info import courses_of
    from coordinator.log.log_file import readable_logs_before
    from coordinator.log.log_folder import box_folders

    try:
        folders = [asked] if asked else box_folders(source)
        return courses_of(log, folders, readable_logs_before(log))
    except InputError as error:
        if asked:
            raise
        tell(f"continues without black boxes: {error}")
        return {}
