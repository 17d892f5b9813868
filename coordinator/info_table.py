"""The summary of a log or a plan as tables for people.

Decides: what a person sees first.  Must not know: logs or messages, only the summary's fields.
"""

from __future__ import annotations

import msgspec
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from coordinator.plan_table import render_proof
from coordinator.summary import EpochSummary, RobotSummary, Summary
from coordinator.wait_table import waits_table


def render(summary: dict[str, object]) -> RenderableType:
    """Return the tables for what `info.summarise` or `info.summarise_plan` returned."""
    told = msgspec.convert(summary, Summary)
    planned = told.source == "plan"
    parts: list[RenderableType] = [_plan_headline(told) if planned else _headline(told)]
    if told.epochs:
        parts.append(_epochs(told.epochs))
    if told.robots:
        parts.append(_robots(told.robots, driven=not planned))
    if told.waits:
        parts.append(waits_table(told.waits))
    if told.faults:
        parts.append(_faults(told))
    if told.keys:
        parts.append(_keys(told))
    if planned and told.proof is not None:
        parts.append(render_proof(told.proof))
    return Group(*parts)


def _plan_headline(told: Summary) -> Table:
    return _grid(
        ("plan for", told.fleet),
        ("policy", told.policy or "-"),
        ("tau", _seconds(told.tau)),
        ("largest plan", f"{told.largest_plan_bytes} bytes"),
    )


def _headline(told: Summary) -> Table:
    state = "closed" if told.complete else "not closed: the coordinator was killed or still runs"
    rate = told.robot_payload_bytes_per_second
    table = _grid(
        ("fleet", told.fleet),
        ("policy", told.policy or "-"),
        ("tau", _seconds(told.tau)),
        ("log", f"{told.duration:.2f} s, {state}"),
        ("messages", f"{told.messages}, of them {told.bad_messages} bad"),
        ("positions on the wire", str(told.positions_on_wire)),
        ("largest plan", f"{told.largest_plan_bytes} bytes"),
        ("largest message to a robot", f"{told.largest_message_to_robot_bytes} bytes"),
        ("busiest robot sent", "-" if rate is None else f"{rate:.1f} bytes/s"),
    )
    if told.damage:
        table.add_row("damage", Text(told.damage, style="bold red"))
    return table


def _grid(*rows: tuple[str, str]) -> Table:
    table = Table.grid(padding=(0, 2))
    for name, value in rows:
        table.add_row(name, Text(value))
    return table


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left")
    for column in columns:
        table.add_column(column)
    return table


def _epochs(epochs: list[EpochSummary]) -> Table:
    table = _table("epochs", "epoch", "GO at", "phases", "arrived", "ended")
    for epoch in epochs:
        changes = ", ".join(f"{change.phase} {change.t:.2f}" for change in epoch.phases)
        arrived = str(len(epoch.arrivals))
        table.add_row(str(epoch.epoch), _seconds(epoch.start), changes, arrived, epoch.ended)
    return table


def _robots(robots: dict[str, RobotSummary], *, driven: bool) -> Table:
    """Return the robots; those of a plan have not arrived yet, nor sent anything."""
    columns = ["robot", "plan", "points", "stops", "planned", "arrived", "sent", "fault"]
    known = len(columns) if driven else columns.index("arrived")
    table = _table("robots", *columns[:known])
    for name, robot in sorted(robots.items()):
        stops = [
            f"s {stop.s:.2f} m until {stop.depart:.2f} s"
            + (f" for {stop.yields_to}" if stop.yields_to else "")
            for stop in robot.stops
        ]
        cells: list[str | Text] = [
            Text(name),
            f"{robot.plan_bytes} B",
            str(robot.control_points),
            Text("\n".join(stops) or "-"),
            _seconds(robot.planned_finish),
            _seconds(robot.arrived),
            f"{robot.bytes_sent} B",
            Text(robot.fault or "-"),
        ]
        table.add_row(*cells[:known])
    return table


def _faults(told: Summary) -> Table:
    table = _table("faults", "at", "robot", "what", "kind")
    for fault in told.faults:
        table.add_row(_seconds(fault.t), Text(fault.robot or "-"), Text(fault.fault), fault.kind)
    return table


def _keys(told: Summary) -> Table:
    table = _table("keys", "key", "messages", "bytes")
    for key, traffic in sorted(told.keys.items()):
        table.add_row(Text(key), str(traffic.messages), str(traffic.bytes))
    return table


def _seconds(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f} s"
