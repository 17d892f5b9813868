"""The summary of a run: the results of the judge, the log and the coordinator in one object.

Decides: when a run has succeeded.  Must not know: processes.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Final

import msgspec
from rich.console import Group, RenderableType
from rich.text import Text

from coordinator.base.text_table import plain_table
from sim.judging.judge import RobotVerdict, Verdict

_SINCE: Final = "times in s from the first GO"
_ERRORS: Final = ("tracking error mm", "lateness s", "clock error ms")


class RunSummary(msgspec.Struct):
    """The content of summary.json: the judge's verdict and the summary of the log.

    `freezes`, `held` and `orders` are those of `info`: how often the fleet froze, who was held by
    whom, and what became of each order.
    """

    scenario: str
    succeeded: bool
    freezes: object
    held: object
    orders: list[dict[str, object]]
    judge: Verdict
    info: dict[str, object]
    files: dict[str, str]


def succeeded(code: int, verdict: Verdict) -> bool:
    """Return whether all robots arrived, none touched anything, and the exit code is 0."""
    return code == 0 and verdict.is_good()


def files_of(folder: Path) -> dict[str, str]:
    """Return where the run's files are."""
    names = {"plan": "plan.json", "log": "run.mcap", "picture": "plan.svg", "png": "plan.png"}
    names |= {f"log {path.stem[4:]}": path.name for path in sorted(folder.glob("run-*.mcap"))}
    return {what: str(folder / name) for what, name in names.items() if (folder / name).exists()}


def render(summary: RunSummary) -> RenderableType:
    """Return the summary for people."""
    columns = ("robot", "arrived s", *_ERRORS, "fault")
    table = plain_table(*columns, title=f"{summary.scenario}, {_SINCE}")
    for robot in summary.judge.robots:
        when = f"{robot.t:.2f}" if robot.arrived and robot.t is not None else "no"
        table.add_row(robot.id, when, *_errors(robot), _remarks(robot))
    arrived = sum(robot.arrived for robot in summary.judge.robots)
    lines = [
        f"arrived {arrived} of {len(summary.judge.robots)}",
        *_collisions(summary.judge),
        f"messages with positions {summary.info.get('positions_on_wire')}",
    ]
    if summary.orders:
        states = Counter(str(one["state"]) for one in summary.orders)
        lines.append("orders " + ", ".join(f"{count} {state}" for state, count in states.items()))
    if summary.judge.least_separation is not None:
        lines.append(f"least separation {summary.judge.least_separation:.4f} m")
    lines += [*_clearance(summary.judge), *_unknown(summary.judge)]
    lines += [f"{what} {path}" for what, path in summary.files.items()]
    return Group(table, *(Text(line) for line in lines))


def render_verdict(verdict: Verdict) -> RenderableType:
    """Return the judge's answer for people."""
    robots = plain_table("robot", "arrived", "at s", *_ERRORS, "fault", title=_SINCE)
    for robot in verdict.robots:
        robots.add_row(
            robot.id,
            "yes" if robot.arrived else "no",
            "" if robot.t is None else f"{robot.t:.2f}",
            *_errors(robot),
            _remarks(robot),
        )
    pairs = plain_table("pair", "least separation m", "at s")
    for pair in sorted(verdict.pairs, key=lambda pair: pair.separation)[:20]:
        pairs.add_row(f"{pair.a} {pair.b}", f"{pair.separation:.4f}", f"{pair.t:.2f}")
    lines = [*_collisions(verdict), *_clearance(verdict), *_unknown(verdict)]
    return Group(robots, pairs, *(Text(line) for line in lines))


def _errors(robot: RobotVerdict) -> tuple[str, str, str]:
    """Return the cells of a robot's row below the headings _ERRORS."""
    clock = "unknown" if robot.clock_error is None else f"{1000.0 * robot.clock_error:.1f}"
    return f"{1000.0 * robot.tracking_error:.1f}", f"{robot.lateness:.3f}", clock


def _remarks(robot: RobotVerdict) -> str:
    """Return a robot's fault, and when it joined the fleet and left it."""
    turns = (("joined", robot.joined), ("left", robot.left))
    found = [robot.fault, *(f"{what} at {t:.2f} s" for what, t in turns if t is not None)]
    return "; ".join(filter(None, found))


def _collisions(verdict: Verdict) -> list[str]:
    """Return how many pairs of robots touched, and which robots touched something solid."""
    lines, count = [f"collisions {verdict.collisions}"], verdict.collisions_with_obstacles
    if count is not None:
        touching = [
            f"{one.id} at ({x:.2f}, {y:.2f}), {t:.2f} s"
            for one in verdict.robots
            if one.nearest_solid is not None and (one.least_clearance or 0.0) < 0.0
            for t, x, y in [one.nearest_solid]
        ]
        names = f": {'; '.join(touching)}" if touching else ""
        lines.append(f"collisions with obstacles {count}{names}")
    return lines


def _clearance(verdict: Verdict) -> list[str]:
    clearance = verdict.least_clearance
    return [] if clearance is None else [f"least clearance {clearance:.4f} m"]


def _unknown(verdict: Verdict) -> list[str]:
    """Return sentences about what could not be judged, and why."""
    lines = []
    if verdict.collisions_with_obstacles is None:
        lines.append("collisions with obstacles are unknown: the plan holds no floor")
    unknown = [robot.id for robot in verdict.robots if robot.clock_error is None]
    if unknown:
        names = "all robots" if len(unknown) == len(verdict.robots) else ", ".join(unknown)
        lines.append(
            f"clock errors of {names} are unknown: their black boxes hold no second time to "
            "compare (a robot on another machine, one that never set out, or an older version)"
        )
    return lines
