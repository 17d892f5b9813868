"""Finds who had to slow down or stand because another robot was late or lost.

Decides: from when to when a robot counts as held, and by whom.  Must not know: files, the fleet
core.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from coordinator.findings.granted_courses import granted_of
from coordinator.findings.info_fields import HeldSummary
from coordinator.findings.log_proof import Processes, plans_of, take_messages
from coordinator.log.records import Log
from coordinator.proof.granted import Granted
from protocol.messages import Command
from protocol.phases import GO
from protocol.timing import MILLISECOND


def late_numbers(command: Command) -> list[int]:
    """Return the robots whose authority ends before the plan time at which a Command was sent."""
    now_ms = (command.said_ns - command.start_ns) // MILLISECOND
    return [number for number, authority_ms in command.held if authority_ms < now_ms]


class Hold(NamedTuple):
    """A robot that another one holds, since when and until when [ns]; None: it is still held."""

    robot: str
    by: str
    since_ns: int
    until_ns: int | None = None


class Holds:
    """Who is held and who was, found from the Commands of a coordinator, in order."""

    def __init__(self) -> None:
        self.over: list[Hold] = []
        self._now: dict[str, Hold] = {}

    @property
    def all(self) -> list[Hold]:
        """All holds: those that are over, in the order of their ends, then the others."""
        return [*self.over, *self._now.values()]

    @property
    def now(self) -> list[Hold]:
        """Who is held now."""
        return list(self._now.values())

    def take(self, command: Command, epoch: Granted | None, now_ns: int) -> None:
        """Take in a Command; `epoch`: what its epoch's Commands have granted, this one included.

        Nobody is held by a Command other than GO, nor in an epoch that has granted nothing yet.
        """
        held, spoken_to = {}, set(self._now)
        if command.phase == GO and epoch is not None:
            late, spoken_to = epoch.names(late_numbers(command)), epoch.spoken_to(command)
            held = {name: by for name in late if (by := epoch.holder(name)) is not None}
        for name in sorted((self._now.keys() & spoken_to) - held.keys()):
            self.over.append(self._now.pop(name)._replace(until_ns=now_ns))
        for name, by in held.items():
            self._now.setdefault(name, Hold(name, by, now_ns))


def held_in(log: Log, before: Sequence[Log], seconds: Callable[[int], float]) -> list[HeldSummary]:
    """Return who was held in a log, in the order of when it ended.

    `before`: the logs that the log resumes, oldest first.  `seconds` converts a time of the log
    [ns] to the time of the summary [s].
    """
    granted = {document.epoch: granted_of(document) for document in plans_of([*before, log])}
    holds, processes = Holds(), Processes()
    for one in before:
        take_messages(one, granted, processes)
    take_messages(log, granted, processes, holds.take)
    end_ns = log.records[-1].log_ns if log.records else 0

    def time(at_ns: int | None) -> float:
        return round(seconds(end_ns if at_ns is None else at_ns), 3)

    return [
        HeldSummary(hold.robot, hold.by, time(hold.since_ns), time(hold.until_ns))
        for hold in holds.all
    ]
