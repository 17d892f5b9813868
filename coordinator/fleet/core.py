"""The fleet core: a state machine from messages and time to messages.  Pure.

The phase is HOLD until every robot that has a part in the epoch is armed; then it is GO, with a
common start time.  In GO, a robot that is late, silent or has stopped holds those that would drive
into it, and nobody else (grants.py).  If it holds others for long, it is given up, and others go
around it.  When nobody gets on any more, the phase is OVER.  FREEZE is for a fleet whose floor has
changed: when it rests it gets a new plan (`adopt`), and the next epoch begins in HOLD.  Every tick
sends a Command that states the phase, so a lost message changes nothing.  An event that is not
listed for a phase changes nothing either.

The same inputs give the same bytes; replay relies on it.

Decides: which messages are sent to which robot, and when the fleet goes, freezes and ends.  Must
not know: clocks (`now_ns` is an argument), Zenoh, files, paths.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from coordinator.fleet.admission import Door
from coordinator.fleet.epoch_times import EpochTimes
from coordinator.fleet.events import Outgoing, Part
from coordinator.fleet.failures import sets_out, silent, that_do_not_arm
from coordinator.fleet.grants import Grants
from coordinator.fleet.log_records import LINK_GONE, LINK_UP, router_key
from coordinator.fleet.member import Member, Place
from coordinator.fleet.operated_fleet import OperatedFleet
from coordinator.fleet.orders import OrderBook
from coordinator.fleet.phases import (
    AWAY,
    FREEZE_PATIENCE,
    GO_LEAD,
    HELD_PATIENCE,
    LINKS_PATIENCE,
    LONGEST_EPOCH,
    RETURN_PATIENCE,
    SILENT_PATIENCE,
)
from coordinator.fleet.router_link import RouterLink
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import (
    Admit,
    Clock,
    Command,
    Hello,
    Report,
)
from protocol.phases import (
    COMMAND_NAMES,
    FREEZE,
    GO,
    HOLD,
    IDLE,
    NO_FAULT,
    OFF_PATH,
    OVER,
    STOP,
    fault_name,
)
from protocol.timing import MILLISECOND, REPORT_TIMEOUT, SECOND


class Fleet(OperatedFleet):
    """The coordinator's side of a fleet; all times in ns on the coordinator's clock."""

    def __init__(
        self,
        name: str,
        boot: int,
        members: list[Member],
        times: EpochTimes,
        grants: Grants,
        orders: OrderBook | None = None,
    ) -> None:
        super().__init__(name, boot, members, times, grants, orders)
        self._door = Door(name, self.members, self.incidents)

    def check_places(self, why_not_at: Callable[[str, Place], str]) -> None:
        """Have somebody who knows the floor check the places at which robots come back.

        `why_not_at`: says why a robot cannot stand at a place, to follow the place; "" if it can.
        """
        self._door.why_not_at = why_not_at

    def hear(self, key: str, payload: bytes, now_ns: int) -> list[Outgoing]:
        """Take in a message that arrived on a key; return what to send.  Count bad messages."""
        if key == router_key(self.name):
            self._hear_router(payload == LINK_UP, now_ns)
            return []
        place = keys.split(key)
        if place is None or place[0] != self.name or place[1] in ("plan", "orders", "blocks"):
            self.bad_messages += 1
            return []
        _, kind, robot = place
        if kind == "alive":
            return self._hear_gone(robot, now_ns) if payload == LINK_GONE else []
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
            return self._hear_admit(robot, message, now_ns)
        answer = self.hear_operator(message, now_ns)
        if answer is not None:
            return answer
        self.bad_messages += 1
        return []

    def tick(self, now_ns: int) -> list[Outgoing]:
        """Act on the time and return the Commands; to be called every COMMAND_PERIOD.

        Who gave way to another coordinator, or to what its log lacks, says nothing any more.
        """
        if self.superseded:
            return []
        passed_ns, was_away = now_ns - self._looked_ns, self._was_away(now_ns)
        if self._has_yet_to_speak or self._has_yet_to_hear(now_ns):
            self._begin_again(now_ns)
        elif passed_ns > AWAY or self._router.is_down:
            patience = RETURN_PATIENCE if was_away else 0
            lost_ns = passed_ns if self.phase == GO else 0
            before_ns = None if self._router.is_down else now_ns - passed_ns
            self._excuse(now_ns + patience, lost_ns, before_ns)
        self._looked_ns = now_ns
        if was_away:
            text = f"the coordinator was away for {passed_ns / SECOND:.1f} s"
            self._tell(now_ns, "away", "", text)
        if self.phase == HOLD:
            self._muster(now_ns)
        elif self.phase == GO and self.times.plan_ms(now_ns) > LONGEST_EPOCH // MILLISECOND:
            self.plan_anew("plan time is ten days old", now_ns)
        elif self.phase == GO:
            self._watch(now_ns)
        elif self.phase == FREEZE:
            self._settle(now_ns)
        elif self.phase == OVER:
            self._farewells += 1
            self.orders.refuse_all(lambda task: task.reason or "the fleet has ended")
        return [*self._commands(now_ns), *self.new_courses(now_ns), *self.order_states()]

    def adopt(
        self,
        epoch: int,
        parts: Mapping[str, Part],
        now_ns: int,
        grants: Grants,
    ) -> list[Outgoing]:
        """Begin the next epoch with the parts of these robots; the others stay where they are."""
        self.epoch, self.grants, self.allowed_ms = epoch, grants, 0
        self.times.begin(epoch)
        self.members.assign(parts, epoch)
        self._turn("planned" if parts else "none can go", now_ns)
        return self._commands(now_ns)

    def take_over(self, boot: int, last_ns: int, now_ns: int) -> None:
        """Go on for a coordinator that died and was last known alive at `last_ns`.

        Robots are where their last authorities let them stop.  The plan goes on where it was, and
        the robots get RESUME_PATIENCE to be heard again, from when the first of them is heard.
        """
        self.boot, self._sequence, self.term = boot, 0, self.term + 1
        self.superseded, self._router, self.is_resumed = False, RouterLink(), True
        for member in self.members.values():
            member.gone = False
            member.forget_rest()
        if self.phase == GO:
            self.grants.lose_sight(self.allowed_ms)
        later_ns = now_ns - last_ns
        if later_ns < 0:  # The computer was started anew, and its clock with it.
            self._set_back(later_ns)
        self._unheard_since_ns, self._waits_since_ns = now_ns, None
        self.times.put_off(later_ns + GO_LEAD)
        self._changed_ns, self._stopped_ns = now_ns, self._stopped_ns + later_ns
        self._looked_ns = now_ns
        self._begin_again(now_ns)
        self._tell_phase(now_ns, f"resumed from a log: {COMMAND_NAMES[self.phase]}")

    def leave_floor(self, now_ns: int) -> None:
        """Freeze the fleet, because its floor has changed: it goes on with a new plan."""
        self.plan_anew("the floor has changed", now_ns)

    def plan_anew(self, why: str, now_ns: int) -> None:
        """Freeze the fleet; when all rest, it goes on with a new plan."""
        self._tell(now_ns, "floor", "", f"{why}; the fleet is planned anew when all rest")
        self._turn("floor changed", now_ns)

    def _hear_hello(self, robot: str, hello: Hello, now_ns: int) -> list[Outgoing]:
        has_gone = self.phase != HOLD and (self.times.has_gone or self.phase == OVER)
        begun = has_gone or self.epoch != self.first_epoch
        if robot not in self.members and self.has_gone and not self.is_ending:
            self._door.tell_stranger(robot, now_ns)  # It says hello until an operator takes it in.
            return []
        self._unheard_since_ns = 0
        answer = self._door.hear(robot, hello, begun, now_ns)
        if answer is None or isinstance(answer, Outgoing):
            return [answer] if answer else []
        return self._send_plan(answer, now_ns)

    def _hear_admit(self, robot: str, admit: Admit, now_ns: int) -> list[Outgoing]:
        """Admit a robot that has come back or that is heard again.

        One that has a course in this epoch is granted nothing more on it, and gets another one from
        the place that it states.  For others the fleet freezes.  A frozen fleet needs no request
        for a robot that has a part and is heard: the next plan includes it.
        """
        member = self.members.get(robot)
        if self.phase == FREEZE and member is not None and member.is_under_way(now_ns):
            return []
        answer = self._door.admit(robot, admit.boot, now_ns)
        if not answer or isinstance(answer, Outgoing):
            return [answer] if answer else []
        if self.phase in (GO, STOP) and member is not None and self._has_course(robot):
            if not self.grants.is_over(robot):
                self.go_around(member, now_ns)
            self.orders.put_back(robot)
        else:
            self._turn("admitted", now_ns)
        return self._commands(now_ns)

    def _has_course(self, robot: str) -> bool:
        """Return whether a robot has a course in this epoch, which can be given up."""
        mine = self.grants.of(robot)
        return mine is not None and mine.now.course is not None

    def _hear_report(self, robot: str, report: Report, now_ns: int) -> list[Outgoing]:
        member = self.members.get(robot)
        if member is None:
            return self._hear_outsider(robot, now_ns)
        self._unheard_since_ns = 0
        if report.rest is not None and not 1 <= report.rest.epoch <= self.times.epoch:
            self.bad_messages += 1  # The place is on a path that the coordinator does not know.
            if report.boot == member.boot:
                self.outrun(f"{robot} rests on a path of epoch {report.rest.epoch}", now_ns)
            return []
        if report.boot == member.boot and self._was_ahead_of_log(report):
            self.outrun(f"{robot} has driven on in epoch {report.epoch}", now_ns)
        was, had_stopped = (member.phase, member.fault), member.has_stopped(self.epoch)
        was_unheard = member.is_unheard(now_ns)
        if not member.hear(report, now_ns):
            return []
        if was_unheard:
            self._door.tell_heard_again(member, now_ns)
        if report.epoch == self.epoch:
            plan_ms = self.times.plan_ms(now_ns)
            if not self.grants.hear(robot, report, plan_ms):
                self.outrun(f"{robot} has driven farther", now_ns)
        if (member.phase, member.fault) != was:
            self._tell(now_ns, "report", robot, member.describe())
            if not had_stopped:
                self._note_stop(member, now_ns)
        late = self.phase == GO and member.phase == IDLE
        if (late or self.phase == HOLD) and member.epoch != self.epoch:
            return self._send_plan(member, now_ns)
        return []

    def _hear_outsider(self, robot: str, now_ns: int) -> list[Outgoing]:
        """Note that a robot is heard that was taken out; it gets no answer."""
        if robot in self.outside_ns:
            self.outside_ns[robot] = now_ns
        return []

    def _note_stop(self, member: Member, now_ns: int) -> None:
        """Tell of a robot under way that has stopped; if the fault is its own, that is a strike."""
        if self.phase != GO or not (member.planned and member.has_stopped(self.epoch)):
            return
        if member.fault != NO_FAULT:
            member.strike(self.epoch)
        text = f"{member.id} stopped: {fault_name(member.fault)}"
        self._tell(now_ns, "fault", member.id, text)

    def _was_ahead_of_log(self, report: Report) -> bool:
        """Return whether a report tells of a plan, or of a GO, that the coordinator never sent."""
        if report.epoch > self.epoch:
            return True
        return self.phase == HOLD and report.epoch == self.epoch and sets_out(report)

    def new_courses(self, now_ns: int) -> list[Outgoing]:
        """Return the courses that robots do not hold yet, to be sent again."""
        if self.phase != GO:
            return []
        lacking = [
            one
            for one in self.members.values()
            if one.lacks_course(self.epoch)
            and not one.has_dropped_course(self.epoch)
            and not one.is_out_of_reach
            and one.is_heard(now_ns)
        ]
        return [plan for member in lacking for plan in self._send_plan(member, now_ns)]

    def _was_away(self, now_ns: int) -> bool:
        """Return whether the coordinator hung for so long that links to it were given up."""
        is_running = self._looked_ns > 0 and not self._has_yet_to_speak
        return is_running and now_ns - self._looked_ns > REPORT_TIMEOUT

    @property
    def _has_yet_to_speak(self) -> bool:
        """Whether it has taken over from another coordinator, and sent no Command since."""
        return self.is_resumed and self._sequence == 0

    def _has_yet_to_hear(self, now_ns: int) -> bool:
        """Whether it has taken over, and nobody's link may have been made since.

        Robots that are all silent have not failed all at once: it waits LINKS_PATIENCE for one.
        """
        since_ns = self._unheard_since_ns
        return since_ns > 0 and now_ns - since_ns <= LINKS_PATIENCE

    def _hear_gone(self, robot: str, now_ns: int) -> list[Outgoing]:
        """Record that the link to a robot is gone; a robot under way is lost at once.

        A coordinator that was away has lost the link itself: then silence alone counts.
        """
        member = self.members.get(robot)
        if member is None or member.boot is None:
            return []
        if self._was_away(now_ns) or now_ns < member.excused_ns:
            return []
        member.gone = True
        member.admission.leave()
        is_before = self.phase == HOLD and self.epoch == self.first_epoch
        under_way = self.phase != OVER and not is_before
        if under_way and member.planned and not member.finished and not member.lost:
            self._lose(member, now_ns)
            if self.phase == HOLD:
                self._turn("robot failed", now_ns)
                return self._commands(now_ns)
        return []

    def _hear_other(self, command: Command, now_ns: int) -> list[Outgoing]:
        """Give way to another coordinator of this fleet if its (term, boot id) is greater.

        Robots under way obey the coordinators of their own run alone, so one that has sent robots
        on their way gives way to no other run.
        """
        has_gone = self.times.has_gone or self.epoch != self.first_epoch
        if command.boot == self.boot or (has_gone and command.run != self.run):
            return []
        if (command.term, command.boot) > (self.term, self.boot):
            if not self.superseded:
                self._tell(now_ns, "superseded", "", "another coordinator leads this fleet now")
            self.superseded = True
        return []

    def _answer_clock(self, robot: str, clock: Clock, now_ns: int) -> list[Outgoing]:
        if robot not in self.members:
            return []
        answer = Clock(clock.boot, clock.sent_ns, now_ns, now_ns, self.boot)
        return [Outgoing(keys.clock(self.name, robot), encode(answer))]

    def _muster(self, now_ns: int) -> None:
        """Go when all are armed; after the first epoch, give up robots that do not arm in time."""
        if not self.missing(now_ns):
            self._turn("all armed", now_ns)
        elif self.epoch != self.first_epoch:
            planned, since_ns = self.members.planned, max(self._changed_ns, self._patient_until_ns)
            self._give_up(that_do_not_arm(planned, self.epoch, since_ns, now_ns), now_ns)

    def _watch(self, now_ns: int) -> None:
        """Give up robots that are lost or do not get on, and hold others: those go around them.

        That is done after HELD_PATIENCE, or SILENT_PATIENCE.  The fleet ends when no order is open
        and nobody is on the way, or nobody has got on for SILENT_PATIENCE.  It is planned once more
        for those that had no part in the plan for a changed floor.
        """
        self._look_at_admissions(FREEZE_PATIENCE, now_ns)
        moving = [m for m in self.members.values() if m.is_on_floor and not m.has_arrived]
        if not moving and self.orders.is_open_or_stays:
            self._waits_since_ns = None
            return
        if not moving:
            left = any(not (m.planned or m.finished) for m in self.members.values())
            self._turn("some can go on" if left else "all done", now_ns)
            return
        if self._router.is_down:
            self._waits_since_ns = None
            return
        self._lose_silent(moving, now_ns)
        failing = self._failing(moving, now_ns)
        rests_ms = self.times.plan_ms(now_ns) - self.grants.standstills.got_on_latest_ms
        ends = rests_ms > SILENT_PATIENCE // MILLISECOND and not self.orders.is_open_or_stays
        if not failing and not ends:
            self._waits_since_ns = None
            return
        if self._waits_since_ns is None:
            self._waits_since_ns = now_ns
        since_ns, are_cut = self._waits_since_ns, all(m.lost and not m.gone for m in moving)
        if are_cut and self._router.may_be_silent(since_ns, now_ns):
            return
        if not failing:
            names, patience = ", ".join(m.id for m in moving), SILENT_PATIENCE // SECOND
            text = f"nobody has got on for {patience} s: the fleet ends, {names} did not arrive"
            self._tell(now_ns, "stays", "", text)
            self._turn("all done", now_ns)
            return
        are_silent = all(member.lost and not member.gone for member in failing)
        if now_ns - since_ns > (SILENT_PATIENCE if are_silent else HELD_PATIENCE):
            self._waits_since_ns = None
            for member in failing:
                if not member.lost:
                    member.strike(self.epoch)
                    self._tell(now_ns, "fault", member.id, self._stuck_in_words(member))
                self.go_around(member, now_ns)

    def _stuck_in_words(self, member: Member) -> str:
        """Return words that say where a robot does not get on, and what to do."""
        robot, place = member.id, ""
        mine = self.grants.of(robot)
        if mine is not None and mine.now.course is not None:
            driven, passed_s = mine.now.course.driven, 0.001 * self.spans(robot)[0].since_ms
            x, y = driven.curve.at_arc([driven.timeline.s_at(passed_s)])[0]
            place = f"({x:.1f}, {y:.1f})"
        if member.phase == IDLE and member.fault == OFF_PATH and place:
            what = "put it there, or start its program again and admit it"
            return f"{robot} does not stand at {place}, where its course begins: {what}"
        near = f" near {place}" if place else ""
        what = "its wheels may be stuck. Press STOP before you free it; it goes on by itself"
        return f"{robot} does not get on{near}: {what}"

    def _failing(self, moving: list[Member], now_ns: int) -> list[Member]:
        """Return the robots that are lost and hold others, or that do not get on.

        One that is lost and holds nobody is in nobody's way, unless orders may lead others there.
        """
        grants, are_orders = self.grants, self.orders.is_open_or_stays
        stuck = grants.stuck(self.times.plan_ms(now_ns))
        return [
            one
            for one in moving
            if (
                one.id not in grants.given_up
                and (one.id in stuck and not one.is_new and (are_orders or not one.lost))
            )
            or (one.lost and not grants.is_over(one.id) and grants.standstills.behind([one.id]))
        ]

    def _lose_silent(self, moving: list[Member], now_ns: int) -> None:
        for member in moving:
            if member.is_silent(now_ns) and not member.lost:
                self._lose(member, now_ns)

    def _settle(self, now_ns: int) -> None:
        """Look for lost robots in a fleet that freezes."""
        if now_ns < self._patient_until_ns:
            return
        patience = self.times.settling_ns + FREEZE_PATIENCE
        waited = now_ns - self._changed_ns > patience
        self._look_at_admissions(patience if waited else None, now_ns)
        for member in self.members.values():
            if not member.finished:
                if member.is_silent(now_ns) and not member.lost:
                    self._give_up([silent(member)], now_ns)
                member.lost |= waited and member.planned and not member.is_at_rest()

    def _look_at_admissions(self, patience_ns: int | None, now_ns: int) -> None:
        """Wait no longer for robots that have come back and do not say where they stand."""
        for member in self.members.values():
            member.admission.look(member.timeout_ns, patience_ns, now_ns)
