"""The coordinator that is played: what it states, and what the robot has said.

A script changes the attributes of a Stage, and from then on its Commands, Plans and answers follow
them, as a coordinator's do: they state what should be, again and again.

Decides: when each message is sent.  Must not know: what a script is after, or how it is judged.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import msgspec

from coordinator.conformance.courses import Course
from coordinator.conformance.wire_forms import Form, plain
from protocol import keys
from protocol.codec import decode
from protocol.messages import MOST_NUMBER, Clock, Command, Hello, Message, Report
from protocol.phases import GO, HOLD
from protocol.timing import COMMAND_PERIOD, MILLISECOND, SECOND

CLOCK_AHEAD: Final = 1_000_000 * SECOND
"""The clock of the played coordinator is so far [ns] ahead of this program's, so that a robot that
takes its own clock for the coordinator's is found out."""

TERM: Final = 5
PATIENCE_MS: Final = 1_500
"""The headroom that Commands state unless a script says otherwise."""

Put = tuple[str, bytes]


class Heard(NamedTuple):
    """A message of the robot and when it arrived, on the played coordinator's clock [ns]."""

    at_ns: int
    message: Message


class Told(NamedTuple):
    """A Command that was sent: when [ns], and the plan time [ms] up to which each number may go."""

    at_ns: int
    command: Command


