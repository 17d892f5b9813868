"""A small fleet whose every message and tick can go wrong: the real mission driver and agent cores.

Time goes in steps of 0.2 s.  In a step the coordinator hears what arrives and looks at the time,
then each robot hears what arrives and ticks four times.  What is sent in a step arrives in the next
one, but for questions about the time, which are answered at once.  A step is made with a set of
faults, each of them a kind and whom or what it befalls.

Decides: what each fault does.  A coordinator that dies is followed by one that goes on from the log
that it leaves, as `coordinator --resume` does.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any, Final, NamedTuple

import msgspec
from msgspec.structs import replace

from coordinator.fleet.log_records import LINK_GONE, CourseRequest, search_of
from coordinator.log.head import Head, first_head, plan_file, resumed
from coordinator.log.records import Log as File
from coordinator.log.records import Record
from coordinator.mission.intake import Arrival
from coordinator.mission.mission import Mission
from coordinator.mission.mission_driver import Job, Journal, MissionDriver, Outcome
from coordinator.plan.document import PlanDocument
from coordinator.plan.wire import PackedPlan
from coordinator.planning.course_search import Answer
from coordinator.planning.wish import Site
from coordinator.scenario.model import Scenario, Workspace
from coordinator.scenario_files.scenario_reader import scenario_to_json
from coordinator.service.planning import plan_here
from coordinator.service.replay import go_on
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import (
    GO_ON,
    HALT,
    PROTOCOL_VERSION,
    Clock,
    Command,
    Hello,
    Message,
    Order,
    Plan,
    Refusal,
    Report,
    Rest,
    Tell,
)
from protocol.phases import GO, OVER, STOP
from protocol.plan_parts import unpack_plan
from protocol.timing import MILLISECOND, SECOND
from robot_agent.core.agent import Agent
from robot_agent.core.ride import NOTHING
from tests.exploration.forking import fork

STEP: Final = 200 * MILLISECOND
PERIOD: Final = 50 * MILLISECOND
BEGIN: Final = 10 * SECOND
COORDINATOR: Final = ""
"""Whom a message is for that goes to the coordinator."""

STRANGER: Final = 99
"""The boot id of a coordinator of somebody else, whose clock is 0.5 s ahead."""

JUMP: Final = 500 * MILLISECOND

LATER: Final = 2
"""So many steps later, and behind all others, comes a message that is held up or comes twice."""

OF_MESSAGES: Final = ("lose", "delay", "double")
OF_ROBOTS: Final = (
    "die",
    "restart",
    "hang",
    "jump",
    "replay",
    "mute clock",
    "stranger",
    "clock twice",
)
OF_COORDINATOR: Final = ("take over", "new floor", "away", "tick first", "stop", "order")

_remembered: dict[Any, tuple[Answer, Site]] = {}
"""By input of a search for a course: what it found, and the floor, whose identity is in the key."""

BOOT: Final = 7
EFFORT: Final = 0

_planned: dict[bytes, PackedPlan] = {}


def planned(scenario: Scenario, epoch: int) -> PackedPlan:
    """Return the plan of a scenario for an epoch, which is made once."""
    key = b"%d %b" % (epoch, scenario_to_json(scenario))
    if key not in _planned:
        _planned[key] = plan_here(scenario, EFFORT, epoch)
    return _planned[key]


read = lru_cache(100_000)(decode)
parts_of = lru_cache(1_000)(unpack_plan)


class Fault(NamedTuple):
    """A kind of fault, and the robot or the number of the message that it befalls."""

    kind: str
    which: str | int = ""


class Flight(NamedTuple):
    """A message on its way: in which step it arrives, and at whom."""

    step: int
    receiver: str
    key: str
    payload: bytes
    is_late: bool = False
    """Whether it was held up, so that others overtake it."""


@dataclass(frozen=True, eq=False)
class Written:
    """The newest record of a log and all those before it, which copies of a fleet share."""

    before: Written | None
    record: Record


class Log(Journal):
    """A log of a coordinator; `logged` is what was recorded in this step."""

    def __init__(self, head: Head) -> None:
        self._before: tuple[File, ...] = ()
        self._begin(head)
        self.logged: set[tuple[str, bytes]] = set()
        self.courses: set[tuple[str, int]] = set()
        self.ahead_ms = 0

    def record(self, key: str, payload: bytes, now_ns: int, sent_ns: int | None = None) -> None:
        """Keep a record, the plan time that robots may be told, and the courses by revision."""
        record = Record(key, payload, now_ns, sent_ns or 0, 0)
        self._newest = Written(self._newest, record)
        self.logged.add((key, payload))
        kind = key.split("/")[2]
        if kind == "epoch":
            self.ahead_ms = 0
        if kind == "ahead":
            self.ahead_ms = max(self.ahead_ms, msgspec.msgpack.decode(payload))
        if kind == "course" and (found := search_of(payload)) is not None:
            self.courses.add((found.robot, found.revision))

    def keep(self, document: PlanDocument) -> None:
        """Attach a later plan."""
        file = plan_file(document)
        self._attachments = {**self._attachments, file.name: file.data}

    @property
    def is_begun(self) -> bool:
        """Whether it holds a record; a fleet whose log holds none begins anew."""
        return self._newest is not None or bool(self._before)

    def file(self) -> File:
        """Return the log as it is on the disk when its coordinator dies."""
        records, newest = [], self._newest
        while newest is not None:
            records.append(newest.record)
            newest = newest.before
        records.reverse()
        return File(self._metadata, self._attachments, records, False, "", self._before)

    def succeed(self, head: Head) -> None:
        """Begin the log of the next coordinator, in the same folder."""
        self._before = (*self._before, self.file())
        self._begin(head)

    def _begin(self, head: Head) -> None:
        self._metadata, files = head
        self._attachments = {one.name: one.data for one in files}
        self._newest: Written | None = None

    def sync(self) -> bool:
        """Return that all is on the disk."""
        return True

    def hurry(self) -> None:
        """Do nothing: the disk is never slow."""


class Robot:
    """An agent core on wheels without errors; `ahead_ns`: its clock less the coordinator's."""

    def __init__(self, name: str, boot: int, ahead_ns: int, speed: float) -> None:
        self.name, self.boot, self.ahead_ns, self.speed = name, boot, ahead_ns, speed
        self.agent = Agent(speed, PERIOD)
        self.pose = [math.nan, math.nan, math.nan]
        self.is_dead = self.has_jumped = False
        self.moved = 0.0  # How far [m] it has gone since its core saw its place.
        self.hellos = 0
        self.answers: tuple[Clock, ...] = ()  # The last one, to be given once more.
        self.first: dict[str, Flight] = {}  # The first Command and Plan, to come once more.

    def start_anew(self) -> None:
        """Begin a new program where the robot stands."""
        self.boot, self.hellos, self.answers = self.boot + 10, 0, ()
        self.agent = Agent(self.speed, PERIOD)

    def hear(self, message: Message | None, now_ns: int) -> None:
        """Let the core hear a message, as robot_agent/service.py does."""
        agent = self.agent
        if isinstance(message, Command):
            granted, coming = (
                NOTHING if (most := message.authority_of(number)) is None else most
                for number in (agent.number, agent.next_number)
            )
            leads = (message.boot, message.term, message.sequence, message.epoch, message.phase)
            times = (message.start_ns, message.said_ns, granted)
            is_wanted = self.name in message.wanted
            agent.hear_command(*leads, *times, is_wanted, now_ns, message.run, coming)
        elif isinstance(message, Plan):
            which = (message.boot, message.epoch, message.number, message.revision)
            agent.hear_plan(*which, *parts_of(message))
        elif isinstance(message, Clock) and message.boot == self.boot:
            if message.received_ns is not None and message.answered_ns is not None:
                stamps = (message.sent_ns, message.received_ns, message.answered_ns)
                agent.hear_clock(message.coordinator, *stamps, now_ns)
        elif isinstance(message, Refusal) and message.boot == self.boot:
            self.start_anew()  # Its program ends; whoever looks after it starts it again.

    def tick(self, now_ns: int) -> None:
        """Let the core decide, and drive for a period."""
        agent = self.agent
        if agent.ride is not None and self.pose[0] != self.pose[0]:
            self.pose = list(agent.ride.follower.start_pose())
        x, y, heading = self.pose
        agent.tick(now_ns, x, y, heading)
        way = min(agent.drive_speed * PERIOD / SECOND, agent.drive_distance)
        turn = agent.drive_turn or way * agent.drive_curvature
        way = 0.0 if agent.drive_turn else way
        half = heading + 0.5 * turn
        if way or turn:
            self.pose = [x + way * math.cos(half), y + way * math.sin(half), heading + turn]
        self.moved = way

    def hello(self) -> Hello:
        """Return the next Hello."""
        self.hellos += 1
        return Hello(PROTOCOL_VERSION, self.boot, 0.0, 0.0, 0.0, None, self.hellos)

    def report(self) -> Report:
        """Return the report that is due."""
        agent, rest = self.agent, None
        if agent.report_s is not None:
            at = agent.rest
            rest = Rest(agent.report_s, at.epoch, at.off, at.turn, at.beyond, at.revision)
        stamp = None if agent.report_stamp_ms == NOTHING else agent.report_stamp_ms
        state = (agent.report_sequence, agent.epoch, agent.phase, agent.fault)
        held = (agent.report_late, agent.revision, agent.holds)
        return Report(self.boot, *state, rest, stamp, *held)


