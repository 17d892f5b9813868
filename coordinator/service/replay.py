"""Run a log again: give the recorded inputs to the fleet core, and to the planner if asked to.

Every message to a robot in the log must be, byte for byte, what the core sends at that moment.  A
Command that is not the answer to another record marks a tick, and so does an `ahead` record.

To go on from a log, nothing is planned: the last checkpoint is read, and the records after it are
run again with the courses that they hold.  What is in force then is proven.

Decides: whether this code would have written the same log, and how to go on from one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from copy import deepcopy
from importlib.metadata import version
from typing import Final, NamedTuple

import msgspec

from coordinator.base.errors import InputError, PlanError
from coordinator.findings.log_proof import plans_of
from coordinator.fleet.events import Outgoing
from coordinator.fleet.log_records import (
    LINK_UP,
    CourseRequest,
    Request,
    Search,
    adoption_key,
    ahead_key,
    around_key,
    checkpoint_key,
    course_key,
    drops_key,
    is_checkpoint_key,
    request_of,
    router_key,
    search_of,
    told_key,
)
from coordinator.log.log_file import RESUMED, log_before
from coordinator.log.records import Log, Record
from coordinator.log.versions import WRITTEN_BY
from coordinator.mission.checkpoint import mission_of
from coordinator.mission.in_force import in_force_failures
from coordinator.mission.intake import Arrival
from coordinator.mission.mission import Mission
from coordinator.mission.mission_driver import Journal, MissionDriver
from coordinator.plan.document import PlanDocument
from coordinator.plan.plan_file import plan_name
from coordinator.plan.wire import PackedPlan, packed
from coordinator.scenario.changes import changes
from coordinator.scenario.model import Scenario
from coordinator.scenario_files.scenario_reader import parse_scenario
from coordinator.security.denials import denial_key
from coordinator.service.planning import plan_here
from protocol import keys
from protocol.codec import decode
from protocol.messages import Clock, Command
from protocol.phases import COMMAND_NAMES, OVER

_FEW: Final = 2


class Check(NamedTuple):
    """The outcome of a replay check; `difference` is empty if every byte agrees.

    `note` says what else a reader should know about a log that agrees.
    """

    plans: int
    commands: int
    difference: str
    note: str = ""


def check_log(log: Log) -> Check:
    """Run a log again and compare; describe the first difference with its place and time."""
    try:
        mission = _begin(log)
    except _NotAgainError as error:
        return _explained(Check(0, 0, str(error)), log)
    check = _compare(mission, log, log.records, searches=True)
    if check.difference:
        return check
    if not (check.commands or _resumes(log)):
        nothing = "no command" if check.plans else "no plan and no command"
        return check._replace(difference=f"the log holds {nothing}")
    if not log.complete:
        return check._replace(note="the log was not closed; all that it contains agrees")
    if not (mission.fleet.is_finished or mission.fleet.superseded):
        phase = COMMAND_NAMES[mission.fleet.phase]
        note = f"the log ends at {phase}, before the fleet had ended; all that it contains agrees"
        return check._replace(note=note)
    return check


def mission_at_end(log: Log) -> Mission:
    """Return the mission at the end of a log; nothing is planned if the log holds what was found.

    Raises InputError if the log cannot be run again from its last checkpoint.
    """
    try:
        mission, records = _newest(log)
    except _NotAgainError as error:
        raise InputError([_explained(Check(0, 0, str(error)), log).difference]) from None
    check = _compare(mission, log, records, searches=False)
    if check.difference:
        raise InputError([check.difference])
    return mission


def _compare(mission: Mission, log: Log, records: list[Record], *, searches: bool) -> Check:
    check = _Rerun(mission, log.attachments, searches).compare(records, log.complete)
    return _explained(check, log)


def _explained(check: Check, log: Log) -> Check:
    """Return the check; if it failed, say what else is known of the log that may be the cause."""
    if not check.difference:
        return check
    said = [*log.flaws, check.difference]
    wrote, ours = log.metadata.get(WRITTEN_BY, ""), version(WRITTEN_BY)
    if wrote not in ("", ours):
        why = f"splinefleet {wrote} wrote this log, and only that version reproduces its bytes"
        said.append(f"{why} (this is {ours})")
    return check._replace(difference="; ".join(said))


class _NotAgainError(Exception):
    """The log cannot be run again; the text says why."""


def scenario_of(log: Log) -> Scenario:
    """Return the scenario of a log; raise KeyError or InputError if the log has none."""
    return parse_scenario(log.attachments["scenario.json"], "scenario.json")


class _Head(NamedTuple):
    """What a log says of the run before its first record."""

    scenario: Scenario
    effort: int
    boot: int
    stays: bool

    @classmethod
    def of(cls, log: Log) -> _Head:
        try:
            effort, boot = int(log.metadata["effort"]), int(log.metadata["boot"])
            return cls(scenario_of(log), effort, boot, log.metadata.get("stays") == "yes")
        except (KeyError, ValueError, InputError) as error:
            reason = "; ".join(str(error).splitlines())
            raise _NotAgainError(f"the log lacks what planning it again needs: {reason}") from None

    def plan(self, scenario: Scenario, epoch: int) -> PackedPlan:
        """Plan a scenario for an epoch as the log's coordinator did."""
        return plan_here(scenario, self.effort, epoch)

    def begin(self, plan: PackedPlan) -> Mission:
        """Return the mission that begins with this plan."""
        return Mission.of_plan(self.scenario, plan, self.boot, self.plan, stays=self.stays)


