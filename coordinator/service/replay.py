"""A log run again: the planner and the fleet core on the recorded inputs, byte for byte.

Decides: whether a log is what this code would have done.  Every message to a robot in the log must
be what the core sends at that moment; a Command that nothing else explains is a tick, and a tick
that said nothing has a record of its own.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from copy import deepcopy
from importlib.metadata import version
from typing import Final, NamedTuple

import msgspec

from coordinator.base.errors import InputError, PlanError
from coordinator.fleet.drop_record import drops_key
from coordinator.fleet.epoch_record import adoption_key, request_of
from coordinator.fleet.events import Outgoing
from coordinator.fleet.mission import Mission
from coordinator.fleet.tick_record import quiet_key
from coordinator.log.head import WRITTEN_BY
from coordinator.log.log_file import RESUMED, log_from_bytes
from coordinator.log.records import Log, Record
from coordinator.plan.document import PlanDocument
from coordinator.plan.plan_file import plan_name
from coordinator.scenario.model import Scenario
from coordinator.scenario_files.scenario_reader import parse_scenario
from coordinator.schedule.lateness import lateness_key, lateness_of
from coordinator.security.denials import denial_key
from coordinator.service.planning import plan_here
from protocol import keys
from protocol.codec import decode
from protocol.messages import Clock, Command
from protocol.phases import COMMAND_NAMES, OVER

_FEW: Final = 2


class Check(NamedTuple):
    """The outcome of a replay check; `difference` is empty when every byte agrees.

    `note` says what else should be known of a log that agrees.
    """

    plans: int
    commands: int
    difference: str
    note: str = ""


def check_log(log: Log) -> Check:
    """Run a log again and compare; the first difference is told with its place and time."""
    mission, check = run_again(log)
    if check.difference:
        return check
    if not check.commands:
        nothing = "no command" if check.plans else "no plan and no command"
        return check._replace(difference=f"the log holds {nothing}")
    if not log.complete:
        return check._replace(note="the log was not closed; what is there agrees")
    if mission is not None and not (mission.fleet.is_finished or mission.fleet.superseded):
        phase = COMMAND_NAMES[mission.fleet.phase]
        note = f"the log ends at {phase}, before the fleet was over; what is there agrees"
        return check._replace(note=note)
    return check


def run_again(log: Log) -> tuple[Mission | None, Check]:
    """Return the mission as it was when the log ended, and whether it went as the log says."""
    try:
        mission = _begin(log)
    except _NotAgainError as error:
        return None, _by_version(Check(0, 0, str(error)), log)
    check = _Rerun(mission, log.attachments).compare(log.records, log.complete)
    return mission, _by_version(check, log)


def _by_version(check: Check, log: Log) -> Check:
    """Return the check, with the version that wrote the log where another finds a difference."""
    wrote, ours = log.metadata.get(WRITTEN_BY, ""), version(WRITTEN_BY)
    if not check.difference or wrote in ("", ours):
        return check
    why = f"splinefleet {wrote} wrote this log, and only that version finds its bytes again"
    return check._replace(difference=f"{check.difference}; {why} (this is {ours})")


class _NotAgainError(Exception):
    """A log cannot be run again; the text says why."""


def scenario_of(log: Log) -> Scenario:
    """Return the scenario of a log; KeyError or InputError when it holds none."""
    return parse_scenario(log.attachments["scenario.json"], "scenario.json")


def _begin(log: Log) -> Mission:
    """Return the mission with which a log begins."""
    try:
        scenario = scenario_of(log)
        effort, boot = int(log.metadata["effort"]), int(log.metadata["boot"])
    except (KeyError, ValueError, InputError) as error:
        reason = "; ".join(str(error).splitlines())
        raise _NotAgainError(f"the log does not tell how it was planned: {reason}") from None
    if RESUMED in log.attachments:
        return _resumed(log, boot)
    try:
        document = plan_here(scenario, effort)
    except PlanError as error:
        raise _NotAgainError(f"the log's scenario cannot be planned now: {error}") from None
    recorded = log.attachments.get("plan-1.json", b"")
    difference = _compare_documents("plan-1.json", recorded, document)
    if difference:
        raise _NotAgainError(difference)
    return Mission(scenario, document, boot, lambda s, epoch: plan_here(s, effort, epoch))


def _resumed(log: Log, boot: int) -> Mission:
    """Return the mission of a log that goes on from another, which it holds."""
    try:
        began_ns = int(log.metadata["began_ns"])
        before = log_from_bytes(log.attachments[RESUMED], RESUMED)
    except (KeyError, ValueError, InputError) as error:
        raise _NotAgainError(f"the log does not tell what it goes on from: {error}") from None
    try:
        return go_on(before, boot, began_ns)
    except InputError as error:
        raise _NotAgainError(f"{RESUMED}, which it goes on from: {error}") from None


def go_on(before: Log, boot: int, now_ns: int) -> Mission:
    """Return the mission of a log, taken over by a coordinator that starts now.

    Raises InputError when the log cannot be run again, or holds nothing to go on with.
    """
    mission, check = run_again(before)
    if mission is None or check.difference or not before.records:
        why = check.difference or "it holds no message; nothing was under way, start anew"
        raise InputError([f"the log cannot be gone on from: {why}"])
    if mission.fleet.phase == OVER:
        raise InputError(["the fleet in this log has ended; nothing is left to do"])
    mission.take_over(boot, before.records[-1].log_ns, now_ns)
    return mission


def _compare_documents(name: str, recorded: bytes, document: PlanDocument) -> str:
    """Compare the attached plan with the plan found now, but for how long it took."""
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


class _Rerun:
    def __init__(self, mission: Mission, attachments: Mapping[str, bytes]) -> None:
        self._mission = mission
        self._fleet = mission.fleet
        self._attachments = attachments
        self._due: deque[Outgoing] = deque()
        self._sent: dict[str, int] = {"plan": 0, "command": 0}

    def compare(self, records: list[Record], complete: bool) -> Check:
        """Go through the records; a log that is complete does not end before what is due."""
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
        """Feed one record to the core, or hold it against what the core sends."""
        if record.key == adoption_key(self._fleet.name):
            return self._adopt(record)
        if record.key == lateness_key(self._fleet.name):
            return self._retime(record)
        if record.key == quiet_key(self._fleet.name):
            self._due.extend(self._fleet.tick(record.log_ns))
            return f"the core sends on {self._due[0].key} here" if self._due else ""
        if record.key in (drops_key(self._fleet.name), denial_key(self._fleet.name)):
            return ""
        place = keys.split(record.key)
        kind = "" if place is None else place[1]
        if not _is_sent(kind, record.payload, self._fleet.boot) or (
            kind == "clock" and not self._due
        ):
            return self._hear(kind, record)
        if not self._due and kind == "command":
            self._due.extend(self._fleet.tick(record.log_ns))
        if not self._due:
            return "the core sends nothing here"
        expected = self._due.popleft()
        if expected.key != record.key:
            return f"the core sends on {expected.key} instead"
        if expected.payload != record.payload:
            return _first_difference(expected.payload, record.payload)
        if kind in self._sent:
            self._sent[kind] += 1
        return ""

    def _hear(self, kind: str, record: Record) -> str:
        """Feed what the coordinator did not send to the core."""
        if self._due:
            return f"the core sends on {self._due[0].key} first, the log does not"
        if kind == "command" and (changed := self._is_tick(record)):
            return changed
        self._due.extend(self._fleet.hear(record.key, record.payload, record.log_ns))
        return ""

    def _is_tick(self, record: Record) -> str:
        """Say where a Command that is not this coordinator's is nevertheless what it ticks.

        Another's has another boot id, of four bytes; fewer different ones were changed in the log.
        """
        expected = deepcopy(self._fleet).tick(record.log_ns)
        payload = expected[0].payload if expected else b""
        if len(payload) != len(record.payload):
            return ""
        different = sum(a != b for a, b in zip(payload, record.payload, strict=True))
        return _first_difference(payload, record.payload) if different <= _FEW else ""

    def _adopt(self, record: Record) -> str:
        """Plan again where the log has a new epoch begin."""
        request = self._mission.request(record.log_ns)
        if self._due or request is None:
            return "the core does not begin a new epoch here"
        if request != request_of(record.payload):
            return "the robots do not stand where the log says"
        recovery = self._mission.solve(request)
        self._due.extend(self._mission.adopt(request, recovery, record.log_ns) or [])
        return self._compare_plan(recovery.document)

    def _retime(self, record: Record) -> str:
        """Look for new times again where the log has them."""
        late = lateness_of(record.payload)
        if self._due or late is None or late != self._mission.late():
            return "the core does not ask for new times here"
        document = self._mission.retime(late)
        self._due.extend(self._mission.take_times(late, document, record.log_ns) or [])
        return self._compare_plan(document)

    def _compare_plan(self, document: PlanDocument | None) -> str:
        """Hold a plan against the one that is attached."""
        if document is None:
            return ""
        name = plan_name(document.epoch, document.revision)
        recorded = self._attachments.get(name)
        return "" if recorded is None else _compare_documents(name, recorded, document)


def _is_sent(kind: str, payload: bytes, boot: int) -> bool:
    """Tell whether a message is one that this coordinator has sent."""
    message = decode(kind, payload) if kind in ("command", "clock") else None
    if isinstance(message, Clock):
        return message.received_ns is not None
    if isinstance(message, Command):
        return message.boot == boot
    return kind == "plan"


def _first_difference(expected: bytes, found: bytes) -> str:
    for place, (a, b) in enumerate(zip(expected, found, strict=False)):
        if a != b:
            return f"byte {place} is {b:#04x} in the log, {a:#04x} now"
    return f"{len(found)} bytes in the log, {len(expected)} now"
