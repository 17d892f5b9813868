"""The fleet core: a state machine from messages and time to messages.  Pure.

In prose: HOLD until every robot that has a part in the epoch is armed; then GO at a common start
time.  While GO, a robot that falls silent, reports a fault or stops, or misses the task deadline,
turns the phase to FREEZE.  A frozen fleet that rests is planned anew (`adopt`): the next epoch, in
HOLD.  When all have arrived the phase is OVER.  The Command of every tick states the phase anew, so
a lost message changes nothing, nor does an event that a phase does not list.

Decides: what is said to whom, and when the fleet goes, freezes and ends.  Must not know: clocks
(`now_ns` is an argument), Zenoh, files, paths.  The same inputs give the same bytes: replay relies
on it.
"""

from __future__ import annotations

from collections.abc import Mapping

from coordinator.absence import Absence
from coordinator.failing import Failing, on_the_way, that_do_not_arm
from coordinator.fleet_news import Incident, Outgoing, Part
from coordinator.fleet_phases import (
    FAREWELLS,
    FREEZE_PATIENCE,
    GO_LEAD,
    RESUME_PATIENCE,
    TASK_GRACE,
    TRANSITIONS,
    UNLOGGED,
    Event,
)
from coordinator.greeting import Door
from coordinator.member import Member
from coordinator.roster import Roster
from coordinator.standing import Standing
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import Admit, Clock, Command, Hello, Report
from protocol.phases import (
    COMMAND_NAMES,
    DONE,
    FREEZE,
    GO,
    HOLD,
    OVER,
    fault_name,
)
from protocol.timing import COMMAND_PERIOD, SECOND