def _begin(log: Log) -> Mission:
    """Return the mission as it was at the beginning of a log, everything before planned again."""
    head = _Head.of(log)
    if _resumes(log):
        if difference := check_log(_before(log)[0]).difference:
            raise _NotAgainError(f"{_name_of(log)}, which it resumes: {difference}")
        return _gone_on(log, head.boot)
    if log.records and is_checkpoint_key(log.records[0].key):
        return _at_checkpoint(head, log, 0)  # What was before it is not there any more.
    try:
        plan = head.plan(head.scenario, 1)
    except PlanError as error:
        raise _NotAgainError(f"the log's scenario cannot be planned now: {error}") from None
    recorded = log.attachments.get("plan-1.json", b"")
    if difference := _compare_documents("plan-1.json", recorded, plan.document):
        raise _NotAgainError(difference)
    return head.begin(plan)


def _newest(log: Log) -> tuple[Mission, list[Record]]:
    """Return the mission at the newest checkpoint of a log, or at its beginning, and what follows.

    Nothing is planned.
    """
    head = _Head.of(log)
    at = [k for k, record in enumerate(log.records) if is_checkpoint_key(record.key)]
    try:
        if at:
            return _at_checkpoint(head, log, at[-1]), log.records[at[-1] + 1 :]
        if _resumes(log):
            return _gone_on(log, head.boot), log.records
        return head.begin(packed(_plans(log)[1])), log.records
    except KeyError:
        raise _NotAgainError("the log lacks plan-1.json") from None
    except (InputError, PlanError) as error:
        raise _NotAgainError("; ".join(str(error).splitlines())) from None


def _resumes(log: Log) -> bool:
    """Return whether a log goes on from another one; its coordinator may have died at once."""
    return RESUMED in log.attachments or bool(log.before)


def _plans(log: Log) -> dict[int, PlanDocument]:
    return {plan.epoch: plan for plan in plans_of([log])}


def _at_checkpoint(head: _Head, log: Log, number: int) -> Mission:
    """Return the mission at a checkpoint, by the number of its record."""
    payload = log.records[number].payload
    try:
        return mission_of(payload, head.scenario, _plans(log), head.plan)
    except InputError as error:
        raise _NotAgainError("; ".join(error.problems)) from None


def _before(log: Log) -> tuple[Log, int]:
    """Return the log that a log resumes, and when it began to."""
    try:
        before, began_ns = log_before(log), int(log.metadata["began_ns"])
    except (KeyError, ValueError, InputError) as error:
        raise _NotAgainError(f"the log does not contain what it resumes from: {error}") from None
    assert before is not None
    return before, began_ns


def _name_of(log: Log) -> str:
    """Return words for the log that a log resumes."""
    return "the log before it" if log.before else RESUMED


def _gone_on(log: Log, boot: int) -> Mission:
    before, began_ns = _before(log)
    try:
        return go_on(before, boot, began_ns, _Head.of(log).scenario)
    except InputError as error:
        raise _NotAgainError(f"{_name_of(log)}, which it resumes: {error}") from None


