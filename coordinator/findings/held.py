"""Finds who had to slow down or stand because another robot was late or lost.

Decides: from when to when a robot counts as held, and by whom.  Must not know: files, the fleet
core.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from coordinator.findings.info_fields import HeldSummary
from coordinator.findings.log_proof import plans_of, take_messages
from coordinator.log.records import Log
from coordinator.plan.wire import packed
from coordinator.proof.granted import Granted
from coordinator.schedule.staircase_making import with_staircases
from protocol.messages import Command
from protocol.phases import GO
from protocol.timing import MILLISECOND


def late_numbers(command: Command) -> list[int]:
    """Return the robots whose authority ends before the plan time at which a Command was sent."""
    now_ms = (command.said_ns - command.start_ns) // MILLISECOND
    return [number for number, authority_ms in command.held if authority_ms < now_ms]


def held_in(log: Log, before: Sequence[Log], seconds: Callable[[int], float]) -> list[HeldSummary]:
    """Return who was held in a log, in the order of when it ended.

    `before`: the logs that the log resumes, oldest first.  `seconds` converts a time of the log
    [ns] to the time of the summary [s].
    """
    granted: dict[int, Granted] = {}
    logs = [*before, log]
    for document in plans_of(logs):
        plan = with_staircases(packed(document))
        assert plan.staircases is not None
        granted[document.epoch] = Granted(plan.staircases, list(plan.messages))
    since: dict[str, tuple[float, str]] = {}
    found: list[HeldSummary] = []

    def watch(command: Command, epoch: Granted, log_ns: int) -> None:
        now = seconds(log_ns)
        late = epoch.names(late_numbers(command) if command.phase == GO else [])
        in_range = set(epoch.names(range(command.first, command.last + 1)))
        for name in sorted((since.keys() & in_range) - set(late)):
            begin, by = since.pop(name)
            found.append(HeldSummary(name, by, round(begin, 3), round(now, 3)))
        for name in late:
            if name not in since and (holder := epoch.holder(name)) is not None:
                since[name] = now, holder

    for one in logs[:-1]:
        take_messages(one, granted)
    take_messages(log, granted, watch)
    end = seconds(log.records[-1].log_ns) if log.records else 0.0
    found += [
        HeldSummary(name, by, round(begin, 3), round(end, 3)) for name, (begin, by) in since.items()
    ]
    return found
