"""Finds who had to slow down or stand because another robot was late or lost.

Decides: from when to when a robot counts as held, and by whom.  Must not know: files, the fleet
core.
"""

from __future__ import annotations

from collections.abc import Callable

from coordinator.findings.info_fields import HeldSummary
from coordinator.findings.log_proof import first_plans
from coordinator.log.records import Log
from coordinator.plan.wire import packed
from coordinator.proof.granted import Granted
from coordinator.schedule.staircase_making import with_staircases
from protocol import keys
from protocol.codec import decode
from protocol.messages import Command, Report
from protocol.phases import GO
from protocol.timing import MILLISECOND


def late_names(command: Command) -> list[str]:
    """Return the robots whose authority ends before the plan time at which a Command was sent."""
    now_ms = (command.said_ns - command.start_ns) // MILLISECOND
    return [name for name, authority_ms in command.held if authority_ms < now_ms]


def held_in(log: Log, seconds: Callable[[int], float]) -> list[HeldSummary]:
    """Return who was held in a log, in the order of when it ended.

    `seconds` converts a time of the log [ns] to the time of the summary [s].
    """
    fleet, boot = log.metadata.get("fleet", ""), log.metadata.get("boot", "")
    granted: dict[int, Granted] = {}
    for document in first_plans(log):
        plan = with_staircases(packed(document))
        assert plan.staircases is not None
        granted[document.epoch] = Granted(plan.staircases, list(plan.messages))
    since: dict[str, tuple[float, str]] = {}
    found: list[HeldSummary] = []
    now = 0.0

    def release(names: set[str]) -> None:
        for name in sorted(names & since.keys()):
            begin, by = since.pop(name)
            found.append(HeldSummary(name, by, round(begin, 3), round(now, 3)))

    for record in log.records:
        place = keys.split(record.key)
        if place is None or place[0] != fleet or place[1] not in ("command", "report"):
            continue
        message = decode(place[1], record.payload)
        epoch = granted.get(getattr(message, "epoch", 0))
        if epoch is not None and isinstance(message, Report):
            epoch.take_report(place[2], message)
        elif epoch is not None and isinstance(message, Command) and str(message.boot) == boot:
            now = seconds(record.log_ns)
            epoch.take_command(message)
            late = late_names(message) if message.phase == GO else []
            release(since.keys() - set(late))
            for name in late:
                if name not in since and (by := epoch.holder(name)) is not None:
                    since[name] = now, by
    release(set(since))
    return found