class Fleet:
    """The coordinator's side of a fleet; all times in ns on the coordinator's clock.

    `settling_ns`: how long after FREEZE even a robot that hears nothing may still move;
    `behind_ns`: how far behind its plan one may have been when it said that it moves.
    """

    def __init__(
        self,
        name: str,
        boot: int,
        epoch: int,
        members: list[Member],
        duration_ns: int,
        settling_ns: int = 2 * SECOND,
        behind_ns: int = SECOND // 2,
    ) -> None:
        self.name = name
        self.boot = boot
        self.epoch = self.first_epoch = epoch
        self.members = Roster(members)
        self.phase = HOLD
        self.start_ns = 0
        self.bad_messages = 0
        self.superseded = False
        self.incidents: list[Incident] = []
        self._duration_ns = duration_ns
        self._settling_ns = settling_ns
        self._behind_ns = behind_ns
        self._sequence = 0
        self._changed_ns = self._frozen_ns = self._patient_until_ns = 0
        self._driven_epoch = epoch
        self._has_gone = False
        self._absence = Absence()
        self._farewells = 0
        self._door = Door(name, self.members, self.incidents)

    def hear(self, key: str, payload: bytes, now_ns: int) -> list[Outgoing]:
        """Take in what arrived on a key and return what to send; bad bytes are counted."""
        place = keys.split(key)
        if place is None or place[0] != self.name or place[1] == "plan":
            self.bad_messages += 1
            return []
        _, kind, robot = place
        if kind == "alive":  # nothing on it says that the robot's link is gone
            return [] if payload else self._hear_gone(robot, now_ns)
        message = decode(kind, payload)
        if isinstance(message, Hello):
            return self._hear_hello(robot, message, now_ns)
        if isinstance(message, Report):
            return self._hear_report(robot, message, now_ns)
        if isinstance(message, Clock) and message.received_ns is None:
            return self._answer_clock(robot, message, now_ns)
        if isinstance(message, Command):
            return self._hear_other(message, now_ns)
        if isinstance(message, Admit):
            return self._hear_admit(robot, now_ns)
        self.bad_messages += 1
        return []

    def tick(self, now_ns: int) -> list[Outgoing]:
        """Look at the time, and say every COMMAND_PERIOD what should be.

        Nothing is said while robots move that have yet to be heard since the coordinator was away.
        """
        moving = [m.id for m in self.members.planned if self.phase == GO and m.phase != DONE]
        was_away = self._absence.look(now_ns, moving)
        if self.phase == HOLD:
            self._muster(now_ns, was_away)
        elif self.phase == GO:
            self._watch(now_ns, was_away)
        elif self.phase == FREEZE:
            self._settle(now_ns, was_away)
        elif self.phase == OVER:
            self._farewells += 1
        return [] if self.phase == GO and self._absence.doubted else [self._command()]

    @property
    def is_finished(self) -> bool:
        """Tell whether nothing is left to do and the robots have been told."""
        return self.phase == OVER and self._farewells >= FAREWELLS

    @property
    def next_epoch(self) -> int:
        """The number of the next plan."""
        return max(self.epoch, self._driven_epoch + 1)

    def is_settled(self, now_ns: int) -> bool:
        """Tell whether a frozen fleet rests: all have told where, or are lost."""
        if self.phase != FREEZE or now_ns < self._changed_ns + COMMAND_PERIOD:
            return False
        return self.members.has_told(self._has_gone)

    def standings(self) -> list[Standing]:
        """Return where the robots stand that have a part in this epoch or have spoken since."""
        until = self._frozen_ns + self._settling_ns + self._behind_ns
        zero = self.start_ns + self._behind_ns
        return self.members.standings(self._driven_epoch, zero, until, self._has_gone)

    def adopt(
        self, epoch: int, parts: Mapping[str, Part], duration_ns: int, now_ns: int
    ) -> list[Outgoing]:
        """Begin the next epoch with these robots' parts; the others stay where they stand."""
        self.epoch = self._driven_epoch = epoch
        self._duration_ns = duration_ns
        self.members.assign(parts)
        self._turn("planned" if parts else "none can go", now_ns)
        self._has_gone = False
        return [self._command()]

    def take_over(self, boot: int, last_ns: int, now_ns: int) -> None:
        """Go on in place of a coordinator that was last sure to be alive at `last_ns`.

        The fleet freezes, by its leases or because it is told to, and says where it stands; all
        robots are given time to speak.
        """
        self.boot, self._sequence, self.epoch = boot, 0, self.next_epoch + 1
        self.superseded = False
        if not self._has_gone:
            self.first_epoch = self.epoch
        for member in self.members.values():
            member.gone = False
        self.phase, self._changed_ns = FREEZE, now_ns
        self._absence.look(now_ns, ())
        self._frozen_ns = last_ns + UNLOGGED
        self._patient_until_ns = now_ns + RESUME_PATIENCE
        self._tell(now_ns, "phase", "", "goes on from a log: FREEZE")

    def missing(self, now_ns: int) -> list[str]:
        """Name the robots that are not armed yet."""
        return self.members.unarmed(self.epoch, now_ns)

    def _hear_hello(self, robot: str, hello: Hello, now_ns: int) -> list[Outgoing]:
        begun = self.phase != HOLD or self.epoch != self.first_epoch
        answer = self._door.hear(robot, hello, begun, now_ns)
        if answer is None or isinstance(answer, Outgoing):
            return [answer] if answer else []
        return self._send_plan(answer, now_ns)

    def _hear_admit(self, robot: str, now_ns: int) -> list[Outgoing]:
        """Freeze the fleet to take a robot in that has come back."""
        if not self._door.admit(robot, now_ns):
            return []
        self._turn("admitted", now_ns)
        return [self._command()]

    def _hear_report(self, robot: str, report: Report, now_ns: int) -> list[Outgoing]:
        member = self.members.get(robot)
        if member is None:
            return []
        if report.rest is not None and not 1 <= report.rest.epoch <= self._driven_epoch:
            return self._hear_stranger(member, report.rest.epoch, now_ns)
        was = (member.phase, member.fault)
        stale = self._absence.is_stale(now_ns)
        if not member.hear(report, now_ns, stale):
            return []
        if not stale:
            self._absence.doubted.discard(robot)
        if (member.phase, member.fault) != was:
            self._tell(now_ns, "report", robot, member.describe())
        if self.phase == GO and member.planned and member.has_stopped(self.epoch):
            member.strike()
            self._fail(member, f"{robot} stopped: {fault_name(member.fault)}", now_ns)
            return [self._command()]
        if self.phase == HOLD and member.epoch != self.epoch:
            return self._send_plan(member, now_ns)
        return []

    def _hear_gone(self, robot: str, now_ns: int) -> list[Outgoing]:
        """Take note that the link to a robot is gone; one that has a part is lost at once."""
        member = self.members.get(robot)
        if member is None or member.boot is None:
            return []
        member.gone = True
        under_way = self.phase == GO or self.epoch != self.first_epoch
        if under_way and member.planned and not member.finished:
            self._give_up([Failing(member, "has lost its link", lost=True)], now_ns)
            return [self._command()]
        return []

    def _hear_stranger(self, member: Member, epoch: int, now_ns: int) -> list[Outgoing]:
        """Believe no place on a path that is not known; a log that is gone on from may lack it."""
        self.bad_messages += 1
        if self._patient_until_ns and member.boot is not None and not self.superseded:
            words = f"{member.id} rests on a path of epoch {epoch}, which the log does not hold"
            self._tell(now_ns, "fault", member.id, words)
            self.superseded = True
        return []

    def _hear_other(self, command: Command, now_ns: int) -> list[Outgoing]:
        """Give way to another coordinator of this fleet whose epoch, then boot id, is higher."""
        if command.boot != self.boot and (command.epoch, command.boot) > (self.epoch, self.boot):
            if not self.superseded:
                self._tell(now_ns, "superseded", "", "another coordinator leads this fleet now")
            self.superseded = True
        return []

    def _send_plan(self, member: Member, now_ns: int) -> list[Outgoing]:
        """Send a plan, unless it has just been sent or the robot has no part."""
        if self.phase not in (HOLD, GO) or not member.plan_due(now_ns):
            return []
        return [Outgoing(keys.plan(self.name, member.id), member.plan)]

    def _answer_clock(self, robot: str, clock: Clock, now_ns: int) -> list[Outgoing]:
        if robot not in self.members:
            return []
        answer = Clock(clock.boot, clock.sent_ns, now_ns, now_ns)
        return [Outgoing(keys.clock(self.name, robot), encode(answer))]

    def _muster(self, now_ns: int, was_away: bool) -> None:
        """Go when all are armed; in a later epoch nobody is waited for who fails to arm."""
        if not self.missing(now_ns):
            self._turn("all armed", now_ns)
        elif self.epoch != self.first_epoch and not was_away:
            members = self.members.planned
            self._give_up(that_do_not_arm(members, self.epoch, self._changed_ns, now_ns), now_ns)

    def _watch(self, now_ns: int, was_away: bool) -> None:
        """See who is lost or late while the fleet moves, and whether everybody has arrived."""
        moving = [m for m in self.members.planned if m.phase != DONE]
        if not moving:
            self._turn("all done" if self.members.has_arrived else "some can go on", now_ns)
            return

        def spared(member: Member) -> bool:
            return was_away or self._absence.spares(member.id, member.timeout_ns, now_ns)

        deadline = self.start_ns + self._duration_ns + TASK_GRACE
        self._give_up(on_the_way(moving, spared, self.start_ns, deadline, now_ns), now_ns)

    def _give_up(self, failing: list[Failing], now_ns: int) -> None:
        """Freeze the fleet for the sake of these robots."""
        for member, what, lost, strike in failing:
            member.lost |= lost
            member.strikes += strike
            self._fail(member, f"{member.id} {what}", now_ns)

    def _settle(self, now_ns: int, was_away: bool) -> None:
        """See who is lost in a fleet that freezes."""
        if was_away or now_ns < self._patient_until_ns:
            return
        waited = now_ns - self._changed_ns > self._settling_ns + FREEZE_PATIENCE
        for member in self.members.values():
            member.admitted &= not waited
            if member.planned and not member.finished:
                member.lost |= member.is_silent(now_ns) or (waited and not member.is_at_rest())

    def _fail(self, member: Member, text: str, now_ns: int) -> None:
        self._tell(now_ns, "fault", member.id, text)
        self._turn("robot failed", now_ns)

    def _turn(self, event: Event, now_ns: int) -> None:
        phase = TRANSITIONS.get((self.phase, event))
        if phase is None:
            return
        self.phase, self._changed_ns = phase, now_ns
        self._frozen_ns = now_ns if phase == FREEZE else self._frozen_ns
        if phase == GO:
            self.start_ns, self._has_gone = now_ns + GO_LEAD, True
            for member in self.members.planned:
                member.set_out(self.epoch, now_ns)
        self._tell(now_ns, "phase", "", COMMAND_NAMES[phase])

    def _command(self) -> Outgoing:
        self._sequence += 1
        command = Command(
            boot=self.boot,
            sequence=self._sequence,
            epoch=self.epoch,
            phase=self.phase,
            start_ns=self.start_ns if self.phase in (GO, FREEZE) else 0,
            wanted=tuple(self.members.wanted(self.phase == FREEZE)[:100]),
        )
        return Outgoing(keys.command(self.name), encode(command))

    def _tell(self, now_ns: int, kind: str, robot: str, text: str) -> None:
        self.incidents.append(Incident(now_ns, kind, robot, text))
