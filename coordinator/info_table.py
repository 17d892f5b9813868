"""The summary of a log or a plan as tables for people.

Decides: what a person sees first.  Must not know: logs or messages, only the summary's fields.
"""

from __future__ import annotations

import msgspec
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from coordinator.plan_table import render_proof
from coordinator.summary import (
    Broadcast,
    EpochSummary,
    FreezeSummary,
    Percentiles,
    RobotSummary,
    Summary,
)
from coordinator.wait_table import waits_table
from protocol.keys import ROOT


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
    if told.freezes:
        parts.append(_freezes(told.freezes))
    if told.latencies:
        parts.append(_latencies(told.latencies))
    if told.keys:
        parts.append(_keys(told))
    if told.broadcast is not None and told.broadcast.robots > 1:
        parts.append(_broadcast(told.broadcast))
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
        ("lost on the way", f"{told.lost_messages}, by gaps in their numbers"),
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
    columns = [
        *("robot", "plan B", "points", "stops", "planned s"),
        *("arrived s", "late", "sent B", "fault"),
    ]
    known = len(columns) if driven else columns.index("arrived s")
    table = _table("robots", *columns[:known])
    for name, robot in sorted(robots.items()):
        stops = [
            f"s {stop.s:.2f} m until {stop.depart:.2f} s"
            + (f" for {stop.yields_to}" if stop.yields_to else "")
            for stop in robot.stops
        ]
        cells: list[str | Text] = [
            Text(name),
            str(robot.plan_bytes),
            str(robot.control_points),
            Text("\n".join(stops) or "-"),
            *map(_number, (robot.planned_finish, robot.arrived, robot.late)),
            str(robot.bytes_sent),
            Text(robot.fault or "-"),
        ]
        table.add_row(*cells[:known])
    return table


def _faults(told: Summary) -> Table:
    table = _table("faults", "at", "robot", "what", "kind")
    for fault in told.faults:
        table.add_row(_seconds(fault.t), Text(fault.robot or "-"), Text(fault.fault), fault.kind)
    return table


def _freezes(freezes: list[FreezeSummary]) -> Table:
    table = _table("freezes", "at", "epoch", "noticed for", "silent for", "all at rest", "next GO")
    for freeze in freezes:
        times = (freeze.notice, freeze.silence, freeze.rest, freeze.go)
        cells = [_seconds(time) for time in times]
        table.add_row(_seconds(freeze.t), str(freeze.epoch), *cells)
    return table


def _latencies(latencies: dict[str, Percentiles]) -> Table:
    table = _table("latencies, ms", "what", "times", "median", "90 %", "99 %", "most")
    for name, told in sorted(latencies.items()):
        cells = (f"{1000.0 * time:.1f}" for time in (told.median, told.p90, told.p99, told.most))
        table.add_row(name.replace("_", " "), str(told.count), *cells)
    return table


def _keys(told: Summary) -> Table:
    root = f"{ROOT}/{told.fleet}/"
    table = _table(f"keys, ours below {root}", "key", "messages", "bytes", "messages/s", "bytes/s")
    for key, traffic in sorted(told.keys.items()):
        table.add_row(
            Text(key.removeprefix(root)),
            str(traffic.messages),
            str(traffic.bytes),
            f"{traffic.messages_per_second:.1f}",
            f"{traffic.bytes_per_second:.1f}",
        )
    return table


def _broadcast(told: Broadcast) -> Text:
    """Return the line beside what a broadcasting fleet would have sent."""
    ours = f"{told.our_messages:,} messages, {told.our_bytes:,} bytes were delivered in all"
    theirs = (
        f"{told.robots} robots broadcasting positions at {told.rate:g} Hz for "
        f"{told.seconds:.1f} s: {told.messages:,} messages, {told.bytes:,} bytes"
    )
    return Text(f"{ours}; {theirs}")


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _seconds(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f} s"
