"""Makes the scene of a log: its epochs in sequence, what went wrong, and who stayed behind.

Decides: when an epoch is shown, since when a robot drives a course, and which robots stayed
behind.  findings/braking.py finds where a robot is that has left its plan.  Must not know: files,
black boxes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

import msgspec

from coordinator.base.errors import InputError
from coordinator.findings.braking import Said
from coordinator.findings.held import Hold
from coordinator.findings.info import summarise
from coordinator.findings.info_fields import FaultSummary, Summary
from coordinator.findings.plans_from_messages import RADIUS, is_further, plans_said
from coordinator.findings.traffic_numbers import clock_lag
from coordinator.fleet.log_records import (
    adoption_key,
    around_robot,
    is_around_key,
    request_of,
)
from coordinator.fleet.rest_places import Standing
from coordinator.log.log_writer import VIRTUAL, WALL_OFFSET
from coordinator.plan.document import PlanDocument
from coordinator.plan.plan_file import from_json, is_plan_name
from coordinator.plan.wire import Driven, drive
from coordinator.view.scene import Aside, Epoch, Halt, Held, Mark, Ride, Scene, Stop, Zone
from coordinator.view.scene_courses import SentCourse, SentCourses
from coordinator.view.scene_orders import SaidOrders
from coordinator.view.scene_plan import index_of, rides_of, rounded_points, scene_from, zones_of
from protocol import keys
from protocol.codec import decode
from protocol.messages import Command, Hello, Join, Message, OrderState, Plan, Report
from protocol.phases import DONE, FREEZE, GO, OVER, STOP
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

_KINDS: Final = ("command", "hello", "orders", "plan", "report", "roster")
"""The kinds of messages that a scene is made of."""


class _Stood(NamedTuple):
    """A time in which an epoch's plan stood [ns]; `late_ns`: by how much it is put off since.

    is_told: whether an operator stopped the fleet; otherwise a coordinator had died.
    """

    since_ns: int
    until_ns: int | None
    late_ns: int
    is_told: bool


class _Drawn(NamedTuple):
    """A plan as it is drawn with these indices of the robots."""

    document: PlanDocument
    indices: Mapping[str, int]
    driven: list[Driven]
    rides: list[Ride]
    zones: list[Zone]


class Course:
    """The facts of one or several logs of the same fleet, in order; times in ns.

    whole: the epochs whose plans are complete because they come from a file.  Plans put together
    from messages may lack robots whose messages were not heard.
    begin: nothing before this time [ns] is shown any more, None for all.
    """

    def __init__(self) -> None:
        self.plans: dict[int, PlanDocument] = {}
        self.whole: set[int] = set()
        self.begins: dict[int, int] = {}
        self.starts: dict[int, int] = {}
        self.frozen: dict[int, int] = {}
        self.over: int | None = None
        self.begin: int | None = None
        self.last = 0
        self.said = Said()
        self.sent = SentCourses()
        self.orders = SaidOrders()
        self.radii: dict[str, float] = {}
        self.stood: dict[int, list[_Stood]] = {}
        self._heard_ns = 0
        self._drawn: dict[int, _Drawn] = {}
        self.told: dict[int, tuple[Standing, ...]] = {}
        self.faults: list[tuple[int, FaultSummary]] = []
        self.news: list[tuple[int, str, str, str]] = []
        """What became of robots that were lost: when, who, what in words, the kind of its mark."""

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
        self._take_stop(command, now_ns)
        if command.phase == FREEZE:
            self.frozen.setdefault(max(self.starts, default=command.epoch), now_ns)
            return
        self.begins.setdefault(command.epoch, now_ns)
        is_stopped = command.phase == STOP and command.epoch not in self.starts
        if command.phase == GO or is_stopped:
            self.starts.setdefault(command.epoch, command.start_ns)
            self.said.begin(command)
        elif command.phase == OVER and self.over is None:
            self.over = now_ns

    def _take_stop(self, command: Command, now_ns: int) -> None:
        """Add that the plan stands, or goes on later than planned."""
        stood, before_ns = self.stood.setdefault(command.epoch, []), self._heard_ns
        self._heard_ns = now_ns
        since_ns, until_ns, late_ns, _ = stood[-1] if stood else _Stood(0, 0, 0, False)
        first_ns = self.starts.get(command.epoch)
        if command.phase == STOP and until_ns is not None:
            stood.append(_Stood(now_ns, None, late_ns, True))
        elif command.phase == GO and first_ns is not None:
            put_off = command.start_ns - first_ns
            if until_ns is None:
                stood[-1] = _Stood(since_ns, now_ns, put_off, True)
            elif put_off > late_ns:
                stood.append(_Stood(before_ns, now_ns, put_off, False))

    def take_plan(self, plan: Plan, now_ns: int) -> bool:
        """Add a further course; return whether it is a new one."""
        known = self.plans.get(plan.epoch)
        radii = {} if known is None else {robot.id: robot.radius for robot in known.robots}
        radius = radii.get(plan.robot) or self.radii.get(plan.robot, RADIUS)
        return is_further(plan) and self.sent.take(plan, radius, now_ns)

    def zero_ns(self) -> int:
        """Return the time [ns] that counts as 0: the first GO.

        Who listens since later knows when the plan would have begun without the pauses before that.
        Orders were accepted, and done, some time after the first GO, which so was earlier.
        """
        heard = min(self.starts.values(), default=min(self.begins.values(), default=0))
        return min(heard, self.orders.went_ns)

    def is_done(self, epoch: int, robot: str) -> bool:
        """Return whether a robot has reported that it is at the goal of its newest course."""
        return self.said.newest(epoch, robot).phase == DONE

    def forget(self, before_ns: int) -> None:
        """Forget courses that robots had left by a time, and orders that were over then.

        Nothing before that time is shown.
        """
        self.begin = before_ns
        self.orders.forget(before_ns)
        for epoch, start_ns in self.starts.items():
            before = (before_ns - start_ns) * _NS
            for one in self.sent.of(epoch):
                name, revision = one.driven.id, one.driven.plan.revision
                since = one.since(self.said.of(epoch, name, revision))
                if since is not None and since <= before:
                    self.sent.forget(epoch, name, revision)
                    self.said.forget(epoch, name, revision)

    def told_at(self, sent: SentCourse) -> float:
        """Return when a course was sent, as a time of its plan [s]."""
        return (sent.told_ns - self.starts[sent.driven.plan.epoch]) * _NS

    def drawn(self, document: PlanDocument, index: Mapping[str, int]) -> _Drawn:
        """Return a plan as it is drawn; it is drawn anew only if something has changed."""
        found = self._drawn.get(document.epoch)
        if found is None or found.document is not document or found.indices != index:
            driven = drive(document)
            rides = rides_of(document, index, driven)
            found = _Drawn(document, index, driven, rides, zones_of(document, index))
            self._drawn[document.epoch] = found
        return found

    def unheard(self) -> set[str]:
        """Return the robots that drove in some epoch although their plan for it was not heard."""
        return {
            name
            for epoch, document in self.plans.items()
            for name in self.said.who(epoch) - self.takes_part(document)
            if epoch not in self.whole
        }

    def takes_part(self, document: PlanDocument) -> set[str]:
        """Return the robots of which a course is known in a plan's epoch."""
        joined = {one.driven.id for one in self.sent.of(document.epoch)}
        return {robot.id for robot in document.robots} | joined

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
        if is_around_key(record.key) and (robot := around_robot(record.payload)) is not None:
            self.news.append((now_ns, robot, f"others go around {robot}", "late"))
            return
        place = keys.split(record.key)
        if place is None or place[0] != fleet:
            return
        self.last = max(self.last, now_ns)
        message = decode(place[1], record.payload) if place[1] in _KINDS else None
        if isinstance(message, Command):
            self.take_command(message, now_ns)
        elif isinstance(message, Report):
            self.said.take(message, place[2], now_ns)
        elif isinstance(message, Plan):
            self.take_plan(message, now_ns)
        elif isinstance(message, OrderState):
            self.orders.take(message, now_ns)
        else:
            self.take_radius(message, place[2])

    def take_radius(self, message: Message | None, robot: str) -> None:
        """Take in the radius that a robot states, or an operator for one that joins."""
        if isinstance(message, Hello) and message.radius_m > 0.0:
            self.radii[robot] = message.radius_m
        elif isinstance(message, Join):
            self.radii[message.robot] = message.radius_m


