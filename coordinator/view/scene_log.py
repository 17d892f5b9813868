"""Makes the scene of a log: its epochs in sequence, what went wrong, and who stayed behind.

Decides: when an epoch is shown, and which robots stayed behind.  findings/braking.py finds where a
robot is that has left its plan.  Must not know: files, black boxes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Final

import msgspec

from coordinator.base.errors import InputError
from coordinator.findings.braking import Said
from coordinator.findings.held import Hold
from coordinator.findings.info import summarise
from coordinator.findings.info_fields import FaultSummary, Summary
from coordinator.findings.plans_from_messages import RADIUS, plans_said
from coordinator.findings.traffic_numbers import clock_lag
from coordinator.fleet.log_records import adoption_key, request_of
from coordinator.fleet.rest_places import Standing
from coordinator.plan.document import PlanDocument
from coordinator.plan.plan_file import from_json, is_plan_name
from coordinator.plan.wire import Driven, drive
from coordinator.view.scene import Aside, Epoch, Halt, Held, Mark, Ride, Scene
from coordinator.view.scene_plan import index_of, rides_of, rounded_points, scene_from, zones_of
from protocol import keys
from protocol.codec import decode
from protocol.messages import Command, Report
from protocol.phases import DONE, FREEZE, GO, OVER
from protocol.timing import SECOND

if TYPE_CHECKING:
    from coordinator.log.records import Log, Record

_WHY: Final = {
    "arrived": "arrived",
    "lost": "lost",
    "unfit": "not fit",
    "overloaded": "course too long",
    "rests": "no way",
}
_NS: Final = 1 / SECOND
_LOST: Final = 2 * SECOND
"""A robot that no longer has a part and was not heard for this long [ns] is taken to be lost."""

_LONG: Final = SECOND
"""A robot that was held for this long [ns] is in the list of what happened."""


class Course:
    """The facts of one or several logs of the same fleet, in order; times in ns.

    whole: the epochs whose plans are complete because they come from a file.  Plans put together
    from messages may lack robots whose messages were not heard.
    """

    def __init__(self) -> None:
        self.plans: dict[int, PlanDocument] = {}
        self.whole: set[int] = set()
        self.begins: dict[int, int] = {}
        self.starts: dict[int, int] = {}
        self.frozen: dict[int, int] = {}
        self.over: int | None = None
        self.last = 0
        self.said = Said()
        self.told: dict[int, tuple[Standing, ...]] = {}
        self.faults: list[tuple[int, FaultSummary]] = []
        self.notes: list[str] = []
        self.held: list[Hold] = []

    def take(self, log: Log, name: str, before: Sequence[Log] = ()) -> None:
        """Add a log; raise InputError if a plan in it cannot be read.

        `before`: the logs that it resumes, oldest first.
        """
        for file, content in log.attachments.items():
            if is_plan_name(file):
                document = from_json(content, f"{name}: {file}")
                self.plans[document.epoch] = document
                self.whole.add(document.epoch)
        said = plans_said(log, self.plans, self.plans[min(self.plans)] if self.plans else None)
        self.plans |= said
        self.notes += [note for document in said.values() for note in document.notes]
        lag_ns = clock_lag(log)
        fleet = log.metadata.get("fleet", "")
        for record in log.records:
            self._take(record, fleet, lag_ns)
        if log.records:
            told = msgspec.convert(summarise(log, before=before), Summary)
            zero = log.records[0].log_ns - lag_ns + round((told.zero or 0.0) * SECOND)
            self.faults += [(zero + round(fault.t * SECOND), fault) for fault in told.faults]
            self.held += [
                Hold(one.robot, one.by, *(zero + round(t * SECOND) for t in (one.begin, one.until)))
                for one in told.held
            ]

    def take_command(self, command: Command, now_ns: int) -> None:
        """Add a Command of the coordinator.

        A coordinator that resumes from a log freezes the last epoch that started, but its Commands
        already have the number of a new epoch.
        """
        self.last = max(self.last, now_ns)
        if command.phase == FREEZE:
            self.frozen.setdefault(max(self.starts, default=command.epoch), now_ns)
            return
        self.begins.setdefault(command.epoch, now_ns)
        if command.phase == GO:
            self.starts.setdefault(command.epoch, command.start_ns)
            self.said.begin(command.epoch, command.start_ns)
        elif command.phase == OVER and self.over is None:
            self.over = now_ns

    def is_done(self, epoch: int, robot: str) -> bool:
        """Return whether a robot has reported that it arrived in an epoch."""
        return self.said.of(epoch, robot).phase == DONE

    def unheard(self) -> set[str]:
        """Return the robots that drove in some epoch although their plan for it was not heard."""
        return {
            name
            for epoch, document in self.plans.items()
            for name in self.said.who(epoch) - {robot.id for robot in document.robots}
            if epoch not in self.whole
        }

    def why_aside(self, epoch: int, robot: str) -> str:
        """Return why a robot has no part in an epoch's plan, as far as messages show."""
        if epoch not in self.whole and robot in self.said.who(epoch):
            return "plan not heard"
        if robot in self.said.done():
            return "arrived"
        last_ns = self.said.last_ns(robot)
        return "lost" if last_ns is None or self.last - last_ns > _LOST else "no way"

    def _take(self, record: Record, fleet: str, lag_ns: int) -> None:
        now_ns = record.log_ns - lag_ns
        if record.key == adoption_key(fleet):
            request = request_of(record.payload)
            if request is not None:
                self.told[request.epoch] = request.told
            return
        place = keys.split(record.key)
        if place is None or place[0] != fleet:
            return
        self.last = max(self.last, now_ns)
        message = decode(place[1], record.payload) if place[1] in ("command", "report") else None
        if isinstance(message, Command):
            self.take_command(message, now_ns)
        elif isinstance(message, Report):
            self.said.take(message, place[2], now_ns)


