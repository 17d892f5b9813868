"""What the coordinator knows of one robot: who it is, what it said last, and when.

Decides: when a robot counts as armed, lost, fit or at rest.  Must not know: the other robots.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import msgspec

from coordinator.fleet.came_back import Admission
from coordinator.fleet.rest_places import Standing, State, standing_of
from coordinator.fleet.sent_courses import Span
from coordinator.plan.capacity import Capacity
from protocol.messages import Hello, Report
from protocol.phases import (
    ARMED,
    BRAKING,
    CLOCK_UNSURE,
    DONE,
    FROZEN,
    IDLE,
    MOVING,
    OFF_PATH,
    PHASE_NAMES,
    fault_name,
)
from protocol.timing import COMMAND_PERIOD, REPORT_TIMEOUT, SECOND

PLAN_PERIOD: Final = COMMAND_PERIOD
REFUSAL_PATIENCE: Final = 5 * SECOND
"""A robot that has not taken a course after this time refuses it: it was sent over and over."""

STRIKES: Final = 3
"""A robot that has ended this many epochs by a fault of its own is left where it stands."""

WITHOUT: Final[dict[str, str]] = {
    "lost": "it is lost, no longer heard",
    "unfit": f"it has failed in {STRIKES} epochs",
    "overloaded": "it cannot hold its course",
}
"""Why the next plan is made without a robot of this state, in words."""

_BEYOND: Final = 1e9
"""An arc length [m] beyond the end of every path."""

BOOTS: Final = 64
"""The coordinator remembers the Hellos of at most this many processes under one name."""

Place = tuple[float, float, float]
"""Where a robot stands: x, y [m] and its heading [rad]."""


def place_of(hello: Hello) -> Place | None:
    """Return where a robot that has come back says that it stands; None if it does not say it."""
    if hello.place is None:
        return None
    x, y, heading = (number / 1000.0 for number in hello.place)
    return x, y, heading


@dataclass
class Member:
    """One robot of the fleet, as the coordinator has heard it.

    `boot`: the boot id of its accepted process; None before one is accepted.
    `planned`: it has a part in this epoch.  `revision`: the newest course that it was sent in it,
    whose message is `plan`; `driven`, `holds`: the courses that it says it drives, and holds.
    `excused_ns`: until then it could not be heard, which is not its fault.
    `sent_epoch`: the last epoch in which it may have moved.
    `part_epoch`: the last epoch in which it got a part.
    `finished`: it has reached its goal.
    `ended`: the course, by epoch and revision, at whose end it was last heard to be.
    `rest`: where it last said that it rests; None if it may have moved since.
    `stays`: why it got no part in this epoch although it could have had one, in words.
    """

    id: str
    radius: float
    speed: float
    """The speed that its plan needs [m/s]."""
    plan: bytes
    accel: float = 0.0
    """The deceleration that its plan and tau count on [m/s^2]; inf if the robot stops at once."""
    timeout_ns: int = REPORT_TIMEOUT
    planned: bool = True
    boot: int | None = None
    heard_ns: int = 0
    excused_ns: int = 0
    sequence: int = -1
    revision: int = 0
    driven: int = 0
    holds: int = 0
    sent_epoch: int = 0
    epoch: int = 0
    phase: int = IDLE
    fault: int = 0
    plan_sent_ns: int | None = None
    course_since_ns: int = 0
    """When it was first to be sent its newest course."""
    frozen_ns: int = 0
    """When it was first heard to have frozen, after it last drove or rested at a goal."""
    course_before: tuple[bytes, int] = (b"", 0)
    """The course before the newest one: its message and its revision."""
    done_ns: int | None = None
    lost: bool = False
    gone: bool = False
    part_epoch: int = 1
    finished: bool = False
    ended: tuple[int, int] = (0, 0)
    struck: set[tuple[int, int]] = field(default_factory=set)
    """The courses, by epoch and revision, on which it has failed since it last arrived."""
    rest: Standing | None = None
    admission: Admission = field(default_factory=Admission)
    capacity: Capacity = field(default_factory=Capacity)
    overload: str = ""
    """Why it cannot hold its plan, in words."""
    stays: str = ""
    is_new: bool = False
    """Whether it joins a fleet under way, and no process of it was sent a course yet."""

    hellos: dict[int, int] = field(default_factory=dict)
    """The sequence number of each process's newest Hello, by boot id, as they were first heard."""

    @property
    def rest_s(self) -> float | None:
        """Where on its path the robot rests [m], if it has said so."""
        return None if self.rest is None else self.rest.s

    def has_heard(self, hello: Hello) -> bool:
        """Record a Hello; return whether it or a later one of its process was heard before."""
        newest = self.hellos.get(hello.boot, 0)
        self.hellos[hello.boot] = max(newest, hello.sequence)
        if len(self.hellos) > BOOTS:
            del self.hellos[next(iter(self.hellos))]
        return 0 < hello.sequence <= newest

    def is_older_than_at_door(self, boot: int, now_ns: int) -> bool:
        """Return whether a program was first heard before the one that waits to be admitted.

        Its Hello may be a late one, with a place where the robot does not stand any more.
        """
        there, boots = self.admission.hello, list(self.hellos)
        if there is None or not {boot, there.boot} <= set(boots):
            return False
        is_older = boots.index(boot) < boots.index(there.boot)
        return is_older and self.admission.is_at_door(self.timeout_ns, now_ns)

    def knock(self, hello: Hello, now_ns: int) -> None:
        """Record that a robot of this name has come back, so that an operator may admit it."""
        self.admission.knock(hello, now_ns)
        place = place_of(hello)
        if self.admission.is_awaited and place is not None:
            self.accept(hello, now_ns)
            self.finished = self.planned = False
            self.stays = self.overload = ""
            self.sent_epoch, self.ended = 0, (0, 0)
            self.struck.clear()
            self.admission.take_in()
            self.rest = Standing(robot=self.id, state="rests", epoch=0, place=place)

    def accept(self, hello: Hello, now_ns: int) -> None:
        """Accept a robot's process and forget what an earlier process of that name said."""
        self.heard_ns, self.lost, self.gone = now_ns, False, False
        if hello.boot == self.boot:
            return
        self.boot, self.sequence, self.epoch, self.phase, self.fault = hello.boot, -1, 0, IDLE, 0
        if self.is_new:
            self.excused_ns = now_ns  # It was given time to be started.
        self.driven = self.holds = 0
        self.capacity = Capacity.of(hello)
        self.overload = self.capacity.objection(self.plan)
        self.plan_sent_ns = self.done_ns = None

    def set_back(self, by_ns: int) -> None:
        """Take in that the clock has begun anew: all that was heard was that much earlier [ns]."""
        self.heard_ns += by_ns
        self.excused_ns += by_ns
        self.course_since_ns += by_ns
        self.frozen_ns += by_ns
        self.done_ns = None if self.done_ns is None else self.done_ns + by_ns
        self.plan_sent_ns = None
        self.admission.leave()

    def await_start(self, until_ns: int) -> None:
        """Give a robot that joins time for its program to be started, if it is not there yet."""
        if self.boot is None:
            self.excused_ns = until_ns

    def set_out(self, epoch: int) -> None:
        """Record that the robot is sent on its way, which makes its place of rest obsolete."""
        self.sent_epoch, self.rest = epoch, None

    def take_part(self, plan: bytes, speed: float, epoch: int) -> None:
        """Give the robot a part in an epoch."""
        self.planned, self.plan, self.speed, self.part_epoch = True, plan, speed, epoch
        self.revision = self.driven = self.holds = 0
        self.plan_sent_ns = self.rest = None
        self.overload = self.capacity.objection(plan)

    def take_course(self, plan: bytes, revision: int, now_ns: int) -> None:
        """Give the robot another course in the same epoch.

        A robot that has come back never drives the one before it.
        """
        is_back = self.came_back_to is not None
        self.course_before = (b"", 0) if is_back else (self.plan, self.revision)
        self.planned, self.course_since_ns = True, now_ns
        self.plan, self.revision = plan, revision
        self.plan_sent_ns = self.done_ns = None
        self.finished = False

    def possible_plans(self) -> list[bytes]:
        """Return the messages of the courses that the robot may be driving."""
        before, revision = self.course_before
        drives_before = before and self.driven == revision < self.revision
        return [before, self.plan] if drives_before else [self.plan]

    def forget_rest(self) -> None:
        """Take in that the robot may have begun its newest course since it was heard."""
        if self.phase == DONE and self.driven != self.revision:
            self.phase = MOVING

    @property
    def has_arrived(self) -> bool:
        """Whether the robot is at the goal of its newest course."""
        course = (self.part_epoch, self.revision)
        return self.phase == DONE and (self.epoch, self.driven) == course

    def has_driven(self, epoch: int, revision: int) -> bool:
        """Return whether the robot is at the end of a course, or has left it for the next one."""
        is_at_end = self.phase == DONE and self.driven == revision
        return self.epoch == epoch and (is_at_end or self.driven > revision)

    def lacks_course(self, epoch: int) -> bool:
        """Return whether the robot has set out, and lacks its newest course."""
        has_old = self.epoch == epoch and self.phase in (MOVING, DONE, FROZEN)
        return self.planned and has_old and self.holds < self.revision

    @property
    def is_out_of_reach(self) -> bool:
        """Whether a course would reach nobody, or a program that is not admitted."""
        return self.lost or self.gone or self._has_another_program

    def has_dropped_course(self, epoch: int) -> bool:
        """Return whether the robot has stopped before it began its newest course.

        It must not get that again: its next one is from where it has stopped.
        """
        is_older = self.course_since_ns < self.frozen_ns
        return self.phase == FROZEN and is_older and self.lacks_course(epoch)

    def refuses_course(self, epoch: int, now_ns: int) -> bool:
        """Return whether the robot is heard, and has not taken its newest course for long."""
        since_ns = max(self.course_since_ns, self.excused_ns)
        is_long = now_ns - since_ns > REFUSAL_PATIENCE
        return is_long and self.lacks_course(epoch) and not self.is_silent(now_ns)

    def withdraw_course(self) -> None:
        """Send the newest course no more; the one before it counts.

        A robot that has come back has none before it, and has no part until it gets one.
        """
        self.plan, self.revision = self.course_before
        self.planned = bool(self.plan)
        self.finished = self.has_arrived

    def plan_due(self, now_ns: int) -> bool:
        """Return whether to send the plan now; if so, record it as sent."""
        just_sent = self.plan_sent_ns is not None and now_ns - self.plan_sent_ns < PLAN_PERIOD
        if not self.planned or just_sent:
            return False
        self.plan_sent_ns, self.is_new = now_ns, False
        return True

    def hear(self, report: Report, now_ns: int) -> bool:
        """Take in a report; return False when it is not the newest of this robot's process."""
        if report.boot != self.boot or report.sequence <= self.sequence:
            return False
        if self.is_silent(now_ns):
            self.excused_ns = max(self.excused_ns, now_ns)
        self.heard_ns = now_ns
        if self._has_another_program and not self.admission.is_at_door(self.timeout_ns, now_ns):
            self.admission.hello = None  # It is there no more.
        self.sequence, self.lost, self.gone = report.sequence, False, False
        if self.phase == DONE and report.phase in (BRAKING, FROZEN):
            self.finished, self.done_ns = False, None  # It was pushed off its goal.
        if self.phase != FROZEN and report.phase == FROZEN:
            self.frozen_ns = now_ns
        self.epoch, self.phase, self.fault = report.epoch, report.phase, report.fault
        self.driven, self.holds = report.revision, report.holds
        if self.phase == ARMED or (self.phase == IDLE and self.fault == OFF_PATH):
            self.finished = False  # It has another course, or is not where that begins.
        if report.rest is not None and report.rest.epoch >= self.sent_epoch:
            self.rest = standing_of(self.id, report.rest)
        elif (
            report.phase == MOVING
            or (self.came_back_to is not None and report.epoch > 0)
            or self._has_left_rest(report)
        ):
            self.rest = None
        if report.phase == DONE:
            self.ended = report.epoch, report.revision
        if self.has_arrived:
            self.finished = True
            self.struck.clear()
            self.done_ns = now_ns if self.done_ns is None else self.done_ns
        return True

    def _has_left_rest(self, report: Report) -> bool:
        """Return whether the robot has begun another course since it said where it rests."""
        rest = self.rest
        if rest is None or report.epoch != rest.epoch:
            return False
        return report.revision > rest.revision

    def describe(self) -> str:
        """Return words for what the robot does."""
        text = f"{self.id} is {PHASE_NAMES[self.phase]}"
        return f"{text}: {fault_name(self.fault)}" if self.fault else text

    def strike(self, epoch: int) -> None:
        """Record that the robot has failed on the course that it drives."""
        self.struck.add((epoch, self.driven))

    @property
    def is_fit(self) -> bool:
        """Whether the robot has fewer than STRIKES strikes, so that it may drive again."""
        return len(self.struck) < STRIKES

    def is_heard(self, now_ns: int) -> bool:
        """Return whether the robot's link is there and it has not been silent for too long."""
        return not self.gone and now_ns - self.heard_ns <= self.timeout_ns

    def is_silent(self, now_ns: int) -> bool:
        """Return whether the robot has lost its link, or is not heard and has no excuse."""
        return self.gone or now_ns - max(self.heard_ns, self.excused_ns) > self.timeout_ns

    def is_under_way(self, now_ns: int) -> bool:
        """Return whether the robot has a part in this epoch, has not arrived, and is heard."""
        return self.planned and not self.finished and not self.is_silent(now_ns)

    def is_unheard(self, now_ns: int) -> bool:
        """Return whether the robot is lost because nothing is heard from it."""
        return self.lost and self.is_silent(now_ns)

    def has_come_back(self, now_ns: int) -> bool:
        """Return whether another process of the robot is heard that was not accepted yet."""
        return self._has_another_program and self.admission.is_at_door(self.timeout_ns, now_ns)

    @property
    def _has_another_program(self) -> bool:
        """Whether a process of the robot has said hello that was not accepted yet."""
        hello = self.admission.hello
        return hello is not None and hello.boot != self.boot

    def is_armed(self, epoch: int, now_ns: int) -> bool:
        """Return whether the robot is armed with this epoch's plan, and is heard."""
        return self.phase == ARMED and self.epoch == epoch and self.is_heard(now_ns)

    def has_stopped(self, epoch: int) -> bool:
        """Return whether the robot has given up its timetable of this epoch.

        One that is not certain of the time has not; it arms when it is, and sets out.
        """
        if self.epoch not in (0, epoch) or self.fault == CLOCK_UNSURE:
            return False
        return self.phase in (BRAKING, FROZEN) or (self.phase != MOVING and self.fault != 0)

    @property
    def is_on_floor(self) -> bool:
        """Whether the robot has a part in this epoch, or is to get one where it came back."""
        return self.planned or self.came_back_to is not None

    @property
    def came_back_to(self) -> tuple[float, float, float] | None:
        """The pose [m, m, rad] from which a robot that has come back has not set out yet."""
        return None if self.rest is None else self.rest.place

    def rests_on(self, epoch: int, revision: int) -> Standing | None:
        """Return where a robot has stopped on a course, once it has said so; None if it has not.

        One that has come back rests at the place that it has stated.
        """
        rest = self.rest
        if self.came_back_to is not None:
            return None if self.lost else rest
        is_there = rest is not None and (rest.epoch, rest.revision) == (epoch, revision)
        return rest if is_there and self.phase == FROZEN and not self.lost else None

    def is_at_rest(self) -> bool:
        """Return whether the robot is at a goal or has said where it rests."""
        return self.finished or self.phase == DONE or self.rest is not None

    def standing(self, epoch: int, spans: Sequence[Span], now_ns: int) -> Standing:
        """Return what is known of where the robot is.

        A robot that has not said where it rests is somewhere on these spans of this epoch's
        courses.  It has not left the beginning of its path if it may not have driven beyond plan
        time 0.
        """
        if self.finished:
            ended, revision = self.ended
            return Standing(
                robot=self.id,
                state="arrived",
                epoch=ended,
                revision=revision,
                is_silent=self.is_silent(now_ns),
            )
        state: State = "rests" if self.is_fit else "unfit"
        state = "lost" if self.lost else "overloaded" if self.overload else state
        rest = self.rest
        if rest is None and self.phase == DONE:
            rest = self._at_end(epoch)
        if rest is None and all(one.until_ms <= 0 for one in spans):
            rest = Standing(robot=self.id, state=state, epoch=epoch, s=0.0)
        if rest is not None:
            return msgspec.structs.replace(rest, state=state)
        (revision, since, until), *also = [
            (one.revision, one.since_ms / 1000.0, one.until_ms / 1000.0) for one in spans
        ]
        return Standing(
            robot=self.id,
            state="lost",
            epoch=epoch,
            since=since,
            until=until,
            revision=revision,
            also=tuple(also),
        )

    def _at_end(self, epoch: int) -> Standing:
        """Return where a robot rests that is at the goal of a course that is not its newest."""
        return Standing(robot=self.id, state="rests", epoch=epoch, s=_BEYOND, revision=self.driven)
