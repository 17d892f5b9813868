"""The fleet core: a state machine from messages and time to messages.  Pure.

In prose: HOLD until every robot is armed; then GO at a common start time.  While GO, a robot that
falls silent, reports a fault or stops, or misses the task deadline, turns the phase to FREEZE.
When all have arrived the phase is OVER.  The Command of every tick states the phase anew, so a lost
message changes nothing.  An event that a phase does not list changes nothing.

Decides: what is said to whom, and when the fleet goes, freezes and ends.  Must not know: clocks
(`now_ns` is an argument), Zenoh, files.  The same inputs give the same bytes: replay relies on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from coordinator.member import Member
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import PROTOCOL_VERSION, Clock, Command, Hello, Refusal, Report
from protocol.phases import (
    COMMAND_NAMES,
    DONE,
    FAULT_NAMES,
    FREEZE,
    FROZEN,
    GO,
    HOLD,
    OVER,
    PHASE_NAMES,
)
from protocol.timing import COMMAND_PERIOD, LEASE, MILLISECOND, SECOND

GO_LEAD: Final = 400 * MILLISECOND
"""From the decision to go until the common start: every robot hears of it in time."""

TASK_GRACE: Final = 10 * SECOND
"""A fleet that has not arrived this long after its last planned arrival has a lost robot."""

FREEZE_PATIENCE: Final = 10 * SECOND
"""How long a frozen fleet is waited for to tell where it stands."""

FREEZE_SAID: Final = LEASE
"""For how long FREEZE is said at least: a robot that misses all of it stops by its lease."""

FAREWELLS: Final = 5
"""How often OVER is said."""

PLAN_PERIOD: Final = COMMAND_PERIOD

_REFUSALS_TOLD: Final = 100

Event = Literal["all armed", "robot failed", "all done"]

TRANSITIONS: Final[dict[tuple[int, Event], int]] = {
    (HOLD, "all armed"): GO,
    (GO, "robot failed"): FREEZE,
    (GO, "all done"): OVER,
}


@dataclass(frozen=True)
class Outgoing:
    """A message to put on a key."""

    key: str
    payload: bytes


@dataclass(frozen=True)
class Incident:
    """Something worth telling: when, what kind, whose, in words."""

    now_ns: int
    kind: str
    robot: str
    text: str


class Fleet:
    """The coordinator's side of one epoch; all times in ns on the coordinator's clock."""

    def __init__(
        self, name: str, boot: int, epoch: int, members: list[Member], duration_ns: int
    ) -> None:
        self.name = name
        self.boot = boot
        self.epoch = epoch
        self.members = {member.id: member for member in members}
        self.phase = HOLD
        self.start_ns = 0
        self.bad_messages = 0
        self.incidents: list[Incident] = []
        self._duration_ns = duration_ns
        self._sequence = 0
        self._changed_ns = self._ticked_ns = 0
        self._farewells = 0
        self._refused: set[tuple[str, int]] = set()

    def hear(self, key: str, payload: bytes, now_ns: int) -> list[Outgoing]:
        """Take in what arrived on a key and return what to send; bad bytes are counted."""
        place = keys.split(key)
        if place is None or place[0] != self.name or place[1] not in ("hello", "report", "clock"):
            self.bad_messages += 1
            return []
        _, kind, robot = place
        message = decode(kind, payload)
        if isinstance(message, Hello):
            return self._hear_hello(robot, message, now_ns)
        if isinstance(message, Report):
            return self._hear_report(robot, message, now_ns)
        if isinstance(message, Clock) and message.received_ns is None:
            return self._answer_clock(robot, message, now_ns)
        self.bad_messages += 1
        return []

    def tick(self, now_ns: int) -> list[Outgoing]:
        """Look at the time, and say every COMMAND_PERIOD what should be.

        After a gap between ticks the coordinator itself was away: what robots said meanwhile has
        yet to be heard, so nobody is called silent at once.
        """
        members = self.members.values()
        was_away = now_ns - self._ticked_ns > 2 * COMMAND_PERIOD
        self._ticked_ns = now_ns
        if self.phase == HOLD and all(m.is_armed(self.epoch, now_ns) for m in members):
            self._turn("all armed", now_ns)
        elif self.phase == GO:
            self._watch(now_ns, was_away)
        elif self.phase == FREEZE and not was_away:
            for member in members:
                member.lost |= member.phase != DONE and member.is_silent(now_ns)
        elif self.phase == OVER:
            self._farewells += 1
        return [self._command()]

    @property
    def is_finished(self) -> bool:
        """Tell whether every robot has arrived and been told."""
        return self.phase == OVER and self._farewells >= FAREWELLS

    def is_settled(self, now_ns: int) -> bool:
        """Tell whether a frozen fleet rests: all that speak have told where, or time is up."""
        if self.phase != FREEZE or now_ns - self._changed_ns < FREEZE_SAID:
            return False
        waiting = [m for m in self.members.values() if not m.lost and not m.is_at_rest()]
        return not waiting or now_ns - self._changed_ns > FREEZE_PATIENCE

    def missing(self, now_ns: int) -> list[str]:
        """Name the robots that are not armed yet."""
        return [m.id for m in self.members.values() if not m.is_armed(self.epoch, now_ns)]

    def _hear_hello(self, robot: str, hello: Hello, now_ns: int) -> list[Outgoing]:
        reason = self._objection(robot, hello, now_ns)
        if reason:
            if (robot, hello.boot) not in self._refused and len(self._refused) < _REFUSALS_TOLD:
                self._refused.add((robot, hello.boot))
                self._tell(now_ns, "refused", robot, reason)
            refusal = Refusal(boot=hello.boot, reason=reason[:200])
            return [Outgoing(keys.plan(self.name, robot), encode(refusal))]
        member = self.members[robot]
        if member.boot != hello.boot:
            self._tell(now_ns, "hello", robot, f"{robot} says hello")
        member.accept(hello, now_ns)
        return self._send_plan(member, now_ns)

    def _objection(self, robot: str, hello: Hello, now_ns: int) -> str:
        """Return why a robot cannot join, or nothing."""
        member = self.members.get(robot)
        if member is None:
            known = ", ".join(list(self.members)[:10])
            return f"{robot} is not in fleet {self.name}, which has {known}"
        if hello.version != PROTOCOL_VERSION:
            return (
                f"{robot} speaks protocol version {hello.version}, "
                f"the coordinator speaks {PROTOCOL_VERSION}"
            )
        if hello.radius_m > member.radius + 1e-6:
            return f"{robot} has radius {hello.radius_m} m, the plan was made for {member.radius} m"
        if 0.0 < hello.max_speed_mps < member.speed - 1e-6:
            return f"{robot} reaches {hello.max_speed_mps} m/s, its plan needs {member.speed} m/s"
        if member.boot is not None and hello.boot != member.boot:
            if not member.is_silent(now_ns):
                return f"another {robot} is already in fleet {self.name}"
            if self.phase != HOLD:
                return f"fleet {self.name} is under way; {robot} can join at its next start"
        return ""

    def _hear_report(self, robot: str, report: Report, now_ns: int) -> list[Outgoing]:
        member = self.members.get(robot)
        if member is None:
            return []
        was = (member.phase, member.fault)
        if not member.hear(report, now_ns):
            return []
        if (member.phase, member.fault) != was:
            self._tell(now_ns, "report", robot, _describe(member))
        if self.phase == GO and member.has_stopped():
            self._fail(member, f"{robot} stopped: {FAULT_NAMES[member.fault]}", now_ns)
            return [self._command()]
        if self.phase == HOLD and member.epoch != self.epoch:
            return self._send_plan(member, now_ns)
        return []

    def _send_plan(self, member: Member, now_ns: int) -> list[Outgoing]:
        """Send a plan, unless it has just been sent."""
        if member.plan_sent_ns is not None and now_ns - member.plan_sent_ns < PLAN_PERIOD:
            return []
        member.plan_sent_ns = now_ns
        return [Outgoing(keys.plan(self.name, member.id), member.plan)]

    def _answer_clock(self, robot: str, clock: Clock, now_ns: int) -> list[Outgoing]:
        if robot not in self.members:
            return []
        answer = Clock(clock.boot, clock.sent_ns, now_ns, now_ns)
        return [Outgoing(keys.clock(self.name, robot), encode(answer))]

    def _watch(self, now_ns: int, was_away: bool) -> None:
        """See who is lost or late while the fleet moves, and whether everybody has arrived."""
        moving = [m for m in self.members.values() if m.phase != DONE]
        if not moving:
            self._turn("all done", now_ns)
            return
        for member in moving:
            if member.is_silent(now_ns) and not was_away:
                member.lost = True
                self._fail(member, f"{member.id} has fallen silent", now_ns)
            elif now_ns > self.start_ns + self._duration_ns + TASK_GRACE:
                self._fail(member, f"{member.id} has not arrived in time", now_ns)

    def _fail(self, member: Member, text: str, now_ns: int) -> None:
        self._tell(now_ns, "fault", member.id, text)
        self._turn("robot failed", now_ns)

    def _turn(self, event: Event, now_ns: int) -> None:
        phase = TRANSITIONS.get((self.phase, event))
        if phase is None:
            return
        self.phase, self._changed_ns = phase, now_ns
        if phase == GO:
            self.start_ns = now_ns + GO_LEAD
        self._tell(now_ns, "phase", "", COMMAND_NAMES[phase])

    def _command(self) -> Outgoing:
        self._sequence += 1
        wanted = [m.id for m in self.members.values() if m.phase == FROZEN and m.rest_s is None]
        command = Command(
            boot=self.boot,
            sequence=self._sequence,
            epoch=self.epoch,
            phase=self.phase,
            start_ns=self.start_ns,
            wanted=tuple(wanted[:100]) if self.phase == FREEZE else (),
        )
        return Outgoing(keys.command(self.name), encode(command))

    def _tell(self, now_ns: int, kind: str, robot: str, text: str) -> None:
        self.incidents.append(Incident(now_ns, kind, robot, text))


def _describe(member: Member) -> str:
    text = f"{member.id} is {PHASE_NAMES[member.phase]}"
    return f"{text}: {FAULT_NAMES[member.fault]}" if member.fault else text
