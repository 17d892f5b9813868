"""The last steps of a run: black boxes into the log, pictures, the judge's verdict, summary.json.

Decides: what the folder holds in the end, and the exit code.
"""

from __future__ import annotations

from pathlib import Path
from typing import cast

import msgspec
import typer

from coordinator.base.console import answer_json, answers, tell, write_file
from coordinator.findings.info import courses_of, summarise
from coordinator.log.log_file import read_log, readable_logs_before
from coordinator.plan.plan_file import read
from coordinator.view.figure import draw_plan
from sim.judging.judge import judge
from sim.processes.boxed_log import newest_log, put_boxes
from sim.processes.summary import RunSummary, files_of, render, succeeded


def conclude(folder: Path, name: str, code: int, as_json: bool) -> None:
    """Judge a run whose coordinator ended with `code`, and print the result.

    The folder has plan.json, the logs and blackbox/.  Exits with code 1 unless the run succeeded.
    """
    put_boxes(folder)
    for picture in ("plan.svg", "plan.png"):
        draw_plan(read(folder / "plan.json"), folder / picture)
    verdict, log = judge(folder), read_log(newest_log(folder))
    before = readable_logs_before(log)
    told = summarise(log, courses_of(log, [folder / "blackbox"], before), before)
    summary = RunSummary(
        scenario=name,
        succeeded=succeeded(code, verdict),
        freezes=told["freezes"],
        held=told["held"],
        orders=cast("list[dict[str, object]]", told["orders"]),
        judge=verdict,
        info=told,
        files=files_of(folder),
    )
    write_file(folder / "summary.json", msgspec.json.format(msgspec.json.encode(summary), indent=1))
    if as_json:
        answer_json(summary)
    else:
        answers.print(render(summary))
    if not summary.succeeded:
        tell(f"the run did not succeed; see {folder}", "red")
        raise typer.Exit(1)
