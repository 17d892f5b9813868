"""Counts latencies, losses and traffic of a log.

Decides: when each latency begins and ends, and what a broadcasting fleet would have sent.  Must not
know: files, epochs' plans, or how numbers are shown.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Final

from coordinator.findings.info_fields import Broadcast, FreezeSummary, Percentiles, Summary
from protocol import keys, phases
from protocol.codec import decode
from protocol.messages import Clock, Command, Message, Report

if TYPE_CHECKING:
    from coordinator.log.records import Log, Record

BROADCAST_HZ: Final = 10.0
POSITION_BYTES: Final = 24
"""x, y and heading as float64: the least that a broadcast position takes."""

_LONGEST_GAP: Final = 10_000
"""A wider gap in sequence numbers is not a loss: another process sends under that name."""

_UNDER_WAY: Final = (phases.MOVING, phases.BRAKING)


def clock_lag(log: Log) -> int:
    """Return how far [ns] a log's times are ahead of the coordinator's clock.

    0 for the coordinator's own log; for others it follows from the recorded answers about the time.
    """
    if not log.is_recording:
        return 0
    lags = []
    for record in log.records:
        place = keys.split(record.key)
        if place is not None and place[1] == "clock":
            message = decode("clock", record.payload)
            if isinstance(message, Clock) and message.answered_ns is not None:
                lags.append(record.log_ns - message.answered_ns)
    return statistics.median_low(lags) if lags else 0


def first_go(logs: Iterable[Log], lag_ns: int) -> int | None:
    """Return the time zero of the first epoch with a GO, on the logs' clock [ns]; None without any.

    logs: the logs that a log resumes from, oldest first, and then that log.
    """
    found = None
    for log in logs:
        if found is None or (log.records and found > log.records[0].log_ns):
            found = _own_first_go(log, lag_ns)
    return found


def every_start(logs: Iterable[Log]) -> set[int]:
    """Return the time zeros [ns] that Commands with GO have stated, on the coordinator's clock."""
    said = (
        decode("command", record.payload)
        for log in logs
        for record in log.records
        if record.key.endswith("/command")
    )
    return {one.start_ns for one in said if isinstance(one, Command) and one.phase == phases.GO}


def is_own(log: Log, command: Command) -> bool:
    """Return whether the coordinator that kept a log sent a Command; any may have if none did."""
    return log.metadata.get("boot", "") in ("", str(command.boot))


def _own_first_go(log: Log, lag_ns: int) -> int | None:
    for record in log.records:
        if record.key.endswith("/command"):
            message = decode("command", record.payload)
            if not isinstance(message, Command) or message.phase != phases.GO:
                continue
            if is_own(log, message):
                return message.start_ns + lag_ns
    return None


def percentiles(values: Sequence[float]) -> Percentiles:
    """Return the percentiles of one or more times; each percentile is one of these times."""
    ordered = sorted(values)

    def share(part: float) -> float:
        return round(ordered[max(math.ceil(part * len(ordered)) - 1, 0)], 6)

    return Percentiles(len(ordered), share(0.5), share(0.9), share(0.99), share(1.0))


@dataclass
class _Speaker:
    """The sequence numbers of one process."""

    seen: set[int] = field(default_factory=set)
    count: int = 0

    def hear(self, sequence: int) -> None:
        self.seen.add(sequence)
        self.count += 1

    @property
    def lost(self) -> int:
        ordered = sorted(self.seen)
        gaps = (after - before - 1 for before, after in pairwise(ordered))
        return sum(gap for gap in gaps if gap < _LONGEST_GAP)


