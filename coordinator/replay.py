"""A log run again: the planner and the fleet core on the recorded inputs, byte for byte.

Decides: whether a log is what this code would have done.  Every message to a robot in the log must
be what the core sends at that moment; a Command that nothing else explains is a tick.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import msgspec

from coordinator.errors import InputError, PlanError
from coordinator.fleet import Fleet, Outgoing
from coordinator.logbook import Log, Record
from coordinator.muster import muster
from coordinator.plan import PlanDocument
from coordinator.planning import plan_here
from coordinator.scenario_file import parse_scenario
from protocol import keys
from protocol.codec import decode
from protocol.messages import Clock
from protocol.transport import Transport


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
    try:
        scenario = parse_scenario(log.attachments["scenario.json"], "scenario.json")
        effort, boot = int(log.metadata["effort"]), int(log.metadata["boot"])
    except (KeyError, ValueError, InputError) as error:
        reason = "; ".join(str(error).splitlines())
        return Check(0, 0, f"the log does not tell how it was planned: {reason}")
    try:
        document = plan_here(scenario, effort)
    except PlanError as error:
        return Check(0, 0, f"the log's scenario cannot be planned now: {error}")
    recorded = log.attachments.get("plan-1.json", b"")
    difference = _compare_documents(recorded, document)
    if difference:
        return Check(0, 0, difference)
    try:
        fleet = muster(document, boot)
    except PlanError as error:
        return Check(0, 0, str(error))
    check = _Rerun(fleet).compare(log.records)
    if check.difference:
        return check
    if not check.commands:
        nothing = "no command" if check.plans else "no plan and no command"
        return check._replace(difference=f"the log holds {nothing}")
    if not log.complete:
        return check._replace(note="the log was not closed; what is there agrees")
    return check


def _compare_documents(recorded: bytes, document: PlanDocument) -> str:
    """Compare the attached plan with the plan found now, but for how long it took."""
    try:
        found = msgspec.json.decode(recorded)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return "attachment plan-1.json cannot be read"
    if not isinstance(found, dict):
        return "attachment plan-1.json is not a plan"
    expected = msgspec.json.decode(msgspec.json.encode(document))
    for key, value in expected.items():
        if key != "timing" and found.get(key) != value:
            return f"attachment plan-1.json: {key} is not what the planner gives now"
    return ""


class _Rerun:
    def __init__(self, fleet: Fleet) -> None:
        self._fleet = fleet
        self._due: deque[Outgoing] = deque()
        self._sent: dict[str, int] = {"plan": 0, "command": 0}

    def compare(self, records: list[Record]) -> Check:
        begin = records[0].log_ns if records else 0
        for number, record in enumerate(records):
            problem = self._step(record)
            if problem:
                place = f"message {number} on {record.key}, {(record.log_ns - begin) / 1e9:.3f} s"
                return Check(self._sent["plan"], self._sent["command"], f"{place}: {problem}")
        return Check(self._sent["plan"], self._sent["command"], "")

    def _step(self, record: Record) -> str:
        """Feed one record to the core, or hold it against what the core sends."""
        place = keys.split(record.key)
        kind = "" if place is None else place[1]
        if not (kind in ("plan", "command") or (kind == "clock" and _is_answer(record.payload))):
            if self._due:
                return f"the core sends on {self._due[0].key} first, the log does not"
            self._due.extend(self._fleet.hear(record.key, record.payload, record.log_ns))
            return ""
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


def _is_answer(payload: bytes) -> bool:
    message = decode("clock", payload)
    return isinstance(message, Clock) and message.received_ns is not None


def _first_difference(expected: bytes, found: bytes) -> str:
    for place, (a, b) in enumerate(zip(expected, found, strict=False)):
        if a != b:
            return f"byte {place} is {b:#04x} in the log, {a:#04x} now"
    return f"{len(found)} bytes in the log, {len(expected)} now"


def play(
    log: Log,
    transport: Transport,
    wait_until: Callable[[float], None],
    speed: float,
) -> int:
    """Publish a log's messages again in time; returns how many.

    wait_until(seconds since the beginning) returns when that much time has passed.
    """
    if not log.records:
        return 0
    begin = log.records[0].log_ns
    for record in log.records:
        wait_until((record.log_ns - begin) / 1e9 / speed)
        transport.put(record.key, record.payload)
    return len(log.records)
