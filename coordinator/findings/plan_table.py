"""Shows a plan and its proof as tables for people.

Decides: what is shown on the terminal after planning.
"""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING, Final

from rich.console import Group, RenderableType
from rich.text import Text

from coordinator.base.text_table import plain_table
from coordinator.findings.wait_summary import waits_of
from coordinator.findings.wait_table import waits_table
from coordinator.plan.document import PlanDocument, Proof, RobotPlan
from coordinator.proof.wording import slack_of, survived

if TYPE_CHECKING:
    from coordinator.findings.log_proof import LogProof

_FAILURES: Final = 20
"""At most this many Commands that granted too much are listed."""

_ROBOTS: Final = 30
"""Greatest number of robots shown, those that finish last; 1000 rows take longer than the proof."""
_NOTES: Final = 12
"""Greatest number of notes shown below the table; a crowded floor has hundreds."""
_WAITS: Final = 10
"""Greatest number of waits shown, the longest ones; `splinefleet info` shows all of them."""


def render(document: PlanDocument) -> RenderableType:
    """Return a plan as tables: robots, why they wait, the proof."""
    title = f"{document.scenario} · policy {document.policy} · tau {document.tau} s"
    columns = ("robot", "path m", "points", "start s", "finish s", "stops", "bytes")
    table = plain_table(*columns, title=title)
    shown = _shown(document.robots)
    for robot in shown:
        table.add_row(
            robot.id,
            f"{robot.length:.2f}",
            str(len(robot.path.control_points)),
            _start(robot),
            f"{robot.finish_time:.2f}",
            ", ".join(
                f"{stop.depart - stop.arrive:.1f} s at {stop.s:.2f} m"
                + (f" for {stop.yields_to}" if stop.yields_to else "")
                for stop in robot.stops
            ),
            str(robot.wire_bytes),
        )
    parts: list[RenderableType] = [table]
    if len(shown) < len(document.robots):
        more = len(document.robots) - len(shown)
        parts.append(
            Text(f"and {more} robots that finish before these; the plan file has them all")
        )
    if document.waits:
        parts.append(waits_table(waits_of(document), _WAITS))
    parts += [Text(note) for note in document.notes[:_NOTES]]
    if len(document.notes) > _NOTES:
        parts.append(Text(f"and {len(document.notes) - _NOTES} more notes in the plan"))
    if document.proof is not None:
        parts.append(render_proof(document.proof))
    spent = sum(document.timing.values())
    stages = ", ".join(f"{name} {seconds:.3f} s" for name, seconds in document.timing.items())
    parts.append(Text(f"planned in {spent:.3f} s: {stages}"))
    return Group(*parts)


def _shown(robots: list[RobotPlan]) -> list[RobotPlan]:
    """Return the robots that a table has room for, in the plan's order."""
    last = {robot.id for robot in sorted(robots, key=lambda robot: -robot.finish_time)[:_ROBOTS]}
    return [robot for robot in robots if robot.id in last]


def _start(robot: RobotPlan) -> str:
    owner = f" for {robot.start_yields_to}" if robot.start_yields_to else ""
    return f"{robot.start_time:.2f}{owner}"


def render_proof(proof: Proof) -> RenderableType:
    """Return the proof in a few lines."""
    lines: list[RenderableType] = [_verdict(proof)]
    lines += [Text(f"  {failure}") for failure in proof.failures]
    if proof.least_separation is not None:
        least = f"least separation {proof.least_separation:.4f} m between two centres"
        lines.append(Text(f"  {proof.pairs} {'pair' if proof.pairs == 1 else 'pairs'}, {least}"))
    if proof.tightest:
        slack = "" if proof.least_slack is None else f" {slack_of(proof.least_slack)}"
        lines.append(Text(_folded(f"tightest pair{slack}: {proof.tightest}")))
    if proof.least_clearance is not None:
        lines.append(Text(f"  least clearance {proof.least_clearance:.4f} m"))
    lines.append(Text(f"  {survived(proof.survives)}"))
    return Group(*lines)


def render_log_proof(proof: LogProof) -> RenderableType:
    """Return the proof of a log, a few lines for each epoch."""
    lines: list[RenderableType] = []
    for epoch in proof.epochs:
        lines += [Text(f"epoch {epoch.epoch}"), render_proof(epoch.proof)]
        if epoch.failures:
            told = f"{len(epoch.failures)} of the messages sent are not safe:"
            lines += [Text(f"  {told}", "red")]
            lines += [Text(_folded(one)) for one in epoch.failures[:_FAILURES]]
        else:
            lines.append(Text(f"  {epoch.commands} Commands granted no more than is safe"))
            if epoch.courses:
                lines.append(Text(f"  {epoch.courses} further courses keep clear of all others"))
    if proof.damage:
        told = "messages may be missing, and these are not proven"
        lines += [Text(told, "red"), Text(_folded(proof.damage))]
    return Group(*lines)


def _verdict(proof: Proof) -> Text:
    if not proof.holds:
        return Text("proof does not hold", "red")
    if proof.unproven:
        return Text(f"what was proven holds; not proven: {', '.join(proof.unproven)}", "yellow")
    return Text("proof holds", "green")


def _folded(text: str) -> str:
    """Break a line that is too wide for a terminal of 80 columns."""
    return fill(text, 80, initial_indent="  ", subsequent_indent="    ", break_on_hyphens=False)
