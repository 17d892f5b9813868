"""Proves a log: the plan of every epoch, its staircases, and every authority that was granted.

Decides: which messages of a log belong to which epoch's proof.  Must not know: files, the fleet
core.
"""

from __future__ import annotations

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
from protocol.messages import Command, Report


class EpochProof(msgspec.Struct, frozen=True):
    """The proof of one epoch's plan, and whether its Commands granted no more than is safe.

    `commands` states how many of them granted authority; `failures` says which granted too much.
    """

    epoch: int
    proof: Proof
    commands: int
    failures: list[str]


class LogProof(msgspec.Struct, frozen=True):
    """Whether the proofs of all epochs hold."""

    holds: bool
    epochs: list[EpochProof]


def prove_log(log: Log, scenario: Scenario | None = None) -> LogProof:
    """Prove every plan that a log holds and check every Command that its coordinator sent.

    `scenario` is that of the first plan; later plans are proven from the log alone, because robots
    that stay behind are obstacles in them.  Raises PartsError as proof.verify.prove_messages does.
    """
    fleet, boot = log.metadata.get("fleet", ""), log.metadata.get("boot", "")
    proofs: dict[int, Proof] = {}
    granted: dict[int, Granted] = {}
    for document in first_plans(log):
        plan = with_staircases(packed(document))
        assert plan.staircases is not None
        first = document.epoch == 1
        proofs[document.epoch] = prove_messages(plan, scenario if first else None)
        names = [robot.id for robot in document.robots]
        granted[document.epoch] = Granted(plan.staircases, names)
    for record in log.records:
        place = keys.split(record.key)
        if place is None or place[0] != fleet or place[1] not in ("command", "report"):
            continue
        message = decode(place[1], record.payload)
        epoch = granted.get(getattr(message, "epoch", 0))
        if epoch is None:
            continue
        if isinstance(message, Report):
            epoch.take_report(place[2], message)
        elif isinstance(message, Command) and str(message.boot) == boot:
            epoch.take_command(message)
    epochs = [
        EpochProof(number, proofs[number], one.commands, one.failures)
        for number, one in granted.items()
    ]
    return LogProof(all(one.proof.holds and not one.failures for one in epochs), epochs)


def first_plans(log: Log) -> list[PlanDocument]:
    """Return the plan with which each epoch began; new times (`revision`) end its authority.

    Raises InputError for a plan that cannot be read.
    """
    plans = [
        plan_file.from_json(data, name)
        for name, data in log.attachments.items()
        if plan_file.is_plan_name(name)
    ]
    return sorted((one for one in plans if one.revision == 0), key=lambda one: one.epoch)
