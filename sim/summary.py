"""The summary of a run: what the judge, the log and the coordinator say, in one object.

Decides: when a run has succeeded.  Must not know: processes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import msgspec
from rich.console import Group, RenderableType
from rich.text import Text

from coordinator.plain_table import plain_table
from sim.judge import Verdict

_SINCE: Final = "times in s from the first GO"


class RunSummary(msgspec.Struct):
    """summary.json: the judge's answer and the log's, side by side."""

    scenario: str
    succeeded: bool
    judge: Verdict
    info: dict[str, object]
    files: dict[str, str]


def succeeded(code: int, verdict: Verdict) -> bool:
    """Tell whether everybody arrived, nobody touched, and the coordinator ended well."""
    arrived = all(robot.arrived for robot in verdict.robots)
    return code == 0 and arrived and verdict.collisions == 0


def files_of(folder: Path) -> dict[str, str]:
    """Return where the run's files are."""
    names = {"plan": "plan.json", "log": "run.mcap", "picture": "plan.svg", "png": "plan.png"}
    names |= {f"log {path.stem[4:]}": path.name for path in sorted(folder.glob("run-*.mcap"))}
    return {what: str(folder / name) for what, name in names.items() if (folder / name).exists()}


def render(summary: RunSummary) -> RenderableType:
    """Return the summary for people."""
    columns = ("robot", "arrived s", "tracking error mm", "lateness s", "fault")
    table = plain_table(*columns, title=f"{summary.scenario}, {_SINCE}")
    for robot in summary.judge.robots:
        when = f"{robot.t:.2f}" if robot.arrived and robot.t is not None else "no"
        error = f"{1000.0 * robot.tracking_error:.1f}"
        table.add_row(robot.id, when, error, f"{robot.lateness:.3f}", robot.fault)
    arrived = sum(robot.arrived for robot in summary.judge.robots)
    lines = [
        f"arrived {arrived} of {len(summary.judge.robots)}",
        f"collisions {summary.judge.collisions}",
        f"positions on the wire {summary.info.get('positions_on_wire')}",
    ]
    if summary.judge.least_separation is not None:
        lines.append(f"least separation {summary.judge.least_separation:.4f} m")
    lines += [f"{what} {path}" for what, path in summary.files.items()]
    return Group(table, *(Text(line) for line in lines))


def render_verdict(verdict: Verdict) -> RenderableType:
    """Return the judge's answer for people."""
    columns = ("robot", "arrived", "at s", "tracking error mm", "lateness s", "fault")
    robots = plain_table(*columns, title=_SINCE)
    for robot in verdict.robots:
        robots.add_row(
            robot.id,
            "yes" if robot.arrived else "no",
            "" if robot.t is None else f"{robot.t:.2f}",
            f"{1000.0 * robot.tracking_error:.1f}",
            f"{robot.lateness:.3f}",
            robot.fault,
        )
    pairs = plain_table("pair", "least separation m", "at s")
    for pair in sorted(verdict.pairs, key=lambda pair: pair.separation)[:20]:
        pairs.add_row(f"{pair.a} {pair.b}", f"{pair.separation:.4f}", f"{pair.t:.2f}")
    return Group(robots, pairs, Text(f"collisions {verdict.collisions}"))
