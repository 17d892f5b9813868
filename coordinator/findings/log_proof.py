"""Proves a log: each epoch's plan and its staircases, the Plans sent, the authority granted.

Decides: which messages of a log belong to which epoch's proof.  Must not know: files, the fleet
core.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import msgspec

from coordinator.log.records import Log
from coordinator.plan import plan_file
from coordinator.plan.document import PlanDocument, Proof
from coordinator.plan.wire import packed
from coordinator.proof.granted import Granted
from coordinator.proof.verify import prove_messages
from coordinator.scenario.model import Scenario
from coordinator.schedule.staircase_making import with_staircases
from protocol import keys
from protocol.codec import decode
from protocol.messages import Command, Plan, Report


class EpochProof(msgspec.Struct, frozen=True):
    """The proof of one epoch's plan, and whether what was sent was safe.

    `commands` states how many Commands granted authority; `failures` says which of them granted too
    much, and which Plans are not as proven.
    """

    epoch: int
    proof: Proof
    commands: int
    failures: list[str]


class LogProof(msgspec.Struct, frozen=True):
    """Whether the proofs of all epochs hold."""

    holds: bool
    epochs: list[EpochProof]


def prove_log(log: Log, scenario: Scenario | None = None, before: Sequence[Log] = ()) -> LogProof:
    """Prove every plan that a log holds; check every Plan and Command that its coordinator sent.

    `scenario` is that of the first plan; later plans are proven from the log alone, because robots
    that stay behind are obstacles in them.  `before`: the logs that the log resumes, oldest first.
    Raises InputError if a plan cannot be read, and PartsError as proof.verify.prove_messages does.
    """
    proofs: dict[int, Proof] = {}
    granted: dict[int, Granted] = {}
    logs = [*before, log]
    for document in plans_of(logs):
        plan = with_staircases(packed(document))
        first = document.epoch == 1
        proofs[document.epoch] = prove_messages(plan, scenario if first else None)
        granted[document.epoch] = Granted(plan)
    for one in logs:
        take_messages(one, granted)
    epochs = [
        EpochProof(number, proofs[number], found.commands, found.failures)
        for number, found in granted.items()
    ]
    return LogProof(all(e.proof.holds and not e.failures for e in epochs), epochs)


def take_messages(
    log: Log,
    granted: Mapping[int, Granted],
    watch: Callable[[Command, Granted, int], None] = lambda _command, _granted, _now: None,
) -> None:
    """Let what was granted, by epoch, take in a log's Plans, Reports and coordinator's Commands.

    `watch` is called after each Command with its epoch and the time of the log [ns].
    """
    fleet, boot = log.metadata.get("fleet", ""), log.metadata.get("boot", "")
    for record in log.records:
        place = keys.split(record.key)
        if place is None or place[0] != fleet or place[1] not in ("plan", "command", "report"):
            continue
        message = decode(place[1], record.payload)
        epoch = granted.get(getattr(message, "epoch", 0))
        if epoch is None:
            continue
        if isinstance(message, Plan):
            epoch.take_plan(place[2], message)
        elif isinstance(message, Report):
            epoch.take_report(place[2], message)
        elif isinstance(message, Command) and str(message.boot) == boot:
            epoch.take_command(message)
            watch(message, epoch, record.log_ns)


def plans_of(logs: Iterable[Log]) -> list[PlanDocument]:
    """Return the plans that logs hold, by epoch.

    Raises InputError for a plan that cannot be read.
    """
    plans = {
        name: plan_file.from_json(data, name)
        for log in logs
        for name, data in log.attachments.items()
        if plan_file.is_plan_name(name)
    }
    return sorted(plans.values(), key=lambda one: one.epoch)
