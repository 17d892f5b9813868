"""Shows a live table of a running fleet: robot, phase, progress by the clock, next stop.

Progress follows from the plan and the time, since robots send no positions.
Decides: what people see on the terminal while a fleet runs.
"""

from __future__ import annotations

from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table

from coordinator.base.console import errors
from coordinator.base.text_table import plain_table
from coordinator.fleet.core import Fleet
from coordinator.plan.document import PlanDocument
from coordinator.plan.wire import drive
from protocol.phases import COMMAND_NAMES, FAULT_NAMES, FREEZE, GO, MOVING, PHASE_NAMES


class FleetTable:
    """A table of the fleet, drawn four times a second; not drawn if stderr is not a terminal."""

    def __init__(self, document: PlanDocument) -> None:
        self.follow(document)
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

    def render(self, fleet: Fleet, now_ns: int) -> Table:
        """Return the table."""
        time = (now_ns - fleet.times.start_ns) / 1e9 if fleet.phase in (GO, FREEZE) else 0.0
        title = f"{fleet.name} · epoch {fleet.epoch} · {COMMAND_NAMES[fleet.phase]}"
        if fleet.phase == GO:
            title += f" · {max(time, 0.0):.1f} s"
        columns = ("robot", "phase", "progress by the clock", "%", "next stop")
        table = plain_table(*columns, title=title)
        held = {one.robot: one for one in fleet.held()} if fleet.phase == GO else {}
        for member in fleet.members.values():
            line = self._lines.get(member.id)
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
                ProgressBar(total=1.0, completed=share, width=20),
                f"{100.0 * share:.0f}",
                self._next_stop(member.id, time),
            )
        return table

    def _next_stop(self, robot: str, time: float) -> str:
        if robot not in self._lines:
            return "no part in this epoch"
        coming = self._lines[robot].next_stop(time)
        if coming is None:
            return "goal"
        s, depart = coming
        plan = self._stops[robot]
        owners = {stop.s: stop.yields_to for stop in plan.stops}
        owner = owners.get(s, plan.start_yields_to if s == 0.0 else "")
        place = f"s = {s:.2f} m until {depart:.1f} s"
        return f"{place} for {owner}" if owner else place
