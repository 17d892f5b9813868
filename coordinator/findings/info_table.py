"""Shows the summary of a log or a plan as tables for people.

Decides: what a person sees first.  Must not know: logs or messages; it gets the summary's fields.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from textwrap import fill

import msgspec
from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from coordinator.base.text_table import plain_table
from coordinator.findings.giving_way import GivingWay
from coordinator.findings.info_fields import (
    Broadcast,
    EpochSummary,
    FreezeSummary,
    OrderSummary,
    Percentiles,
    RobotSummary,
    Summary,
)
from coordinator.findings.plan_table import render_proof
from coordinator.findings.wait_table import waits_table
from coordinator.scenario.checks import printable
from protocol.keys import ROOT


def render(summary: dict[str, object]) -> RenderableType:
    """Return the tables for a summary of `info.summarise` or `plan_facts.summarise_plan`."""
    told = msgspec.convert(summary, Summary)
    planned = told.source == "plan"
    parts: list[RenderableType] = [_plan_headline(told) if planned else _headline(told)]
    if told.epochs:
        parts.append(_epochs(told.epochs, told.robots))
    if told.robots:
        parts.append(_robots(told.robots, driven=not planned))
        parts.append(_arrivals(told.robots, driven=not planned))
        parts += [Text(line) for line in _sources(told)]
    if told.waits:
        parts.append(waits_table(told.waits))
    if told.giving_way:
        parts.append(_giving_way(told.giving_way))
    if told.faults:
        parts.append(_faults(told))
    if told.frozen:
        parts.append(_frozen(told.frozen))
    parts += [
        Text(f"{one.robot} was held by {one.by} from {one.begin:.2f} to {one.until:.2f} s")
        for one in told.held
    ]
    if told.orders:
        parts.append(orders_table(told.orders))
    if told.latencies:
        parts.append(_latencies(told.latencies))
    if told.keys:
        parts.append(_keys(told))
    if told.broadcast is not None and told.broadcast.robots > 1:
        parts.append(_broadcast(told.broadcast))
    if planned and told.proof is not None:
        parts.append(render_proof(told.proof))
    return Group(*parts)


def orders_table(orders: Sequence[OrderSummary]) -> RenderableType:
    """Return a table of orders and what became of them, and below it the reasons."""
    table = plain_table(
        "order",
        "robot",
        "state",
        "known s",
        "told s",
        "planned s",
        "arrived s",
        "late s",
        "alone s",
        title="orders",
    )
    for column in table.columns[:3]:  # A name in pieces cannot be copied.
        column.no_wrap = True
    table.box, table.collapse_padding, table.pad_edge = SIMPLE_HEAD, True, False
    for one in orders:
        known = (one.released, one.accepted, one.planned_arrival)
        times = (*known, one.arrived, one.late, one.alone)
        shown = ("" if time is None else f"{time:.1f}" for time in times)
        table.add_row(one.id, one.robot, one.state, *shown)
    why = [Text(f"{one.id} {one.state}: {one.reason}") for one in orders if one.reason]
    return Group(table, *why)


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
        ("written by", _written_by(told)),
        ("times", _zero(told.zero)),
        ("messages", f"{told.messages}, of which {told.bad_messages} are invalid"),
        ("dropped", _dropped(told.dropped)),
        ("lost on the way", f"{told.lost_messages}, by gaps in the sequence numbers"),
        ("messages with positions", str(told.positions_on_wire)),
        ("largest plan", f"{told.largest_plan_bytes} bytes"),
        ("largest message to a robot", f"{told.largest_message_to_robot_bytes} bytes"),
        ("busiest robot sent", "-" if rate is None else f"{rate:.1f} bytes/s"),
    )
    if told.damage:
        table.add_row("damage", Text(told.damage, style="bold red"))
    return table


def _written_by(told: Summary) -> str:
    """Return which version wrote a log; messages of older protocols may count as invalid."""
    if told.version is None or told.protocol is None:
        return "not stated"
    return f"splinefleet {told.version}, protocol {told.protocol}"


def _dropped(dropped: dict[str, int]) -> str:
    """Return how many messages are not in the log, and why."""
    causes = "; ".join(f"{count} {cause}" for cause, count in sorted(dropped.items()))
    return f"{sum(dropped.values())}: {causes}" if dropped else "none"


def _zero(zero: float | None) -> str:
    """Return a text that says which instant the times count from."""
    if zero is None:
        return "in s from the log's first message; there was no GO"
    place = f"{zero:.2f} s into the log" if zero >= 0.0 else f"{-zero:.2f} s before the log begins"
    return f"in s from the first GO, {place}"


def _sources(told: Summary) -> Iterator[str]:
    """Yield lines on the source of the distances, and on what is unknown without black boxes."""
    sources = {robot.nearest.source for robot in told.robots.values() if robot.nearest}
    if sources:
        yield f"distances between centres, from the {sources.pop()}"
    if told.source == "log" and not any(r.true_arrival for r in told.robots.values()):
        yield "true arrivals and distances from the plan need black boxes: --blackbox FOLDER"


def _grid(*rows: tuple[str, str]) -> Table:
    table = Table.grid(padding=(0, 2))
    for name, value in rows:
        table.add_row(name, Text(value))
    return table


def _is_under_way(robot: RobotSummary) -> bool:
    """Return whether a robot has not come to the end of its last course when the log ends."""
    return robot.planned_finish is not None and robot.late is None


def _epochs(epochs: list[EpochSummary], robots: dict[str, RobotSummary]) -> Table:
    going = {name for name, robot in robots.items() if _is_under_way(robot)}
    table = plain_table("epoch", "GO at", "phases", "arrived", "ended", title="epochs")
    for epoch in epochs:
        changes = ", ".join(f"{change.phase} {change.t:.2f}" for change in epoch.phases)
        arrived = str(len(epoch.arrivals.keys() - (going if epoch is epochs[-1] else set())))
        table.add_row(str(epoch.epoch), _seconds(epoch.start), changes, arrived, epoch.ended)
    return table


def _robots(robots: dict[str, RobotSummary], *, driven: bool) -> Table:
    """Return the robots with their plans and, if they have driven, what they sent."""
    names = [*("robot", "plan B", "points", "stops"), *(("sent B", "fault") if driven else ())]
    table = plain_table(*names, title="robots")
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
            str(robot.bytes_sent),
            Text(robot.fault or "-"),
        ]
        table.add_row(*cells[: len(names)])
    return table


def _arrivals(robots: dict[str, RobotSummary], *, driven: bool) -> Table:
    """Return when robots arrived, how far they were off their plans, and their nearest robots."""
    known = ("heard s", "late s", "true s", "off plan mm") if driven else ()
    names = ["robot", "planned s", *known, "nearest", "m", "at s"]
    table = plain_table(*names, title="arrivals, and each robot's nearest other robot")
    for name, robot in sorted(robots.items()):
        off = None if robot.tracking_error is None else 1000.0 * robot.tracking_error
        going = _is_under_way(robot)
        heard = [None] * 3 if going else [robot.arrived, robot.late, robot.true_arrival]
        cells = [_number(robot.planned_finish)]
        if driven:
            cells += [*map(_number, heard), "-" if off is None else f"{off:.1f}"]
        near = robot.nearest
        others = (
            ("-", "-", "-")
            if near is None
            else (near.robot, f"{near.distance:.3f}", _number(near.t))
        )
        table.add_row(Text(name), *cells, *map(Text, others))
    return table


def _giving_way(found: Sequence[GivingWay]) -> Table:
    """Return who drives more slowly than possible, or aside from the shortest way."""
    epochs = len({one.epoch for one in found}) > 1
    columns = ("robot", "gives way", "from s", "until s", "from m", "until m", "loses s")
    title = "slower than possible, or aside from the shortest way"
    table = plain_table(*(["epoch"] if epochs else []), *columns, title=title)
    for one in found:
        numbers = (one.since, one.until, *one.on)
        cells = [one.robot, f"{one.how} {one.other}", *(f"{number:.1f}" for number in numbers)]
        cells = [str(one.epoch), *cells] if epochs else cells
        lost = f"{one.lost:.1f}" if one.lost else "-"
        table.add_row(*(Text(printable(cell)) for cell in cells), lost)
    return table


def _faults(told: Summary) -> Table:
    table = plain_table("at", "robot", "what", "kind", title="faults and freezes")
    for fault in told.faults:
        table.add_row(_seconds(fault.t), Text(fault.robot or "-"), Text(fault.fault), fault.kind)
    return table


def _frozen(freezes: list[FreezeSummary]) -> Table:
    table = plain_table(
        "at", "epoch", "noticed after", "silent for", "all at rest", "next GO", title="freezes"
    )
    for freeze in freezes:
        times = (freeze.notice, freeze.silence, freeze.rest, freeze.go)
        cells = [_seconds(time) for time in times]
        table.add_row(_seconds(freeze.t), str(freeze.epoch), *cells)
    return table


def _latencies(latencies: dict[str, Percentiles]) -> Table:
    table = plain_table("what", "times", "median", "90 %", "99 %", "most", title="latencies, ms")
    for name, told in sorted(latencies.items()):
        cells = (f"{1000.0 * time:.1f}" for time in (told.median, told.p90, told.p99, told.most))
        table.add_row(name.replace("_", " "), str(told.count), *cells)
    return table


def _keys(told: Summary) -> Table:
    root = f"{ROOT}/{told.fleet}/"
    table = plain_table(
        "key", "messages", "bytes", "messages/s", "bytes/s", title=f"keys, relative to {root}"
    )
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
    """Return the fleet's traffic compared with that of a fleet that broadcasts positions."""
    ours = f"{told.our_messages:,} messages, {told.our_bytes:,} bytes were delivered in all"
    theirs = (
        f"{told.robots} robots broadcasting positions at {told.rate:g} Hz for "
        f"{told.seconds:.1f} s: {told.messages:,} messages, {told.bytes:,} bytes"
    )
    return Text(f"{ours};\n{fill(theirs, 80)}")


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _seconds(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f} s"