def go_on(before: Log, boot: int, now_ns: int, scenario: Scenario | None = None) -> Mission:
    """Return the mission of a log, taken over by a coordinator that starts at `now_ns`.

    If the floor of `scenario` is not that of the log, the fleet freezes and is planned anew on it.
    Raises InputError if the log cannot be run again, its fleet has ended, what is in force at its
    end is not proven, or it has no records and resumes no other log.
    """
    if not (before.records or _resumes(before)):
        why = "it holds no message: nothing was under way, start a new run"
        raise InputError([f"the log cannot be resumed: {why}"])
    try:
        mission = mission_at_end(before)
    except InputError as error:
        raise InputError([f"the log cannot be resumed: {one}" for one in error.problems]) from None
    if mission.fleet.phase == OVER:
        raise InputError(["the fleet in this log has ended; nothing is left to do"])
    if failures := in_force_failures(mission):
        raise InputError([f"the log cannot be resumed: {one}" for one in failures])
    ended_ns = before.records[-1].log_ns if before.records else _before(before)[1]
    mission.take_over(boot, ended_ns, now_ns)
    if scenario is not None and changes(scenario_of(before), scenario):
        mission.change_floor(scenario.workspace, now_ns)
    return mission


def _compare_documents(name: str, recorded: bytes, document: PlanDocument) -> str:
    """Compare an attached plan with the plan found now, except for the planning times."""
    try:
        found = msgspec.json.decode(recorded)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return f"attachment {name} cannot be read"
    if not isinstance(found, dict):
        return f"attachment {name} is not a plan"
    expected = msgspec.json.decode(msgspec.json.encode(document))
    for key, value in expected.items():
        if key != "timing" and found.get(key) != value:
            return f"attachment {name}: {key} is not what the planner gives now"
    return ""