def scene_of_logs(logs: Sequence[tuple[str, Log]]) -> Scene:
    """Return the scene of a log, or of several logs in order, each resumed from the one before.

    logs: (name for messages, log).  Raise InputError if there is no plan in them.
    """
    course = Course()
    for number, (name, log) in enumerate(logs):
        course.take(log, name, [one for _, one in logs[:number]])
    if not course.plans:
        raise InputError([f"{logs[-1][0]}: holds no plan, so there is nothing to draw"])
    day, speed = _time_of_day(logs[0][1], course.zero_ns())
    scene = scene_of_course(course)
    return msgspec.structs.replace(scene, notes=course.notes, day=day, speed=speed)


def _time_of_day(log: Log, zero_ns: int) -> tuple[float | None, float]:
    """Return the time of the day at time 0 [ms since 1970], and the speed of the fleet's clock."""
    if not log.records or WALL_OFFSET not in log.metadata or VIRTUAL in log.metadata:
        return None, 1.0
    try:
        speed = float(log.metadata.get("speed", "1"))
        wall_ns = int(log.metadata[WALL_OFFSET]) + log.records[0].log_ns
        passed_ns = (zero_ns + clock_lag(log) - log.records[0].log_ns) / speed
    except (ValueError, ZeroDivisionError):
        return None, 1.0
    return round((wall_ns + passed_ns) / 1e6, 1), speed