def scene_of_logs(logs: Sequence[tuple[str, Log]]) -> Scene:
    """Return the scene of a log, or of several logs in order, each resumed from the one before.

    logs: (name for messages, log).  Raise InputError if there is no plan in them.
    """
    course = Course()
    for number, (name, log) in enumerate(logs):
        course.take(log, name, [one for _, one in logs[:number]])
    if not course.plans:
        raise InputError([f"{logs[-1][0]}: holds no plan, so there is nothing to draw"])
    return msgspec.structs.replace(scene_of_course(course), notes=course.notes)


def scene_of_course(course: Course) -> Scene:
    """Return the scene of what is known so far; at least one plan must be known."""
    zero = min(course.starts.values(), default=min(course.begins.values(), default=0))
    documents = [document for _, document in sorted(course.plans.items())]
    others = dict.fromkeys(sorted(course.unheard()), RADIUS)
    index = index_of(documents, others)
    epochs = [
        _epoch(course, document, documents[0], index, zero)
        for document in documents
        if not course.begins or document.epoch in course.begins
    ]
    end = (course.last - zero) * _NS
    scene = scene_from(documents, epochs, "log", max(end, 1.0), others)
    return msgspec.structs.replace(
        scene,
        marks=list(_marks(course, epochs, zero, list(index))),
        held=list(_held(course, zero, index)),
    )


def _epoch(
    course: Course,
    document: PlanDocument,
    first: PlanDocument,
    index: Mapping[str, int],
    zero: int,
) -> Epoch:
    number = document.epoch
    begin = (course.begins.get(number, zero) - zero) * _NS
    start = (course.starts[number] - zero) * _NS if number in course.starts else begin
    frozen = (course.frozen[number] - zero) * _NS if number in course.frozen else None
    driven = drive(document)
    rides = rides_of(document, index, driven)
    if number in course.starts:
        rides = [
            _as_driven(course, number, one, ride) for one, ride in zip(driven, rides, strict=True)
        ]
    known = 0 if first.workspace is None else len(first.workspace.obstacles)
    floor = document.workspace
    return Epoch(
        epoch=number,
        begin=round(min(begin, start), 4),
        start=round(start, 4),
        started=number in course.starts,
        frozen=None if frozen is None else round(frozen, 4),
        arrived=all(course.is_done(number, robot.id) for robot in document.robots),
        rides=rides,
        aside=_aside(course, document, index),
        keep_out=[]
        if floor is None or document is first
        else [rounded_points(corners) for corners in floor.obstacles[known:]],
        zones=zones_of(document, index),
    )


