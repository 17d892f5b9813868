"""What a log says of its robots up to a moment, and what the coordinator knew then.

Decides: where a log is cut, and whether it can be gone on from there.  Must not know: bodies,
links, virtual time.

The coordinator's part is exact: planner and fleet core are run again on what they heard, and have
to send every byte that the log says they sent.  Of the robots a log knows what they said: who they
are, where they rested, when they were last heard.
"""

from __future__ import annotations

from collections.abc import Container, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from msgspec.structs import replace

from coordinator.base.errors import InputError
from coordinator.fleet.log_records import LINK_GONE
from coordinator.fleet.mission import Mission
from coordinator.log.log_file import RESUMED, log_from_bytes, read_log
from coordinator.log.records import Log, Record
from coordinator.service.replay import run_again
from protocol import keys
from protocol.codec import decode
from protocol.messages import Command, Hello, Report, Rest
from protocol.phases import GO, OVER
from protocol.timing import REPORT_TIMEOUT, SECOND

_SPOKEN: Final = ("hello", "report", "alive")


@dataclass
class Known:
    """What a log says of one robot: times in ns on the coordinator's clock.

    boots: when it introduced itself anew, and as what; rests: where it said that it rests.
    """

    boots: list[tuple[int, Hello]] = field(default_factory=list)
    rests: list[tuple[int, Rest]] = field(default_factory=list)
    heard_ns: int = 0
    sequence: int = 0
    linked: bool = True

    def is_silent(self, now_ns: int) -> bool:
        """Tell whether the robot does nothing any more: its link is gone, or it is not heard."""
        return not self.linked or now_ns - self.heard_ns > 2 * REPORT_TIMEOUT


@dataclass(frozen=True)
class History:
    """A run up to `until_ns`: the logs, the last one cut there, and the mission as it was then.

    before: the bytes of the logs before the last.
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
    """Read a log up to `until` [s since the first GO], with those that it went on from.

    Raises InputError when the log cannot be run again, or nothing went or is left to do then.
    """
    logs, before = _chain(str(path), read_log(path))
    if logs[-1].metadata.get("passive") == "yes":
        raise InputError([f"{path}: was recorded from beside; only a coordinator's log goes on"])
    began_ns = _first_go(logs)
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
    mission, check = run_again(logs[-1])
    if mission is None or check.difference:
        raise InputError([f"{path}: cannot be gone on from: {check.difference}"])
    if mission.fleet.phase == OVER:
        raise InputError([f"{path}: --until: the fleet was over at {until:g} s"])
    robots = _robots(logs, mission.fleet.members)
    return History(logs, before, until_ns, began_ns, mission, robots)


def _chain(name: str, log: Log) -> tuple[list[Log], list[bytes]]:
    """Return a log behind those that it went on from, and the bytes of these."""
    data = log.attachments.get(RESUMED)
    if data is None:
        return [log], []
    inner = f"{name}: {RESUMED}"
    logs, before = _chain(inner, log_from_bytes(data, inner))
    return [*logs, log], [*before, data]


def _first_go(logs: list[Log]) -> int | None:
    """Return when the plan of the first epoch began [ns]."""
    for log in logs:
        for record in log.records:
            if record.key.endswith("/command"):
                command = decode("command", record.payload)
                if isinstance(command, Command) and command.phase == GO:
                    return command.start_ns
    return None


def _robots(logs: list[Log], fleet: Container[str]) -> dict[str, Known]:
    """Return what the logs say of the fleet's robots; strangers may have spoken too."""
    found: dict[str, Known] = {}
    for log in logs:
        for record in log.records:
            place = keys.split(record.key)
            if place is not None and place[1] in _SPOKEN and place[2] in fleet:
                _hear(found.setdefault(place[2], Known()), place[1], record)
    return found


def _hear(robot: Known, kind: str, record: Record) -> None:
    """Take down what one record says of a robot."""
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
