"""The fleet core: a state machine from messages and time to messages.  Pure.

The phase is HOLD until every robot that has a part in the epoch is armed; then it is GO, with a
common start time.  In GO, the phase turns to FREEZE when a robot falls silent, reports a fault,
stops, or misses the task deadline.  When a robot is late, the others may get new times instead
(`take_times`).  A frozen fleet that rests gets a new plan (`adopt`), and the next epoch begins in
HOLD.  When all robots have arrived, the phase is OVER.  Every tick sends a Command that states the
phase, so a lost message changes nothing.  An event that is not listed for a phase changes nothing
either.

The same inputs give the same bytes; replay relies on it.

Decides: which messages are sent to which robot, and when the fleet goes, freezes and ends.  Must
not know: clocks (`now_ns` is an argument), Zenoh, files, paths.
"""

from __future__ import annotations

from collections.abc import Mapping

from coordinator.fleet.admission import Door
from coordinator.fleet.delay import Delay
from coordinator.fleet.epoch_times import EpochTimes
from coordinator.fleet.events import Outgoing, Part
from coordinator.fleet.failures import Failing, on_the_way, sets_out, that_do_not_arm
from coordinator.fleet.grants import Grants
from coordinator.fleet.log_records import LINK_GONE, LINK_UP, router_key
from coordinator.fleet.member import Member
from coordinator.fleet.phases import (
    FREEZE_PATIENCE,
    RESUME_PATIENCE,
)
from coordinator.fleet.router_link import RouterLink
from coordinator.fleet.state import FleetState
from coordinator.schedule.lateness import Lateness
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import Admit, Clock, Command, Hello, Pace, Report
from protocol.phases import (
    DONE,
    FREEZE,
    GO,
    HOLD,
    LATE,
    OVER,
    fault_name,
)
from protocol.timing import MILLISECOND


