"""Shows live tables of a running fleet: robot, phase, progress by the clock, next stop; orders.

Progress follows from the courses and the time, since robots send no positions.
Decides: what people see on the terminal while a fleet runs.
"""

from __future__ import annotations

from typing import Final

from rich.console import Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from coordinator.base.console import errors
from coordinator.base.text_table import plain_table
from coordinator.findings.plans_from_messages import is_further
from coordinator.fleet.core import Fleet
from coordinator.plan.document import PlanDocument
from coordinator.plan.wire import drive
from coordinator.view.order_lines import TimeOfDay, arrival
from protocol.host_clock import time_of_day
from protocol.messages import ORDER_STATES, UNDER_WAY
from protocol.phases import COMMAND_NAMES, FAULT_NAMES, FREEZE, GO, MOVING, PHASE_NAMES
from protocol.timeline import Timeline

_WAITING: Final = 8
"""So many orders that wait are shown."""


class FleetTable:
    """A table of the fleet, drawn four times a second; not drawn if stderr is not a terminal."""

    def __init__(self, document: PlanDocument, time_of: TimeOfDay) -> None:
        self.follow(document)
        self._time_of = time_of
        self._live = Live(
            console=errors,
            refresh_per_second=4,
            transient=True,
            redirect_stdout=False,
            redirect_stderr=False,
        )
        self._on = errors.is_terminal

    def follow(self, document: PlanDocument) -> None:
        """Show progress along this plan from now on.

        Robots of an earlier plan may be missing in it.
        """
        self._lines = {driven.id: driven.timeline for driven in drive(document)}
        self._stops = {robot.id: robot for robot in document.robots}

    def __enter__(self) -> FleetTable:
        """Begin to draw."""
        if self._on:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop drawing and clear the table."""
        if self._on:
            self._live.stop()

    def watch(self, fleet: Fleet, now_ns: int) -> None:
        """Show the state of the fleet at a time on the coordinator's clock."""
        if self._on:
            self._live.update(self.render(fleet, now_ns))

    def render(self, fleet: Fleet, now_ns: int) -> RenderableType:
        """Return the tables."""
        robots = self._robots(fleet, now_ns)
        return Group(robots, self._orders(fleet)) if fleet.orders.tasks else robots

    def _orders(self, fleet: Fleet) -> Table:
        """Return the orders that are under way, and the first ones that wait."""
        book = fleet.orders
        going, waiting = book.under_way(), book.waiting()
        title = f"orders: {len(going)} under way, {len(waiting)} waiting, {book.done} over"
        table = plain_table("order", "robot", "state", "", title=title)
        for task in [*going, *waiting[:_WAITING]]:
            one = task.message()
            what = arrival(one, self._time_of) if one.state == UNDER_WAY else one.reason
            table.add_row(one.id, one.robot, ORDER_STATES[one.state], Text(what))
        return table

    def _robots(self, fleet: Fleet, now_ns: int) -> Table:
        moves = fleet.phase in (GO, FREEZE)
        time = fleet.times.plan_ms(now_ns) / 1000.0 if moves else 0.0
        title = f"{time_of_day()} · {fleet.name} · epoch {fleet.epoch}"
        title += f" · {COMMAND_NAMES[fleet.phase]}"
        if fleet.phase == GO:
            title += f" · {max(fleet.since_go_ms(now_ns), 0) / 1000.0:.1f} s"
        columns = ("robot", "phase", "order", "progress by the clock", "%", "next stop")
        table = plain_table(*columns, title=title)
        does = {task.robot: task.order.id for task in reversed(fleet.orders.under_way())}
        held = {one.robot: one for one in fleet.held()} if fleet.phase == GO else {}
        for member in fleet.members.values():
            line = self._line(fleet, member.id)
            share = 1.0 if member.finished else 0.0
            phase = "lost" if member.lost else PHASE_NAMES[member.phase]
            if line is not None and member.phase >= MOVING:
                since = held[member.id].since_ms / 1000.0 if member.id in held else time
                share = line.s_at(since) / line.length
                if member.phase == MOVING and line.v_at(time) == 0.0 and not member.lost:
                    phase = "waiting"
                if member.id in held:
                    phase = f"held by {held[member.id].by} since {since:.1f} s"
            if member.fault:
                phase += f" ({FAULT_NAMES[member.fault]})"
            table.add_row(
                member.id,
                phase,
                does.get(member.id, ""),
                ProgressBar(total=1.0, completed=share, width=20),
                f"{100.0 * share:.0f}",
                self._next_stop(member.id, line, time),
            )
        return table

    def _line(self, fleet: Fleet, robot: str) -> Timeline | None:
        """Return the motion of the course that a robot drives; None if it has none."""
        mine = fleet.grants.of(robot)
        if mine is None or mine.now.course is None or not is_further(mine.now.course.driven.plan):
            return self._lines.get(robot)
        return mine.now.course.driven.timeline

    def _next_stop(self, robot: str, line: Timeline | None, time: float) -> str:
        if line is None:
            return "no part in this epoch"
        coming = line.next_stop(time)
        if coming is None:
            return "goal"
        s, depart = coming
        plan = self._stops.get(robot) if line is self._lines.get(robot) else None
        owners = {} if plan is None else {stop.s: stop.yields_to for stop in plan.stops}
        owner = owners.get(s, plan.start_yields_to if plan is not None and s == 0.0 else "")
        place = f"s = {s:.2f} m until {depart:.1f} s"
        return f"{place} for {owner}" if owner else place