class _Rerun(Journal):
    """A mission's driver run over a log: its next record has to be the next one in the log.

    `searches`: whether courses are looked for again although the log holds what was found.
    """

    def __init__(self, mission: Mission, attachments: Mapping[str, bytes], searches: bool) -> None:
        self._driver = MissionDriver(mission, self, lambda _key, _payload: None, None)
        self._searches = searches
        self._fleet = mission.fleet
        self._attachments = attachments
        self._due: deque[Outgoing] = deque()
        self._plan_differs = ""
        self._sent: dict[str, int] = {"plan": 0, "command": 0}

    def record(self, key: str, payload: bytes, now_ns: int, sent_ns: int | None = None) -> None:
        """Note a record that has to come next in the log."""
        del now_ns, sent_ns  # They are those in the log.
        self._due.append(Outgoing(key, payload))

    def keep(self, document: PlanDocument) -> None:
        """Compare a plan with the one that is attached to the log."""
        name = plan_name(document.epoch)
        recorded = self._attachments.get(name)
        if recorded is not None:
            self._plan_differs = _compare_documents(name, recorded, document)

    def sync(self) -> bool:
        """Return True, because the log was written."""
        return True

    def hurry(self) -> None:
        """Do nothing, because nothing is written."""

    def compare(self, records: list[Record], complete: bool) -> Check:
        """Compare all records; a complete log must also contain all that the driver recorded."""
        begin = records[0].log_ns if records else 0
        for number, record in enumerate(records):
            problem = self._step(record)
            if problem:
                place = f"message {number} on {record.key}, {(record.log_ns - begin) / 1e9:.3f} s"
                return Check(self._sent["plan"], self._sent["command"], f"{place}: {problem}")
        if self._due and complete:
            problem = f"the log ends before what the core sends on {self._due[0].key}"
            return Check(self._sent["plan"], self._sent["command"], problem)
        return Check(self._sent["plan"], self._sent["command"], "")

    def _step(self, record: Record) -> str:
        """Give one record to the driver, or compare it with the driver's next record."""
        name = self._fleet.name
        if record.key in (drops_key(name), denial_key(name)):
            return ""
        kind = _kind(record.key)
        is_sent = _is_sent(kind, record.payload, self._fleet.boot)
        if not self._due:
            problem = self._feed(kind, is_sent, record)
            if problem:
                return problem
        elif kind and not is_sent:
            return f"the core first sends a message on {self._due[0].key}, which is not in the log"
        if not self._due:
            return "the core sends nothing here"
        expected = self._due.popleft()
        if expected.key != record.key:
            return f"the core sends on {expected.key} instead"
        if expected.payload != record.payload:
            return _first_difference(expected.payload, record.payload)
        if is_sent and kind in self._sent:
            self._sent[kind] += 1
        return ""

    def _feed(self, kind: str, is_sent: bool, record: Record) -> str:
        """Let the driver do what led to a record; return what is wrong, or an empty text."""
        name, now_ns = self._fleet.name, record.log_ns
        if record.key == adoption_key(name):
            return self._finish(request_of(record.payload), now_ns)
        if record.key == course_key(name):
            return self._finish_search(search_of(record.payload), now_ns)
        if record.key == checkpoint_key(name):
            self._driver.checkpoint(now_ns)
            return ""
        if record.key == router_key(name):
            self._driver.hear_router(record.payload == LINK_UP, now_ns)
        elif record.key == told_key(name):
            self._driver.tell(record.payload, now_ns)
        elif record.key in (ahead_key(name), around_key(name)) or (kind == "command" and is_sent):
            self._driver.look(now_ns)
        elif not is_sent:
            changed = self._is_tick(record) if kind == "command" else ""
            return changed or self._hear(record)
        return ""

    def _hear(self, record: Record) -> str:
        """Let the driver hear a message, through the intake like all messages."""
        intake = self._driver.intake
        intake.put(Arrival(record.key, record.payload, record.publish_ns))
        arrival = intake.take(record.log_ns)
        if arrival is None:
            return (
                "the coordinator drops this message: it is not for a coordinator, or one too many"
            )
        self._driver.hear(arrival, record.log_ns)
        return ""

    def _is_tick(self, record: Record) -> str:
        """Return how a Command from another boot id differs from what this coordinator sends here.

        A Command of another coordinator differs in the four bytes of its boot id.  One that differs
        in no more than _FEW bytes is this coordinator's own Command, changed in the log.
        """
        expected = deepcopy(self._fleet).tick(record.log_ns)
        payload = expected[0].payload if expected else b""
        if len(payload) != len(record.payload):
            return ""
        different = sum(a != b for a, b in zip(payload, record.payload, strict=True))
        return _first_difference(payload, record.payload) if different <= _FEW else ""

    def _finish_search(self, logged: Search | None, now_ns: int) -> str:
        """Put into effect what a search found, or search again."""
        asked = None if logged is None else logged.request
        if logged is None or logged.found is None or self._searches:
            return self._finish(asked, now_ns)
        if asked not in self._driver.under_way:
            return f"the core does not look for a course of {logged.robot} here"
        try:
            self._driver.take_found(logged.request, logged.found, now_ns)
        except ValueError as error:
            return f"{logged.robot} would refuse the course that was found: {error}"
        return ""

    def _finish(self, logged: Request | CourseRequest | None, now_ns: int) -> str:
        """Do a job again that the log says was done, and give its outcome to the driver."""
        under_way = self._driver.under_way
        if not under_way:
            return "the core requests no plan here"
        job = None if logged is None else under_way.get(logged)
        if job is None:
            if isinstance(logged, CourseRequest):
                return f"the core does not look for a course of {logged.robot} here"
            return "the robots do not stand where the log says"
        self._driver.finish(job, job.work(), now_ns)
        return self._plan_differs


def _kind(key: str) -> str:
    """Return the kind of a message's key; empty if the key is one of the coordinator's records."""
    place = keys.split(key)
    return "" if place is None else place[1]


def _is_sent(kind: str, payload: bytes, boot: int) -> bool:
    """Return whether this coordinator has sent a message."""
    message = decode(kind, payload) if kind in ("command", "clock") else None
    if isinstance(message, Clock):
        return message.received_ns is not None
    if isinstance(message, Command):
        return message.boot == boot
    return kind in ("plan", "orders", "blocks")


def _first_difference(expected: bytes, found: bytes) -> str:
    for place, (a, b) in enumerate(zip(expected, found, strict=False)):
        if a != b:
            return f"byte {place} is {b:#04x} in the log, {a:#04x} now"
    return f"{len(found)} bytes in the log, {len(expected)} now"