def _aside(course: Course, document: PlanDocument, index: Mapping[str, int]) -> list[Aside]:
    """Return the robots that a plan leaves out, each with the latest known reason."""
    taking_part = {robot.id for robot in document.robots}
    why: dict[str, str] = {}
    for epoch, told in sorted(course.told.items()):
        if epoch <= document.epoch:
            why |= {standing.robot: _WHY[standing.state] for standing in told}
    return [
        Aside(robot=place, why=why.get(name) or course.why_aside(document.epoch, name))
        for name, place in index.items()
        if name not in taking_part
    ]


def _as_driven(course: Course, epoch: int, one: Driven, ride: Ride) -> Ride:
    """Return a ride with what the robot's reports tell: how late it was, where it left its plan."""
    line, rate = one.timeline, one.plan.brake_mmps2 / 1000.0
    words = course.said.of(epoch, one.id)
    frozen_ns, silent_ns = course.frozen.get(epoch), words.silent_since(course.last)
    end_ns = silent_ns if frozen_ns is None else frozen_ns
    progress, now, rate = words.driving(line, rate, course.starts[epoch], end_ns)
    halt: Halt | None = None
    if now < math.inf:
        place, speed = line.s_at(now), line.v_at(now)
        slowing = speed / rate if rate > 0.0 else 0.0
        rest = place + 0.5 * slowing * speed
        halt = (round(now, 5), round(now + slowing, 5), round(place, 5), round(rest, 5))
    passed = [(round(t, 3), round(p, 3)) for t, p in progress.knots]
    unheard = frozen_ns is None and silent_ns is not None
    return msgspec.structs.replace(ride, passed=passed, halt=halt, unheard=unheard)


def _held(course: Course, zero: int, index: Mapping[str, int]) -> Iterator[Held]:
    """Yield who was held, as far as both robots are known."""
    for hold in course.held:
        if hold.robot in index and hold.by in index:
            until = None if hold.until_ns is None else round((hold.until_ns - zero) * _NS, 3)
            yield Held(
                robot=index[hold.robot],
                by=index[hold.by],
                since=round((hold.since_ns - zero) * _NS, 3),
                until=until,
            )


def _marks(
    course: Course, epochs: Sequence[Epoch], zero: int, names: Sequence[str]
) -> Iterator[Mark]:
    """Yield what happened, in order of time; a fault comes before the freeze that it caused."""
    marks = [
        Mark(t=epoch.start, kind="go", text=f"epoch {epoch.epoch}: {len(epoch.rides)} robots go")
        for epoch in epochs
        if epoch.epoch in course.starts
    ]
    arrived = {epoch.epoch for epoch in epochs if epoch.arrived}
    done = course.said.done()
    left = ", ".join(name for name in names if name not in done)
    for number, at in course.frozen.items():
        kind, text = "freeze", "all robots must freeze"
        if number in arrived:
            without = f", without {left}" if left else ""
            kind, text = "over", f"all robots on their way have arrived{without}"
        marks.append(Mark(t=round((at - zero) * _NS, 3), kind=kind, text=text))
    marks += [
        Mark(t=round((at - zero) * _NS, 3), kind="fault", text=f"{fault.robot} {fault.fault}")
        for at, fault in course.faults
        if fault.kind != "freeze"
    ]
    marks += [
        Mark(
            t=round((hold.since_ns - zero) * _NS, 3),
            kind="late",
            text=f"{hold.robot} is held by {hold.by}",
        )
        for hold in course.held
        if (course.last if hold.until_ns is None else hold.until_ns) - hold.since_ns >= _LONG
    ]
    if course.over is not None:
        marks.append(Mark(t=round((course.over - zero) * _NS, 3), kind="over", text="over"))
    yield from sorted(marks, key=lambda mark: (round(mark.t, 1), mark.kind))