class Numbers:
    """Counters of a log's messages; `info` calls `hear` with every valid message of the fleet.

    `stopped_nobody`: whether the last FREEZE came when all robots of the epoch had arrived.  Such a
    FREEZE ends an epoch in which others of the fleet had no part; it is not reported as a freeze.
    """

    def __init__(self, log: Log, zero_ns: int) -> None:
        self.stopped_nobody = False
        self._zero_ns = zero_ns
        self._wall_ns = int(log.metadata.get("wall_offset_ns", "0"))
        self._in_time = log.metadata.get("speed", "1.0") in ("1", "1.0")
        self._times: dict[str, list[float]] = {}
        self._commands: dict[int, _Speaker] = {}
        self._reports: dict[tuple[str, int], _Speaker] = {}
        self._said_ns: dict[int, int] = {}
        self._states: dict[str, tuple[int, int]] = {}
        self._parts: dict[str, int] = {}
        self._sign_ns: int | None = None
        self._epoch, self._phase = 0, phases.HOLD
        self._freezes: list[tuple[int, FreezeSummary]] = []
        self._braking: set[str] = set()

    def hear(self, message: Message, robot: str, record: Record) -> None:
        """Count a message."""
        if isinstance(message, Command):
            self._age("command_age", record)
            self._hear_command(message, record.log_ns)
        elif isinstance(message, Report):
            self._age("report_age", record)
            self._hear_report(message, robot, record.log_ns)

    def link_lost(self, robot: str, log_ns: int) -> None:
        """Record that a robot has lost its link, a sign of a fault if it is part of the epoch."""
        if self._parts.get(robot) == self._epoch:
            self._sign(log_ns)

    def fill(self, summary: Summary) -> None:
        """Put everything that was counted into the summary."""
        summary.frozen = [freeze for _, freeze in self._freezes]
        summary.freezes = len(summary.frozen)
        for name in ("notice", "silence", "rest", "go"):
            found = [getattr(freeze, name) for freeze in summary.frozen]
            self._times[f"freeze_{name}"] = [value for value in found if value is not None]
        times = self._times.items()
        summary.latencies = {name: percentiles(values) for name, values in times if values}
        for (robot, _), speaker in self._reports.items():
            summary.robots[robot].reports_lost += speaker.lost
            summary.robots[robot].reports_doubled += speaker.count - len(speaker.seen)
        summary.lost_messages = sum(
            speaker.lost for speaker in (*self._commands.values(), *self._reports.values())
        )

    def _age(self, name: str, record: Record) -> None:
        """Note how old a message was; a message without a stamp has the time of its recording."""
        age_ns = record.log_ns + self._wall_ns - record.publish_ns
        if age_ns and self._in_time:
            self._times.setdefault(name, []).append(age_ns / 1e9)

    def _sign(self, log_ns: int) -> None:
        if self._phase == phases.GO and self._sign_ns is None:
            self._sign_ns = log_ns

    def _hear_command(self, command: Command, log_ns: int) -> None:
        self._commands.setdefault(command.boot, _Speaker()).hear(command.sequence)
        if command.boot in self._said_ns:
            gap = (log_ns - self._said_ns[command.boot]) / 1e9
            self._times.setdefault("command_gap", []).append(gap)
        self._said_ns[command.boot] = log_ns
        was, self._epoch, self._phase = self._phase, command.epoch, command.phase
        if command.phase == phases.FREEZE != was:
            states = [phase for _, phase in self._states.values()]
            arrived = phases.DONE in states and not set(states) & {*_UNDER_WAY, phases.ARMED}
            self.stopped_nobody = was == phases.GO and self._sign_ns is None and arrived
        if command.phase == phases.FREEZE != was and not self.stopped_nobody:
            self._freeze(command.epoch, log_ns)
        elif command.phase == phases.GO != was:
            self._sign_ns = None
            self._braking.clear()
            self._states.clear()
            if self._freezes and self._freezes[-1][1].go is None:
                begun_ns, freeze = self._freezes[-1]
                freeze.go = (log_ns - begun_ns) / 1e9

    def _freeze(self, epoch: int, log_ns: int) -> None:
        moving = {name: at for name, (at, phase) in self._states.items() if phase in _UNDER_WAY}
        silence = max((log_ns - at for at in moving.values()), default=None)
        freeze = FreezeSummary(
            t=(log_ns - self._zero_ns) / 1e9,
            epoch=epoch,
            notice=None if self._sign_ns is None else (log_ns - self._sign_ns) / 1e9,
            silence=None if silence is None else silence / 1e9,
        )
        self._freezes.append((log_ns, freeze))
        self._braking = set(moving)

    def _hear_report(self, report: Report, robot: str, log_ns: int) -> None:
        self._reports.setdefault((robot, report.boot), _Speaker()).hear(report.sequence)
        self._states[robot] = (log_ns, report.phase)
        self._parts[robot] = report.epoch
        failed = report.fault != phases.NO_FAULT or report.phase in (phases.BRAKING, phases.FROZEN)
        if failed and report.epoch in (0, self._epoch):  # Else it has no part in this epoch.
            self._sign(log_ns)
        if robot in self._braking and report.phase not in _UNDER_WAY:
            self._braking.discard(robot)
            begun_ns, freeze = self._freezes[-1]
            freeze.rest = (log_ns - begun_ns) / 1e9


def is_question(message: Message) -> bool:
    """Return whether a message is a robot's question for the time, not the coordinator's answer."""
    return isinstance(message, Clock) and message.received_ns is None


def busiest(sent: Iterable[tuple[str, int, int]], first_ns: int, last_ns: int) -> float | None:
    """Return the most payload that a robot sent between two times [bytes/s].

    sent: robot, time and size of each message.
    """
    sums: dict[str, int] = {}
    for robot, log_ns, size in sent:
        if first_ns <= log_ns <= last_ns:
            sums[robot] = sums.get(robot, 0) + size
    return max(sums.values()) * 1e9 / (last_ns - first_ns) if last_ns > first_ns else None


def broadcast(summary: Summary, ours: Mapping[str, tuple[int, int]], seconds: float) -> Broadcast:
    """Return what a fleet that broadcasts positions would have sent in `seconds`.

    ours: messages and bytes by kind of key.
    """
    robots = sum(robot.reports > 0 for robot in summary.robots.values())
    messages = round(BROADCAST_HZ * seconds) * robots * (robots - 1)
    reaches = {kind: robots if kind == "command" else 1 for kind in ours}
    return Broadcast(
        robots=robots,
        seconds=round(seconds, 3),
        rate=BROADCAST_HZ,
        position_bytes=POSITION_BYTES,
        messages=messages,
        bytes=messages * POSITION_BYTES,
        our_messages=sum(count * reaches[kind] for kind, (count, _) in ours.items()),
        our_bytes=sum(size * reaches[kind] for kind, (_, size) in ours.items()),
    )
