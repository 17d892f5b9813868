"""Proves a log: each epoch's plan and its staircases, the Plans sent, the authority granted.

Decides: which messages of a log belong to which epoch's proof.  Must not know: files, the fleet
core.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import msgspec

from coordinator.findings.granted_courses import GrantedCourses
from coordinator.findings.left_behind import LeftBehind
from coordinator.fleet.log_records import (
    ahead_ms,
    around_robot,
    is_ahead_key,
    is_around_key,
    is_course_key,
    search_of,
)
from coordinator.log.records import Log, Record
from coordinator.plan import plan_file
from coordinator.plan.document import PlanDocument, Proof
from coordinator.plan.wire import packed
from coordinator.proof.verify import prove_messages
from coordinator.scenario.model import Scenario
from coordinator.schedule.staircase_making import with_staircases
from protocol import keys
from protocol.codec import decode
from protocol.messages import Command, Hello, Message, Plan, Report
from protocol.phases import GO


class EpochProof(msgspec.Struct, frozen=True):
    """The proof of one epoch's plan, and whether what was sent was safe.

    `commands` states how many Commands granted authority, `courses` how many courses robots were
    sent after their first ones; `failures` says which Commands granted too much, which courses are
    not safe, and which Plans are not as proven.
    """

    epoch: int
    proof: Proof
    commands: int
    failures: list[str]
    courses: int = 0


class LogProof(msgspec.Struct, frozen=True, omit_defaults=True):
    """Whether the proofs of all epochs hold, and the logs are whole.

    `damage` says why messages may be missing that nobody can prove; it is empty if none are.
    """

    holds: bool
    epochs: list[EpochProof]
    damage: str = ""


def prove_log(log: Log, scenario: Scenario | None = None, before: Sequence[Log] = ()) -> LogProof:
    """Prove every plan that a log holds; check every Plan and Command that its coordinator sent.

    `scenario` is that of the first plan; later plans are proven from the log alone, because robots
    that stay behind are obstacles in them.  `before`: the logs that the log resumes, oldest first.
    Raises InputError if a plan cannot be read, and PartsError as proof.verify.prove_messages does.
    """
    proofs: dict[int, Proof] = {}
    granted: dict[int, GrantedCourses] = {}
    logs = [*before, log]
    for document in plans_of(logs):
        plan = with_staircases(packed(document))
        first = document.epoch == 1
        proofs[document.epoch] = prove_messages(plan, scenario if first else None)
        granted[document.epoch] = GrantedCourses(plan, prove=True)
    unknown, processes = set[int](), Processes()
    behind = LeftBehind(processes.places)
    for one in logs:
        unknown |= take_messages(one, granted, processes, behind.watch)
        number, until_ms = _said_ahead(one)
        if (newest := granted.get(number)) is not None:
            newest.lose_sight(until_ms)  # Its last Commands may not be in it.
    epochs = [
        EpochProof(number, proofs[number], found.commands, found.failures, found.courses)
        for number, found in granted.items()
    ]
    epochs += [EpochProof(number, _unproven(number), 0, []) for number in sorted(unknown)]
    damage = "; ".join(one.loss for one in logs if one.loss)
    safe = all(one.proof.holds and not one.failures for one in epochs)
    return LogProof(safe and not damage, epochs, damage)


def take_messages(
    log: Log,
    granted: Mapping[int, GrantedCourses],
    processes: Processes,
    watch: Callable[[Command, GrantedCourses, int], None] = lambda _command, _granted, _now: None,
) -> set[int]:
    """Let what was granted, by epoch, take in a log's Plans, Reports and coordinator's Commands.

    `processes`: those accepted by the end of the logs before it.  `watch` is called after each
    Command with its epoch and the time of the log [ns].  Returns the other epochs, in which robots
    were sent Plans or let drive.
    """
    fleet, boot = log.metadata.get("fleet", ""), log.metadata.get("boot", "")
    unknown: set[int] = set()
    begun = [one for one in granted.values() if one.commands]  # By a log that this one resumes.
    newest = begun[-1] if begun else None
    for record in log.records:
        place = keys.split(record.key)
        if newest is not None:
            _take_note(newest, record)
        if place is None or place[0] != fleet:
            continue
        message = decode(place[1], record.payload)
        if newest is not None:
            newest.take_roster(message)
        processes.take(place[2], message, record.log_ns)
        epoch = granted.get(getattr(message, "epoch", 0))
        if isinstance(message, Plan):
            if epoch is None:
                unknown.add(message.epoch)
            else:
                epoch.take_plan(place[2], message)
        elif isinstance(message, Report) and epoch is not None:
            if processes.may_be(place[2], message.boot):
                epoch.take_report(place[2], message)
        elif isinstance(message, Command) and str(message.boot) == boot:
            if epoch is not None:
                epoch.go_on_from(newest)
                newest = epoch
                epoch.take_command(message)
                watch(message, epoch, record.log_ns)
            elif message.phase == GO:
                unknown.add(message.epoch)
    return unknown


def _take_note(granted: GrantedCourses, record: Record) -> None:
    """Take in what the coordinator noted for itself: whom others go around, a course found."""
    if is_around_key(record.key):
        granted.go_around(around_robot(record.payload) or "")
    elif is_course_key(record.key) and (found := search_of(record.payload)) is not None:
        granted.take_search(found.robot, found.revision)


def _said_ahead(log: Log) -> tuple[int, int]:
    """Return a log's last epoch, and up to which plan time [ms] robots may be driving in it.

    That is 0 unless the last Command lets robots drive: another phase is on disk before it is said.
    """
    boot, until_ms = log.metadata.get("boot", ""), 0
    last: Command | None = None
    for record in log.records:
        if is_ahead_key(record.key):
            until_ms = ahead_ms(record.payload) or 0
            continue
        place = keys.split(record.key)
        said = decode(place[1], record.payload) if place and place[1] == "command" else None
        if isinstance(said, Command) and str(said.boot) == boot:
            last = said
    if last is None:
        return 0, 0
    return last.epoch, until_ms if last.phase == GO else 0


class _Asked(NamedTuple):
    boot: int
    log_ns: int


class Processes:
    """The process of each robot that the coordinator accepted: it answered its word with a Plan.

    The first log may begin after that; then any process may be the accepted one.
    """

    def __init__(self) -> None:
        self._asked: dict[str, _Asked] = {}
        self._accepted: dict[str, int] = {}
        self.places: dict[str, tuple[float, float]] = {}
        """By robot: where its newest program has said that it stands [m]."""

    def take(self, robot: str, message: Message | None, log_ns: int) -> None:
        """Take in what a robot said, or was sent, at a time of the log [ns]."""
        if isinstance(message, Hello) and message.place is not None:
            self.places[robot] = message.place[0] / 1000.0, message.place[1] / 1000.0
        if isinstance(message, Hello | Report):
            self._asked[robot] = _Asked(message.boot, log_ns)
        elif isinstance(message, Plan) and robot in self._asked:
            asked = self._asked.pop(robot)
            if asked.log_ns == log_ns:
                self._accepted[robot] = asked.boot

    def may_be(self, robot: str, boot: int) -> bool:
        """Return whether a process, by its boot id, may be the accepted one of a robot."""
        return self._accepted.get(robot, boot) == boot


def _unproven(epoch: int) -> Proof:
    """Return the proof of a plan that the log does not hold."""
    said = f"robots were sent Plans of epoch {epoch} or let drive; the log does not hold its plan"
    return Proof(
        holds=False,
        pairs=0,
        least_separation=None,
        least_clearance=None,
        survives=[],
        failures=[said],
    )


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
