"""Sums up a log: epochs, arrivals, waits, faults, bytes, and each robot's nearest other robot.

Decides: how a log is summed up.  Must not know: files (log/log_file.py and true_course.py read
them), what a plan should look like, or how the summary is shown (info_table.py).

All times are seconds from the time zero of the first epoch that got a GO, as in black boxes and on
the page; in a log without a GO, from its first message.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Final

import msgspec

from coordinator.findings.attendance import Attendance
from coordinator.findings.courses import Courses
from coordinator.findings.faults import Faults
from coordinator.findings.held import held_in, late_numbers
from coordinator.findings.info_fields import (
    EpochSummary,
    OrderSummary,
    PhaseChange,
    Summary,
    Traffic,
)
from coordinator.findings.plan_facts import (
    SentPlan,
    plans_sent,
    read_plans,
    take_message,
    take_plans,
)
from coordinator.findings.plans_from_messages import is_further
from coordinator.findings.strangers import strangers_in
from coordinator.findings.traffic_numbers import (
    Numbers,
    broadcast,
    busiest,
    clock_lag,
    every_start,
    first_go,
    is_own,
    is_question,
)
from coordinator.findings.true_course import TrueCourse, courses_in
from coordinator.fleet.log_records import (
    LINK_GONE,
    drops_of,
    is_adoption_key,
    is_drops_key,
    is_router_key,
)
from coordinator.log.versions import WRITTEN_BY, protocol_of
from coordinator.security.denials import denial_of, is_denial_key
from protocol import codec, keys, phases
from protocol.messages import (
    REFUSED,
    Admit,
    Block,
    Cancel,
    Command,
    Hello,
    Join,
    Leave,
    Message,
    Order,
    OrderState,
    Plan,
    Refusal,
    Report,
    Tell,
    Unblock,
)

if TYPE_CHECKING:
    from pathlib import Path

    from coordinator.log.records import Log, Record

_POINT_BYTES: Final = 8
_AT_ONCE: Final = 0.15
"""A hold that ends within this [s] of a freeze was ended by it."""
_Course = tuple[int, int, int]
"""A course of a robot: in which of its stays in the fleet, the epoch, and the revision."""

_NO_BOXES: Final[Mapping[str, TrueCourse]] = {}


def summarise(
    log: Log, boxes: Mapping[str, TrueCourse] = _NO_BOXES, before: Sequence[Log] = ()
) -> dict[str, object]:
    """Return the summary of a log as plain data, the fields of `Summary`.

    boxes: the robots' black boxes, as far as they are known; before: the logs that this one resumes
    from, oldest first.
    """
    summary: dict[str, object] = msgspec.to_builtins(_Telling(log, boxes, before).summary)
    return summary


def courses_of(
    log: Log, folders: Iterable[Path], before: Sequence[Log] = ()
) -> dict[str, TrueCourse]:
    """Return those black boxes of a log's robots that are in these folders.

    before: the logs that this one resumes from, oldest first; their robots count, too.  Raises
    InputError if a box cannot be read or is of another run.
    """
    every = {record.key for one in (*before, log) for record in one.records}
    places = (keys.split(key) for key in every)
    robots = {place[2] for place in places if place is not None and place[1] == "report"}
    lag_ns = clock_lag(log)
    go_ns = first_go([*before, log], lag_ns)
    zero_ns = None if go_ns is None else go_ns - lag_ns
    return courses_in(folders, sorted(robots), zero_ns, every_start([*before, log]))


class _Telling:
    """One pass through a log, which fills in the summary."""

    def __init__(self, log: Log, boxes: Mapping[str, TrueCourse], before: Sequence[Log]) -> None:
        records = log.records
        begin_ns = records[0].log_ns if records else 0
        self._epochs: dict[int, EpochSummary] = {}
        self._starts_ns: dict[int, int] = {}
        self._phase: tuple[int, int] | None = None
        self._asked: set[int] = set()
        """Boot ids of operators who asked to admit a robot: that they are refused is no fault."""

        self._sent: list[tuple[str, int, int]] = []
        self._last_arrival_ns: int | None = None
        self._late: str | None = None
        self._log, self._is_late = log, False
        self._ours: dict[str, tuple[int, int]] = {}
        self._lag_ns = clock_lag(log)
        self._before = before
        go_ns = first_go([*before, log], self._lag_ns)
        self._zero_ns = begin_ns if go_ns is None else go_ns
        self._numbers = Numbers(log, self._zero_ns)
        boots = {one.metadata.get("boot", "") for one in (*before, log)}
        self._courses = Courses(self._zero_ns, self._lag_ns, boots)
        self._plans = read_plans(log.attachments)
        self._present = Attendance(one.id for one in (self._plans[0].robots if self._plans else ()))
        self._strangers = strangers_in(log, before)
        self._orders: dict[str, OrderState] = {}
        self._arrived_by: dict[str, _Course] = {}
        """The course on which each robot has arrived last."""

        self._driven: dict[str, _Course] = {}
        """The newest course that each robot has said to drive."""

        self._arrived_before: dict[str, tuple[_Course, int]] = {}
        """In the logs before: the course on which each robot arrived last, and when [ns]."""

        self.summary = Summary(
            fleet=log.metadata.get("fleet", ""),
            policy=log.metadata.get("policy"),
            tau=None,
            duration=(records[-1].log_ns - begin_ns) / 1e9 if records else 0.0,
            complete=log.complete,
            damage=log.damage,
            messages=len(records),
            zero=None if go_ns is None else (go_ns - begin_ns) / 1e9,
            passive=log.is_recording,
            version=log.metadata.get(WRITTEN_BY),
            protocol=protocol_of(log.metadata),
        )
        last = dict[str, int]()
        for one in before:
            last = self._hear_before(one)
        heard = {robot: (begin_ns, phase) for robot, phase in last.items()}
        self._faults = Faults(self.summary, self._seconds, heard)
        for record in records:
            self._count(record)
        self.summary.epochs = list(self._epochs.values())
        self._take_plans()
        self._add_up(records[-1].log_ns if records else 0)
        self._courses.fill(self.summary.robots, boxes, self._stays())

    def _hear_before(self, log: Log) -> dict[str, int]:
        """Take in who was there, drove and arrived in a log before this one.

        Return the robots' last phases.
        """
        last: dict[str, int] = {}
        for record in log.records:
            place = keys.split(record.key)
            message = None if place is None else codec.decode(place[1], record.payload)
            if place is None or message is None or place[2] in self._strangers:
                continue
            robot = place[2]
            self._present.take(message, record.log_ns)
            self._courses.hear(message, robot, record)
            if isinstance(message, Report):
                last[robot], course = message.phase, self._course(message, robot)
                before = self._arrived_before.get(robot)
                if message.phase == phases.DONE and (before is None or before[0] != course):
                    self._arrived_before[robot] = course, record.log_ns
        return last

    def _course(self, report: Report, robot: str) -> _Course:
        """Return what a robot drives; its revisions begin anew with each of its stays."""
        return len(self._present.stays.get(robot, ())), report.epoch, report.revision

    def _stays(self) -> dict[str, list[tuple[float, float]]]:
        """Return from when until when [s] robots were in the fleet that joined or left."""
        return {
            robot: [
                (
                    -math.inf if one.since_ns is None else self._seconds(one.since_ns),
                    math.inf if one.until_ns is None else self._seconds(one.until_ns),
                )
                for one in stays
            ]
            for robot, stays in self._present.stays.items()
        }

    def _add_up(self, end_ns: int) -> None:
        """Fill in what is known at the end of the log: rates, lateness, latencies, broadcast."""
        told = self.summary
        for traffic in told.keys.values():
            if told.duration > 0.0:
                traffic.messages_per_second = traffic.messages / told.duration
                traffic.bytes_per_second = traffic.bytes / told.duration
        for name, robot in told.robots.items():
            is_last = self._arrived_by.get(name) == self._driven.get(name)
            if robot.arrived is not None and robot.planned_finish is not None and is_last:
                robot.late = robot.arrived - robot.planned_finish
        self._faults.end()
        self._numbers.fill(told)
        told.orders = [OrderSummary.of(state) for state in self._orders.values()]
        if self._is_late:
            told.held = held_in(self._log, self._before, self._seconds)
            self._tell_why_frozen()
        if self._starts_ns:
            first_ns, last_ns = min(self._starts_ns.values()), self._last_arrival_ns or end_ns
            if self._last_arrival_ns is not None:
                told.robot_payload_bytes_per_second = busiest(self._sent, first_ns, last_ns)
            seconds = max(last_ns - first_ns, 0) / 1e9
            told.broadcast = broadcast(told, self._ours, seconds)

    def _tell_why_frozen(self) -> None:
        """Add to each freeze whom robots were held by when it came."""
        for fault in self.summary.faults:
            if fault.kind == "freeze":
                by = {one.by for one in self.summary.held if abs(one.until - fault.t) < _AT_ONCE}
                if by:
                    fault.fault += f": others were held by {', '.join(sorted(by))}"

    def _take_plans(self) -> None:
        """Take facts of plans from the attachments, or from messages where none is attached.

        An epoch that goes on from the logs before has its plan in one of those.
        """
        told, of_before = self.summary, [read_plans(one.attachments) for one in self._before]
        known = {document.epoch for document in self._plans}
        earlier = {one.epoch: one for documents in of_before for one in documents}
        earlier = {n: one for n, one in earlier.items() if n in self._epochs and n not in known}
        plans = sorted([*earlier.values(), *self._plans], key=lambda document: document.epoch)
        sent, zeros = plans_sent(self._log, self._before, told.fleet)
        starts = {n: self._seconds(zeros[n] + self._lag_ns) for n in self._starts_ns if n in zeros}
        take_plans(told, plans, starts)
        if plans:
            told.tau = plans[0].tau
            told.policy = told.policy or plans[0].policy
        here = {one.robot for one in sent if one.is_here}
        for one in sent:
            self._take_sent(one, starts, is_attached=bool(plans), is_here=one.robot in here)
        sizes = [robot.plan_bytes for robot in told.robots.values()]
        told.largest_plan_bytes = max([told.largest_plan_bytes, *sizes])

    def _take_sent(
        self, sent: SentPlan, starts: dict[int, float], *, is_attached: bool, is_here: bool
    ) -> None:
        """Take facts of a course from its message, unless another course of its robot counts.

        is_here: whether the log itself holds a course of that robot.
        """
        plan, driven = sent.plan, self._driven.get(sent.robot)
        is_driven = driven is not None and driven[1:] == sent.course
        if is_further(plan) and is_driven and sent.start_ns is not None:
            zero = self._seconds(sent.start_ns + self._lag_ns)
            take_message(plan, self.summary.robot(sent.robot), zero)
        elif not is_further(plan) and not is_attached:
            self.summary.tau = plan.tau_ns / 1e9
            if plan.epoch in starts or not starts:
                take_message(plan, self.summary.robot(sent.robot), starts.get(plan.epoch, 0.0))
        if is_driven and not is_here:
            robot = self.summary.robot(sent.robot)
            robot.plan_bytes, robot.control_points = sent.size, len(plan.points) // _POINT_BYTES

    def _seconds(self, time_ns: int) -> float:
        return (time_ns - self._zero_ns) / 1e9

    def _count(self, record: Record) -> None:
        size = len(record.payload)
        traffic = self.summary.keys.setdefault(record.key, Traffic())
        traffic.messages += 1
        traffic.bytes += size
        self._take_own_record(record)
        address = keys.split(record.key)
        if address is None:
            self._count_stranger(record)
            return
        fleet, kind, robot = address
        self.summary.fleet = self.summary.fleet or fleet
        if fleet != self.summary.fleet:
            return
        if robot in self._strangers and kind != "orders":
            self._tell_refused(kind, robot, record)
            return
        if kind == "alive":
            self._tell_link(robot, record.payload != LINK_GONE, record.log_ns)
            return
        message = codec.decode(kind, record.payload)
        if message is None:
            self.summary.bad_messages += 1
            return
        self._present.take(message, record.log_ns)
        count, total = self._ours.get(kind, (0, 0))
        self._ours[kind] = (count + 1, total + size)
        if isinstance(message, Hello | Report) or is_question(message):
            self.summary.robot(robot).bytes_sent += size
            self._sent.append((robot, record.log_ns, size))
        elif isinstance(message, OrderState):
            if message.released_ms is not None or message.state != REFUSED:  # Else there is none.
                self._orders[message.id] = message
            return
        elif not isinstance(message, Order | Cancel | Tell | Block | Unblock | Join | Leave):
            self.summary.largest_message_to_robot_bytes = max(
                self.summary.largest_message_to_robot_bytes, size
            )
        self._numbers.hear(message, robot, record)
        self._courses.hear(message, robot, record)
        self._tell(message, robot, record)

    def _take_own_record(self, record: Record) -> None:
        """Take in a record that the coordinator wrote besides the messages."""
        if is_drops_key(record.key):
            self.summary.dropped |= drops_of(record.payload) or {}
        elif is_adoption_key(record.key):
            self._faults.find_unfit(record.payload, record.log_ns)
        elif is_router_key(record.key):
            self._faults.hear_router(record.payload, record.log_ns)

    def _tell_refused(self, kind: str, robot: str, record: Record) -> None:
        """Record a refusal that was sent to a stranger, and count the invalid messages it sent."""
        message = codec.decode(kind, record.payload)
        if isinstance(message, Refusal):
            self._faults.tell(record.log_ns, robot, message.reason, "refusal")
        self.summary.bad_messages += message is None and kind != "alive"

    def _count_stranger(self, record: Record) -> None:
        """Record a refused link; count payloads on the fleet's keys that are not messages."""
        denial = denial_of(record.payload) if is_denial_key(record.key) else None
        if denial is not None:
            self._faults.tell(record.log_ns, "", denial.text, "denied")
        if self.summary.fleet and record.key.startswith(f"{keys.ROOT}/{self.summary.fleet}/"):
            self.summary.positions_on_wire += 1

    def _tell(self, message: Message, robot: str, record: Record) -> None:
        if isinstance(message, Command):
            if is_own(self._log, message):
                self._tell_command(message, record.log_ns)
        elif isinstance(message, Report):
            self._tell_report(message, robot, record.log_ns)
        elif isinstance(message, Plan):
            size = len(record.payload)
            told = self.summary.robot(robot)
            told.plan_bytes = max(told.plan_bytes, size)
            told.control_points = len(message.points) // _POINT_BYTES
            self.summary.largest_plan_bytes = max(self.summary.largest_plan_bytes, size)
        elif isinstance(message, Admit):
            self._asked.add(message.boot)
        elif isinstance(message, Refusal) and message.boot not in self._asked:
            self._faults.tell(record.log_ns, robot, message.reason, "refusal")

    def _tell_command(self, command: Command, log_ns: int) -> None:
        self._is_late |= bool(late_numbers(command))
        self._faults.hear_coordinator(log_ns)
        if command.phase == phases.GO:
            self._faults.find_silent(log_ns, (phases.MOVING, phases.BRAKING))
        if self._phase == (command.epoch, command.phase):
            return
        self._phase = (command.epoch, command.phase)
        epoch = self._epochs.setdefault(command.epoch, EpochSummary(command.epoch))
        name = phases.COMMAND_NAMES[command.phase]
        epoch.phases.append(PhaseChange(self._seconds(log_ns), name))
        epoch.ended = self._ending(epoch, command.phase)
        if command.phase == phases.GO:
            self._starts_ns.setdefault(command.epoch, command.start_ns + self._lag_ns)
            epoch.start = self._seconds(self._starts_ns[command.epoch])
        if command.phase == phases.FREEZE and not self._numbers.stopped_nobody:
            everybody = set(range(len(phases.PHASE_NAMES)))
            self._faults.find_silent(log_ns, everybody - {phases.DONE})
            self._faults.tell(log_ns, "", "the fleet was told to freeze", "freeze")

    def _ending(self, epoch: EpochSummary, phase: int) -> str:
        """Return in what way an epoch ended, given the phase that ended it."""
        if phase == phases.FREEZE:
            return "arrived" if self._numbers.stopped_nobody else "frozen"
        if phase == phases.OVER:
            return "over" if epoch.start is not None else "nobody goes"
        return "running"

    def _tell_link(self, robot: str, alive: bool, log_ns: int) -> None:
        """Record the loss of a link while the fleet is under way."""
        is_under_way = self._phase is not None and self._phase[1] != phases.OVER
        if not alive and is_under_way and self._faults.lose_link(robot, log_ns):
            self._numbers.link_lost(robot, log_ns)

    def _tell_report(self, report: Report, robot: str, log_ns: int) -> None:
        told = self.summary.robot(robot)
        told.reports += 1
        if report.rest is not None and report.phase in (phases.MOVING, phases.BRAKING):
            self.summary.positions_on_wire += 1
        self._faults.hear_report(report, robot, log_ns)
        course = self._course(report, robot)
        if report.epoch in self._starts_ns:
            self._driven[robot] = max(self._driven.get(robot, course), course)
        if report.phase != phases.DONE or report.epoch not in self._starts_ns:
            return
        epoch = self._epochs[report.epoch]
        if robot not in epoch.arrivals or self._arrived_by.get(robot) != course:
            before, before_ns = self._arrived_before.get(robot, (course, log_ns))
            told.arrived = self._seconds(before_ns if before == course else log_ns)
            epoch.arrivals[robot] = told.arrived
            self._last_arrival_ns, self._arrived_by[robot] = log_ns, course