def scene_of_course(course: Course) -> Scene:
    """Return the scene of what is known so far; at least one plan must be known."""
    zero = course.zero_ns()
    documents = [document for _, document in sorted(course.plans.items())]
    others = course.sent.radii()
    others |= {name: course.radii.get(name, RADIUS) for name in sorted(course.unheard())}
    index = index_of(documents, others)
    epochs = [
        _epoch(course, document, documents[0], index, zero)
        for document in documents
        if not course.begins or document.epoch in course.begins
    ]
    end = (course.last - zero) * _NS
    begin = 0.0 if course.begin is None else max((course.begin - zero) * _NS, 0.0)
    over = [number for number, one in enumerate(epochs) if one.begin <= begin][-1:]
    marks, held = _marks(course, epochs, zero, index), _held(course, zero, index)
    scene = scene_from(documents, epochs[sum(over) :], "log", max(end, begin + 1.0), others)
    return msgspec.structs.replace(
        scene,
        begin=round(begin, 3),
        marks=[mark for mark in marks if begin == 0.0 or mark.t >= begin],
        held=[one for one in held if one.until is None or one.until >= begin],
        orders=course.orders.drawn(index, zero),
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
    drawn = course.drawn(document, index)
    rides = _rides(course, drawn) if number in course.starts else drawn.rides
    known = 0 if first.workspace is None else len(first.workspace.obstacles)
    floor = document.workspace
    return Epoch(
        epoch=number,
        begin=round(min(begin, start), 4),
        start=round(start, 4),
        started=number in course.starts,
        frozen=None if frozen is None else round(frozen, 4),
        arrived=all(course.is_done(number, name) for name in course.takes_part(document)),
        rides=rides,
        aside=_aside(course, document, index),
        keep_out=[]
        if floor is None or document is first
        else [rounded_points(corners) for corners in floor.obstacles[known:]],
        zones=drawn.zones,
        stops=[_stop(one, zero) for one in course.stood.get(number, ())],
    )


def _stop(stood: _Stood, zero: int) -> Stop:
    until = None if stood.until_ns is None else round((stood.until_ns - zero) * _NS, 3)
    since = round((stood.since_ns - zero) * _NS, 3)
    return Stop(since=since, until=until, late=round(stood.late_ns * _NS, 3))


def _rides(course: Course, drawn: _Drawn) -> list[Ride]:
    """Return the rides of an epoch that has started, as its robots drove them."""
    epoch, index = drawn.document.epoch, drawn.indices
    sent = [one for one in course.sent.of(epoch) if one.driven.id in index]
    began: dict[str, list[tuple[SentCourse, float]]] = {}
    further = []
    for one in sent:
        name, revision = one.driven.id, one.driven.plan.revision
        told = course.told_at(one)
        since = one.since(course.said.of(epoch, name, revision))
        if since is not None:
            began.setdefault(name, []).append((one, since))
            told = min(told, since)
        ride = msgspec.structs.replace(
            one.ride,
            robot=index[name],
            told=round(told, 3),
            since=None if since is None else round(since, 3),
        )
        further.append((one.driven, ride))
    shown_from = -math.inf if course.begin is None else (course.begin - course.starts[epoch]) * _NS
    rides = []
    for driven, ride in [*zip(drawn.driven, drawn.rides, strict=True), *further]:
        mine = began.get(driven.id, ())
        later = [one for one in mine if one[0].driven.plan.revision > ride.revision]
        if not later or later[0][1] > shown_from:
            ends = later[0][0].begin if later else None
            rides.append(_as_driven(course, epoch, driven, ride, ends))
    return rides


def _aside(course: Course, document: PlanDocument, index: Mapping[str, int]) -> list[Aside]:
    """Return the robots that a plan leaves out, each with the latest known reason."""
    taking_part = course.takes_part(document)
    why: dict[str, str] = {}
    for epoch, told in sorted(course.told.items()):
        if epoch <= document.epoch:
            why |= {standing.robot: _WHY[standing.state] for standing in told}
    return [
        Aside(robot=place, why=why.get(name) or course.why_aside(document.epoch, name))
        for name, place in index.items()
        if name not in taking_part
    ]


def _as_driven(
    course: Course, epoch: int, one: Driven, ride: Ride, ends: float | None = None
) -> Ride:
    """Return a ride with what the robot's reports tell: how late it was, where it left its plan.

    `ends`: the plan time [s] at which the robot changed to its next course, if it did.
    """
    line, rate = one.timeline, one.plan.brake_mmps2 / 1000.0
    words = course.said.of(epoch, one.id, ride.revision)
    frozen_ns, silent_ns = course.frozen.get(epoch), words.silent_since(course.last)
    if ends is not None:
        frozen_ns = silent_ns = None
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
    return msgspec.structs.replace(ride, passed=passed, halt=halt, unheard=unheard, ends=ends)


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


def _count(epoch: Epoch) -> int:
    """Return how many robots have a part in an epoch when it begins."""
    return sum(ride.told is None for ride in epoch.rides)


def _stop_marks(course: Course, zero: int) -> Iterator[Mark]:
    for one in [stop for stops in course.stood.values() for stop in stops if stop.is_told]:
        yield Mark(t=round((one.since_ns - zero) * _NS, 3), kind="freeze", text="told to stop")
        if one.until_ns is not None:
            yield Mark(t=round((one.until_ns - zero) * _NS, 3), kind="go", text="told to go on")


def _marks(
    course: Course, epochs: Sequence[Epoch], zero: int, index: Mapping[str, int]
) -> Iterator[Mark]:
    """Yield what happened, in order of time; a fault comes before the freeze that it caused."""

    def number_of(robot: str) -> int:
        return index.get(robot, -1)

    marks = [
        Mark(t=epoch.start, kind="go", text=f"epoch {epoch.epoch}: {_count(epoch)} robots go")
        for epoch in epochs
        if epoch.epoch in course.starts
    ]
    marks += _stop_marks(course, zero)
    arrived = {epoch.epoch for epoch in epochs if epoch.arrived}
    done = course.said.done()
    left = ", ".join(name for name in index if name not in done)
    for number, at in course.frozen.items():
        kind, text = "freeze", "all robots must freeze"
        if number in arrived:
            without = f", without {left}" if left else ""
            kind, text = "over", f"all robots on their way have arrived{without}"
        marks.append(Mark(t=round((at - zero) * _NS, 3), kind=kind, text=text))
    marks += [
        Mark(
            t=round((at - zero) * _NS, 3),
            kind="fault",
            text=" ".join(dict.fromkeys((fault.robot, *fault.fault.split(" ", 1)))),
            robot=number_of(fault.robot),
        )
        for at, fault in course.faults
        if fault.kind != "freeze"
    ]
    marks += [
        Mark(
            t=round((at - zero) * _NS, 3),
            kind=kind,
            text=text,
            robot=number_of(robot),
        )
        for at, robot, text, kind in course.news
    ]
    marks += [
        Mark(
            t=round((hold.since_ns - zero) * _NS, 3),
            kind="late",
            text=f"{hold.robot} is held by {hold.by}",
            robot=number_of(hold.robot),
        )
        for hold in course.held
        if (course.last if hold.until_ns is None else hold.until_ns) - hold.since_ns >= _LONG
    ]
    if course.over is not None:
        marks.append(Mark(t=round((course.over - zero) * _NS, 3), kind="over", text="over"))
    yield from sorted(marks, key=lambda mark: (round(mark.t, 1), mark.kind))