@dataclass
class Stage:
    """What is stated, and what was heard.

    `held`: plan times [ms] by course number; `form` makes the bytes of each message, `twice` sends
    all of them once more 50 ms later.  `clock_delay_ns`: how long an answer to a question about the
    time takes.  `plans`: the courses that the robot is to have, the newest last; None: what it is
    sent instead.
    """

    fleet: str
    robot: str | None
    boot: int
    now_ns: int = 0
    term: int = TERM
    run: int = 0
    sequence: int = 0
    epoch: int = 1
    phase: int = HOLD
    start_ns: int = 0
    headroom_ms: int = PATIENCE_MS
    held: dict[int, int] = field(default_factory=dict)
    first: int = 0
    last: int = MOST_NUMBER
    wanted: bool = False
    speaks: bool = True
    answers: bool = True
    twice: bool = False
    form: Form = plain
    clock_delay_ns: int = 0
    plans: list[Course] = field(default_factory=list)
    bad_plan: bytes | None = None
    said: list[Told] = field(default_factory=list)
    hellos: list[Heard] = field(default_factory=list)
    reports: list[Heard] = field(default_factory=list)
    questions: list[Heard] = field(default_factory=list)
    unreadable: list[str] = field(default_factory=list)
    alive: set[str] = field(default_factory=set)
    on_report: Callable[[Report], None] = lambda _: None
    on_question: Callable[[Clock], None] = lambda _: None
    _due: list[tuple[int, int, str, bytes]] = field(default_factory=list)
    _count: int = 0
    _command_ns: int = -(2**62)
    _plan_ns: int = -(2**62)

    def __post_init__(self) -> None:
        self.run = self.run or self.boot

    @property
    def plan_ms(self) -> int:
        """Return the plan time [ms] that it is now."""
        return (self.now_ns - self.start_ns) // MILLISECOND

    @property
    def report(self) -> Report | None:
        """Return the robot's last Report."""
        message = self.reports[-1].message if self.reports else None
        return message if isinstance(message, Report) else None

    @property
    def course(self) -> Course:
        """Return the newest course that the robot is to have."""
        return self.plans[-1]

    def heard_within(self, span_ns: int) -> bool:
        """Return whether the robot was heard within so long."""
        last = max((row[-1].at_ns for row in (self.hellos, self.reports) if row), default=-(2**62))
        return self.now_ns - last <= span_ns

    def hear(self, key: str, payload: bytes, now_ns: int) -> None:
        """Take in what came on a key of the fleet; the first robot that says Hello is examined."""
        place = keys.split(key)
        if place is None or place[0] != self.fleet or place[1] not in ("hello", "report", "clock"):
            return
        _, kind, robot = place
        if self.robot is None and kind == "hello":
            self.robot = robot
        if robot != self.robot:
            return
        message, at_ns = decode(kind, payload), now_ns + CLOCK_AHEAD
        if message is None:
            self.unreadable.append(f"{kind} {payload[:32].hex()}")
        elif isinstance(message, Hello):
            self.hellos.append(Heard(at_ns, message))
            self._send_plans(at_ns)
        elif isinstance(message, Report):
            self.reports.append(Heard(at_ns, message))
            self.on_report(message)
        elif isinstance(message, Clock) and message.received_ns is None:
            self.questions.append(Heard(at_ns, message))
            self._answer(message, at_ns)

    def hear_alive(self, key: str, alive: bool) -> None:
        """Take in that a link is up or gone."""
        place = keys.split(key)
        if place is not None and place[:2] == (self.fleet, "alive"):
            (self.alive.add if alive else self.alive.discard)(place[2])

    def tick(self, now_ns: int) -> list[Put]:
        """Return what is to be sent now."""
        self.now_ns = at_ns = now_ns + CLOCK_AHEAD
        if self.speaks and at_ns - self._command_ns >= COMMAND_PERIOD:
            self._command_ns = at_ns
            self.say(self.command())
        report = self.report
        if report is not None and self.plans and at_ns - self._plan_ns >= COMMAND_PERIOD:
            newest = self.course.plan
            if (report.epoch, report.holds) != (newest.epoch, newest.revision):
                self._send_plans(at_ns)
        puts = []
        while self._due and self._due[0][0] <= at_ns:
            _, _, key, payload = heapq.heappop(self._due)
            puts.append((key, payload))
        return puts

    def command(self, **fields: int) -> Command:
        """Return the next Command; `fields` differ from what the stage states."""
        self.sequence += 1
        command = Command(
            self.boot,
            self.term,
            self.sequence,
            self.epoch,
            self.phase,
            self.start_ns,
            self.now_ns,
            self.headroom_ms if self.phase == GO else 0,
            tuple(sorted(self.held.items())),
            self.first,
            self.last,
            (self.robot,) if self.wanted and self.robot is not None else (),
            self.run,
        )
        return msgspec.structs.replace(command, **fields) if fields else command

    def say(self, command: Command) -> None:
        """Send a Command that counts: the robot may drive as far as it states."""
        self.said.append(Told(self.now_ns, command))
        self.send(keys.command(self.fleet), self.form(command))

    def send(self, key: str, payload: bytes, after_ns: int = 0) -> None:
        """Send bytes on a key, now or so long after."""
        at_ns = self.now_ns + after_ns
        for due_ns in (at_ns, at_ns + 50 * MILLISECOND)[: 1 + self.twice]:
            self._count += 1
            heapq.heappush(self._due, (due_ns, self._count, key, payload))

    def authority_ms(self, number: int) -> int:
        """Return the greatest plan time [ms] that the Commands of this epoch grant on a course."""
        granted = [
            told.command.authority_of(number)
            for told in self.said
            if told.command.epoch == self.epoch and told.command.phase == GO
        ]
        return max((one for one in granted if one is not None), default=0)

    def plan_key(self) -> str:
        """Return the key of the robot's plans."""
        return keys.plan(self.fleet, self.robot or "nobody")

    def _send_plans(self, at_ns: int) -> None:
        self._plan_ns = at_ns
        if self.bad_plan is not None:
            self.send(self.plan_key(), self.bad_plan)
        elif self.plans:
            self.send(self.plan_key(), self.form(self.course.plan))

    def _answer(self, asked: Clock, at_ns: int) -> None:
        self.on_question(asked)
        if self.answers and self.robot is not None:
            answer = Clock(asked.boot, asked.sent_ns, at_ns, at_ns, self.boot)
            key = keys.clock(self.fleet, self.robot)
            self.send(key, self.form(answer), self.clock_delay_ns + max(at_ns - self.now_ns, 0))
