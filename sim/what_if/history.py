"""What a log says about its robots up to a given time, and the coordinator's state at that time.

Decides: where a log is cut, and whether the run can be continued from there.  Must not know:
bodies, links, virtual time.

The coordinator's state is exact: planner and fleet core run again on the messages that they
received, and must send exactly the bytes that the log says they sent.  About the robots a log holds
only what they sent: their names, where they rested, when they were last heard.
"""

from __future__ import annotations

from collections.abc import Container, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from msgspec.structs import replace

from coordinator.base.errors import InputError
from coordinator.findings.traffic_numbers import first_go
from coordinator.fleet.log_records import LINK_GONE
from coordinator.log.log_file import RESUMED, logs_before, read_log
from coordinator.log.records import Log, Record
from coordinator.mission.mission import Mission
from coordinator.service.replay import mission_at_end
from protocol import keys
from protocol.codec import decode
from protocol.messages import Hello, Report, Rest
from protocol.phases import OVER
from protocol.timing import REPORT_TIMEOUT, SECOND

_SPOKEN: Final = ("hello", "report", "alive")


@dataclass
class Known:
    """What a log says about one robot, with times in ns on the coordinator's clock.

    boots: the first Hello of each start of its program; rests: where it reported that it rests.
    """

    boots: list[tuple[int, Hello]] = field(default_factory=list)
    rests: list[tuple[int, Rest]] = field(default_factory=list)
    heard_ns: int = 0
    sequence: int = 0
    linked: bool = True

    def is_silent(self, now_ns: int) -> bool:
        """Return whether the robot is inactive: its link is gone, or nothing is heard from it."""
        return not self.linked or now_ns - self.heard_ns > 2 * REPORT_TIMEOUT


@dataclass(frozen=True)
class History:
    """A run up to `until_ns`: its logs, the last one cut there, and the mission at that time.

    before: the bytes of the logs before the last one.
    """

    logs: list[Log]
    before: list[bytes]
    until_ns: int
    began_ns: int
    mission: Mission
    robots: dict[str, Known]

    def records(self) -> Iterator[Record]:
        """Yield the records of all logs in order."""
        for log in self.logs:
            yield from log.records


def read_history(path: Path, until: float) -> History:
    """Read a log up to `until` [s since the first GO], with the logs that it was resumed from.

    Raises InputError when the log cannot be replayed, when no robot was ever sent on its way, or
    when the log or the fleet's mission ends before `until`.
    """
    if path.is_dir():
        raise InputError([f"{path}: --until: takes the file of a log, not a folder"])
    newest = read_log(path)
    logs = [*logs_before(newest, str(path)), newest]
    before = [log.attachments[RESUMED] for log in logs[1:]]
    if logs[-1].is_recording:
        raise InputError([f"{path}: a listener's recording; only a coordinator's log can continue"])
    began_ns = first_go(logs, 0)
    if began_ns is None:
        raise InputError([f"{path}: --until: no robot was ever sent on its way"])
    until_ns = began_ns + round(until * SECOND)
    last_ns = [log.records[-1].log_ns for log in logs if log.records][-1]
    end = (last_ns - began_ns) / SECOND
    if until > end:
        raise InputError([f"{path}: --until: {until:g} s is after the end of the log, {end:.3f} s"])
    while len(logs) > 1 and (not logs[-1].records or logs[-1].records[0].log_ns > until_ns):
        logs.pop()
        before.pop()
    kept = [record for record in logs[-1].records if record.log_ns <= until_ns]
    if not kept:
        raise InputError([f"{path}: --until: {until:g} s is before the log's first message"])
    logs[-1] = replace(logs[-1], records=kept, complete=False)
    try:
        mission = mission_at_end(logs[-1])
    except InputError as error:
        raise InputError(
            [f"{path}: cannot be continued: {one}" for one in error.problems]
        ) from None
    if mission.fleet.phase == OVER:
        raise InputError([f"{path}: --until: the mission had ended by {until:g} s"])
    robots = _robots(logs, mission.fleet.members)
    return History(logs, before, until_ns, began_ns, mission, robots)


def _robots(logs: list[Log], fleet: Container[str]) -> dict[str, Known]:
    """Return what the logs say about the fleet's robots; messages of strangers are left out."""
    found: dict[str, Known] = {}
    for log in logs:
        for record in log.records:
            place = keys.split(record.key)
            if place is not None and place[1] in _SPOKEN and place[2] in fleet:
                _hear(found.setdefault(place[2], Known()), place[1], record)
    return found


def _hear(robot: Known, kind: str, record: Record) -> None:
    """Add to `robot` what one record says about it."""
    if kind == "alive":
        robot.linked = record.payload != LINK_GONE
        return
    message = decode(kind, record.payload)
    if isinstance(message, Hello):
        robot.heard_ns = record.log_ns
        if not robot.boots or robot.boots[-1][1].boot != message.boot:
            robot.boots.append((record.log_ns, message))
            robot.sequence = 0
    elif isinstance(message, Report):
        robot.heard_ns = record.log_ns
        robot.sequence = max(robot.sequence, message.sequence)
        if message.rest is not None:
            robot.rests.append((record.log_ns, message.rest))