class World:
    """A fleet that has yet to set out; `redirected`: the order that may come.

    `other_floor`: the floor of a coordinator that takes over as `--with-scenario` says.
    """

    def __init__(
        self, scenario: Scenario, plan: PackedPlan, redirected: Order, other_floor: Workspace
    ) -> None:
        mission = Mission.of_plan(scenario, plan, BOOT, planned)
        self.scenario, self._other_floor = scenario, other_floor
        self.now_ns, self.step_number = BEGIN, 0
        self.log = Log(first_head(scenario, plan.document, boot=BOOT, effort=EFFORT))
        self.driver = MissionDriver(mission, self.log, self._send, None)
        self.driver.intake = None  # type: ignore[assignment]  # Nothing is dropped here.
        self.redirected = redirected
        self.is_leaderless = self.was_ordered = False
        self.jobs: list[tuple[Job, Outcome]] = []
        self.flights: list[Flight] = []
        self.robots = [
            Robot(one.id, number, number * 37 * MILLISECOND, one.max_speed)
            for number, one in enumerate(mission.site.scenario.robots, start=1)
        ]
        assert mission.dispatcher.obstructions.site is not None  # Copies share it from now on.

    @property
    def fleet(self):
        """The fleet core."""
        return self.driver.fleet

    def copy(self) -> World:
        """Return a copy that goes its own way; this world must not step any more.

        Both have the same curves, which know where they were evaluated last.
        """
        made: World = fork(self, {})
        return made

    def arriving(self) -> list[Flight]:
        """Return the messages that arrive in the next step."""
        return [one for one in self.flights if one.step <= self.step_number + 1]

    def options(self) -> list[Fault]:
        """Return the faults that can happen in the next step."""
        fleet = self.fleet
        found = [Fault(kind, n) for n in range(len(self.arriving())) for kind in OF_MESSAGES]
        robots = [one for one in self.robots if not one.is_dead]
        found += [Fault(kind, one.name) for one in robots for kind in OF_ROBOTS]
        if not self.is_leaderless and fleet.phase != OVER:
            found += [Fault("away"), Fault("tick first")]
            found += [Fault("take over")] if self.log.is_begun else []
            is_new = self.scenario.workspace is self._other_floor
            found += [Fault("new floor")] if self.log.is_begun and not is_new else []
            found += [Fault("stop")] if fleet.phase in (GO, STOP) else []
            found += [Fault("order")] if fleet.phase == GO and not self.was_ordered else []
        return found

    def step(self, faults: Collection[Fault] = ()) -> None:
        """Let a step pass, with these faults."""
        self.now_ns, self.step_number = self.now_ns + STEP, self.step_number + 1
        self.log.logged.clear()
        self.fleet.incidents.clear()
        arriving = [one for one in self.flights if one.step <= self.step_number]
        self.flights = [one for one in self.flights if one.step > self.step_number]
        heard = []
        for number, flight in enumerate(arriving):
            fates = {kind for kind in OF_MESSAGES if Fault(kind, number) in faults}
            if not fates & {"lose", "delay"}:
                heard.append(flight)
            if fates & {"delay", "double"}:
                self.flights.append(flight._replace(step=self.step_number + LATER, is_late=True))
        heard.sort(key=lambda one: one.is_late)
        self._coordinate([one for one in heard if one.receiver == COORDINATOR], faults)
        for robot in self.robots:
            self._drive(robot, [one for one in heard if one.receiver == robot.name], faults)

    def _coordinate(self, heard: list[Flight], faults: Collection[Fault]) -> None:
        if self.is_leaderless:
            self._take_over()
        floors = [one for one in faults if one.kind == "new floor"]
        if floors or Fault("take over") in faults:
            self.is_leaderless = True
            self.jobs = []
            if floors:
                self.scenario = replace(self.scenario, workspace=self._other_floor)
            return
        if Fault("away") in faults:  # It hears nothing, and what it did not hear waits.
            self.flights += [one._replace(step=self.step_number + 1) for one in heard]
            return
        if Fault("tick first") in faults:
            self._look()
        for flight in heard:
            self.driver.hear(Arrival(flight.key, flight.payload, None), self.now_ns)
        if Fault("stop") in faults:
            what = GO_ON if self.fleet.phase == STOP else HALT
            self._tell(keys.tell(self.fleet.name), Tell(1, what))
        if Fault("order") in faults:
            self.was_ordered = True
            self._tell(keys.order(self.fleet.name), self.redirected)
        if Fault("tick first") not in faults:
            self._look()

    def _look(self) -> None:
        """Look at the time; what searches find counts from the next step on."""
        done, self.jobs = self.jobs, []
        for job, outcome in done:
            self.driver.finish(job, outcome, self.now_ns)
        self.jobs = [(job, self._outcome(job)) for job in self.driver.look(self.now_ns)]

    def _outcome(self, job: Job) -> Outcome:
        """Return what comes of a search, which is made once for each input."""
        wanted = job.wanted
        if not isinstance(wanted, CourseRequest):
            return job.work()
        searches = self.driver.mission.dispatcher.searches
        asked = searches._asked[wanted]
        wish, under_way = asked.wish, asked.wish.leaves
        key = (
            *(wish.robot, wish.heading, wish.number, wish.revision, wish.begin_ms, wish.delay),
            tuple(wish.late.items()),
            None if under_way is None else (under_way.begin_ms, under_way.leave_ms),
            *((one.driven.id, one.driven.plan, one.since, one.until) for one in asked.others),
            id(asked.site),
        )
        if key not in _remembered:
            _remembered[key] = searches.search_for(wanted)(), asked.site
        return partial(self.driver._commit, wanted, _remembered[key][0])

    def _take_over(self) -> None:
        """Let the next coordinator go on, from the state that the log gives."""
        boot = self.fleet.boot + 1
        mission = go_on(self.log.file(), boot, self.now_ns, self.scenario)
        mission._planner = planned  # A later plan is made once for each input.
        self.is_leaderless = False
        head = first_head(self.scenario, mission.document, boot=boot, effort=EFFORT)
        self.log.succeed(resumed(head, b"", self.now_ns))
        self.driver = MissionDriver(mission, self.log, self._send, None)
        self.driver.intake = None  # type: ignore[assignment]

    def _tell(self, key: str, message: Message) -> None:
        self.driver.hear(Arrival(key, encode(message), None), self.now_ns)

    def _drive(self, robot: Robot, heard: list[Flight], faults: Collection[Fault]) -> None:
        name = robot.name
        mine = {fault.kind for fault in faults if fault.which == name}
        if "die" in mine:
            robot.is_dead, robot.moved = True, 0.0
            key = keys.alive(self.fleet.name, name)
            self.flights.append(Flight(self.step_number + 1, COORDINATOR, key, LINK_GONE))
        if robot.is_dead:
            return
        if "restart" in mine:
            key = keys.alive(self.fleet.name, name)
            self.flights.append(Flight(self.step_number + 1, COORDINATOR, key, LINK_GONE))
            robot.start_anew()
        if "jump" in mine:
            robot.ahead_ns, robot.has_jumped = robot.ahead_ns + JUMP, True
        if "hang" in mine:
            robot.moved = 0.0
            self.flights += [one._replace(step=self.step_number + 1) for one in heard]
            return
        begin_ns = self.now_ns + robot.ahead_ns
        if "replay" in mine:
            heard = [*heard, *robot.first.values()]
        for flight in heard:
            kind = flight.key.split("/")[2]
            robot.first.setdefault(kind, flight)
            robot.hear(read(kind, flight.payload), begin_ns)
        for tick in range(STEP // PERIOD):
            self._tick(robot, tick * PERIOD, mine)

    def _tick(self, robot: Robot, later_ns: int, faults: set[str]) -> None:
        fleet, name, agent = self.fleet.name, robot.name, robot.agent
        true_ns = self.now_ns + later_ns
        own_ns = true_ns + robot.ahead_ns
        robot.tick(own_ns)
        if agent.hello_due(own_ns):
            self._put(keys.hello(fleet, name), robot.hello())
        if agent.clock_due(own_ns):
            self._ask(robot, true_ns, faults)
        if agent.report_due(own_ns):
            self._put(keys.report(fleet, name), robot.report())

    def _ask(self, robot: Robot, true_ns: int, faults: set[str]) -> None:
        """Let a robot ask for the time, and hear what is answered."""
        own_ns = true_ns + robot.ahead_ns
        if "stranger" in faults:
            wrong_ns = true_ns + JUMP
            robot.hear(Clock(robot.boot, own_ns, wrong_ns, wrong_ns, STRANGER), own_ns)
        if "clock twice" in faults:
            for answer in robot.answers:
                robot.hear(answer, own_ns)
        if self.is_leaderless or "mute clock" in faults:
            return
        key = keys.clock(self.fleet.name, robot.name)
        asked = encode(Clock(robot.boot, own_ns))
        for outgoing in self.fleet.hear(key, asked, true_ns):
            answer = decode("clock", outgoing.payload)
            robot.hear(answer, own_ns)
            robot.answers = (answer,) if isinstance(answer, Clock) else ()

    def _put(self, key: str, message: Message) -> None:
        self.flights.append(Flight(self.step_number + 1, COORDINATOR, key, encode(message)))

    def _send(self, key: str, payload: bytes) -> None:
        """Put a message of the coordinator on its way; what is not in the log may not be sent."""
        if (key, payload) not in self.log.logged:
            raise AssertionError(f"{key} was sent and is not in the log")
        _, kind, robot = keys.split(key) or ("", "", "")
        plan = read(kind, payload)
        if (
            isinstance(plan, Plan)
            and plan.revision
            and (robot, plan.revision) not in self.log.courses
        ):
            raise AssertionError(f"{robot}'s course {plan.revision} was sent and is not in the log")
        for one in self.robots:
            if kind == "command" or (kind == "plan" and robot == one.name):
                self.flights.append(Flight(self.step_number + 1, one.name, key, payload))