class Fleet(FleetState):
    """The coordinator's side of a fleet; all times in ns on the coordinator's clock."""

    def __init__(
        self,
        name: str,
        boot: int,
        members: list[Member],
        times: EpochTimes,
        delay: Delay | None = None,
        grants: Grants | None = None,
    ) -> None:
        super().__init__(name, boot, members, times, delay or Delay(), grants)
        self.bad_messages = 0
        self._door = Door(name, self.members, self.incidents)

    def hear(self, key: str, payload: bytes, now_ns: int) -> list[Outgoing]:
        """Take in a message that arrived on a key; return what to send.  Count bad messages."""
        if key == router_key(self.name):
            self._hear_router(payload == LINK_UP, now_ns)
            return []
        place = keys.split(key)
        if place is None or place[0] != self.name or place[1] == "plan":
            self.bad_messages += 1
            return []
        _, kind, robot = place
        if kind == "alive":
            return self._hear_gone(robot, now_ns) if payload == LINK_GONE else []
        self._router.note(now_ns)
        message = decode(kind, payload)
        if isinstance(message, Hello):
            return self._hear_hello(robot, message, now_ns)
        if isinstance(message, Report):
            return self._hear_report(robot, message, now_ns)
        if isinstance(message, Pace):
            return self._hear_pace(robot, message, now_ns)
        if isinstance(message, Clock) and message.received_ns is None:
            return self._answer_clock(robot, message, now_ns)
        if isinstance(message, Command):
            return self._hear_other(message, now_ns)
        if isinstance(message, Admit):
            return self._hear_admit(robot, message, now_ns)
        self.bad_messages += 1
        return []

    def tick(self, now_ns: int) -> list[Outgoing]:
        """Act on the time and return the Command; to be called every COMMAND_PERIOD.

        After the coordinator was away, return nothing until each moving robot has been heard again.
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
        if self.phase == GO and self._absence.doubted:
            return []
        late = [self.members[name] for name in sorted(self._delay.missing)]
        return [
            self._command(now_ns),
            *(Outgoing(keys.plan(self.name, m.id), m.times) for m in late),
        ]

    def adopt(
        self,
        epoch: int,
        parts: Mapping[str, Part],
        duration_ns: int,
        now_ns: int,
        grants: Grants | None = None,
    ) -> list[Outgoing]:
        """Begin the next epoch with the parts of these robots; the others stay where they are."""
        self.epoch, self._grants = epoch, grants
        self.times.begin(epoch, duration_ns)
        self._delay.begin_epoch()
        self.members.assign(parts)
        self._turn("planned" if parts else "none can go", now_ns)
        return [self._command(now_ns)]

    def late(self) -> Lateness | None:
        """Return the lateness for which new times are needed and were not requested yet."""
        return self._delay.request() if self.phase == GO else None

    def take_times(
        self, late: Lateness, times: Mapping[str, bytes], duration_ns: int, now_ns: int
    ) -> list[Outgoing] | None:
        """Return the NewTimes messages to send to these robots; freeze if `times` is empty.

        Return None if these new times are no longer needed.
        """
        if self.phase != GO or not self._delay.awaits(late):
            return None
        if not times:
            what = "is late, and there are no new times"
            self._give_up([Failing(self.members[late.robot], what, strike=True)], now_ns)
            return [self._command(now_ns)]
        self.times.duration_ns, self._grants = duration_ns, None
        self._delay.tell(times, self.times)
        for name, message in times.items():
            self.members[name].times, self.members[name].revision = message, self.revision
        told = ", ".join(sorted(times))
        self._tell(now_ns, "late", late.robot, f"new times for {told}: {late.robot} is late")
        return [Outgoing(keys.plan(self.name, name), times[name]) for name in sorted(times)]

    def take_over(self, boot: int, last_ns: int, now_ns: int) -> None:
        """Resume for a coordinator that died and was last known alive at `last_ns`.

        The fleet freezes, because its leases run out or because the Command says so.  The robots
        get RESUME_PATIENCE to say where they rest.
        """
        self.boot, self._sequence, self.epoch = boot, 0, self.next_epoch + 1
        self.superseded, self._router, self.is_resumed = False, RouterLink(), True
        self._not_gone = 0 if self.times.has_gone else self.times.epoch
        if self._not_gone:
            self.first_epoch = self.epoch
        for member in self.members.values():
            member.gone = False
        self.phase, self._changed_ns = FREEZE, now_ns
        self._absence.look(now_ns, ())
        self._delay.drop()
        self._grants = None
        self.times.lose_sight(last_ns)
        self._patient_until_ns = now_ns + RESUME_PATIENCE
        self._tell_phase(now_ns, "resumed from a log: FREEZE")

    def _hear_hello(self, robot: str, hello: Hello, now_ns: int) -> list[Outgoing]:
        has_gone = self.phase != HOLD and (self.times.has_gone or self.phase == OVER)
        begun = has_gone or self.epoch != self.first_epoch
        answer = self._door.hear(robot, hello, begun, now_ns)
        if answer is None or isinstance(answer, Outgoing):
            return [answer] if answer else []
        return self._send_plan(answer, now_ns)

    def _hear_admit(self, robot: str, admit: Admit, now_ns: int) -> list[Outgoing]:
        """Freeze the fleet to admit a robot that has come back or that is heard again.

        A frozen fleet needs no such request for a robot that has a part and is heard: the next plan
        includes it.
        """
        member = self.members.get(robot)
        if self.phase == FREEZE and member is not None and member.is_under_way(now_ns):
            return []
        answer = self._door.admit(robot, admit.boot, now_ns)
        if not answer or isinstance(answer, Outgoing):
            return [answer] if answer else []
        self._turn("admitted", now_ns)
        return [self._command(now_ns)]

    def _hear_report(self, robot: str, report: Report, now_ns: int) -> list[Outgoing]:
        member = self.members.get(robot)
        if member is None:
            return []
        if report.rest is not None and not 1 <= report.rest.epoch <= self.times.epoch:
            self.bad_messages += 1  # The place is on a path that the coordinator does not know.
            if member.boot is not None:
                self.outrun(f"{robot} rests on a path of epoch {report.rest.epoch}", now_ns)
            return []
        if 0 < report.epoch == self._not_gone and report.boot == member.boot and sets_out(report):
            self.outrun(f"{robot} has set out in epoch {report.epoch}", now_ns)
        was = (member.phase, member.fault)
        stale = self._absence.is_stale(now_ns) or self._router.is_stale(now_ns)
        was_unheard = member.is_unheard(now_ns)
        if not member.hear(report, now_ns, stale):
            return []
        if was_unheard:
            self._door.tell_heard_again(member, now_ns)
        if self._grants is not None and report.epoch == self.epoch:
            self._grants.hear(robot, report)
        if not stale:
            self._absence.doubted.discard(robot)
        if (member.phase, member.fault) != was:
            self._tell(now_ns, "report", robot, member.describe())
        if self.phase == GO and member.planned and member.has_stopped(self.epoch):
            return self._hear_stopped(member, now_ns)
        if self.phase == HOLD and member.epoch != self.epoch:
            return self._send_plan(member, now_ns)
        return []

    def _hear_stopped(self, member: Member, now_ns: int) -> list[Outgoing]:
        """Freeze the fleet for a robot that has stopped, unless the others may drive on for now."""
        if self._delay.bears(member, now_ns):
            return []
        if self._delay.begin(member, self.times, now_ns):
            self._tell(now_ns, "late", member.id, f"{member.id} is late; the others go on")
            return []
        if not self._was_held(member, now_ns):
            member.strike(self.epoch)
        self._fail(member, f"{member.id} stopped: {fault_name(member.fault)}", now_ns)
        return [self._command(now_ns)]

    def _was_held(self, member: Member, now_ns: int) -> bool:
        """Return whether a robot is late because others held it, which is no fault of its own."""
        if member.fault != LATE or self._grants is None:
            return False
        return self._grants.was_held(member.id, (now_ns - self.times.start_ns) // MILLISECOND)

    def _hear_pace(self, robot: str, pace: Pace, now_ns: int) -> list[Outgoing]:
        member = self.members.get(robot)
        if member is not None and member.boot == pace.boot and self.phase == GO:
            name = self._delay.robot
            if self._delay.hear(member, pace, self.times, now_ns):
                self._tell(now_ns, "late", name, f"{name} drives on later; all have new times")
        return []

    def _hear_gone(self, robot: str, now_ns: int) -> list[Outgoing]:
        """Record that the link to a robot is gone; a robot under way is lost at once."""
        member = self.members.get(robot)
        if member is None or member.boot is None:
            return []
        member.gone = True
        member.admission.leave()
        under_way = self.phase == GO or self.epoch != self.first_epoch
        if under_way and member.planned and not member.finished and not member.lost:
            self._give_up([Failing(member, "has lost its link", lost=True)], now_ns)
            return [self._command(now_ns)]
        return []

    def _hear_other(self, command: Command, now_ns: int) -> list[Outgoing]:
        """Give way to another coordinator of this fleet if its (epoch, boot id) is greater."""
        if command.boot != self.boot and (command.epoch, command.boot) > (self.epoch, self.boot):
            if not self.superseded:
                self._tell(now_ns, "superseded", "", "another coordinator leads this fleet now")
            self.superseded = True
        return []

    def _answer_clock(self, robot: str, clock: Clock, now_ns: int) -> list[Outgoing]:
        if robot not in self.members:
            return []
        answer = Clock(clock.boot, clock.sent_ns, now_ns, now_ns)
        return [Outgoing(keys.clock(self.name, robot), encode(answer))]

    def _muster(self, now_ns: int, was_away: bool) -> None:
        """Go when all are armed; after the first epoch, give up robots that do not arm in time."""
        if not self.missing(now_ns):
            self._turn("all armed", now_ns)
        elif self.epoch != self.first_epoch and not was_away:
            members = [m for m in self.members.planned if not self._is_back(m, now_ns)]
            self._give_up(that_do_not_arm(members, self.epoch, self._changed_ns, now_ns), now_ns)

    def _watch(self, now_ns: int, was_away: bool) -> None:
        """Look for lost and late robots while the fleet moves, and end the drive if all arrived."""
        moving = [m for m in self.members.planned if m.phase != DONE]
        if not moving:
            self._turn("all done" if self.members.has_arrived else "some can go on", now_ns)
            return

        def spared(member: Member) -> bool:
            return was_away or self._absence.spares(member.id, member.timeout_ns, now_ns)

        start, deadline = self.times.start_ns, self.times.deadline_ns
        self._give_up(on_the_way(moving, spared, start, deadline, now_ns), now_ns)
        if self._delay.is_over(now_ns):
            what, member = "new times did not come through", self.members[self._delay.robot]
            self._give_up([Failing(member, f"is late, and {what}", strike=True)], now_ns)

    def _settle(self, now_ns: int, was_away: bool) -> None:
        """Look for lost robots in a fleet that freezes."""
        if was_away or now_ns < self._patient_until_ns:
            return
        patience = self.times.settling_ns + FREEZE_PATIENCE
        waited = now_ns - self._changed_ns > patience
        for member in self.members.values():
            if self._is_back(member, now_ns):
                continue
            member.admission.look(member.timeout_ns, patience if waited else None, now_ns)
            if not member.finished:
                if member.is_silent(now_ns) and not member.lost:
                    what = "has lost its link" if member.gone else "has fallen silent"
                    self._give_up([Failing(member, what, lost=True)], now_ns)
                member.lost |= waited and member.planned and not member.is_at_rest()

    def _is_back(self, member: Member, now_ns: int) -> bool:
        """Return whether the coordinator was away too recently to call a robot silent."""
        return self._absence.is_recent(member.timeout_ns, now_ns)
