"""Collects what a listener knows of a running fleet: plans, Commands, Reports, the fleet's time.

No message states why robots wait.  The reasons are found from the plans of an epoch that has begun
(findings/wait_guesses.py), or read from the plan file.

Decides: when something new is known.  Must not know: links, threads, the page, or how plans are put
together from messages (findings/plans_from_messages.py).
"""

from __future__ import annotations

from typing import Final

import msgspec

from coordinator.findings.braking import SILENT
from coordinator.findings.granted_courses import granted_of
from coordinator.findings.held import Holds, late_numbers
from coordinator.findings.info_fields import FaultSummary
from coordinator.findings.plans_from_messages import SaidPlans
from coordinator.findings.wait_guesses import with_reasons
from coordinator.fleet.log_records import LINK_GONE
from coordinator.fleet.task import LEAVE
from coordinator.log.unheard_plans import UnheardPlans
from coordinator.plan.document import PlanDocument
from coordinator.proof.granted import Granted
from coordinator.view.scene import Knot, Scene
from coordinator.view.scene_log import Course, scene_of_course
from protocol import keys
from protocol.codec import decode
from protocol.messages import ORDER_DONE, Clock, Command, Message, OrderState, Plan, Report
from protocol.phases import CLOCK_UNSURE, FAULT_NAMES, IDLE, NO_FAULT, OVER
from protocol.timing import SECOND

_SURE: Final = 2.0
"""Seconds for which the fleet's clock is compared with ours before its speed is estimated."""

_ASK_ORDERS: Final = 60.0
"""Interval [s] at which the coordinator is asked what has become of the orders."""

_ASK_AGAIN: Final = 0.7
_SETTLES: Final = 1.0
"""Who misses Commands asks for orders every _ASK_AGAIN [s], at last _SETTLES after a miss."""

_KEPT: Final = 600 * SECOND
"""For how long [ns] the page of a running fleet can be set back."""


class FleetTime(msgspec.Struct, frozen=True):
    """Seconds of the fleet since the first GO, and how many of them pass in one of our seconds."""

    now: float
    speed: float


class LastWord(msgspec.Struct, frozen=True):
    """How long ago [s] the last Command was heard, and the headroom [s]: how long robots drive on.

    over: whether the last Command's phase was OVER.
    """

    age: float
    headroom: float
    over: bool


class LateRides(msgspec.Struct, frozen=True):
    """How far in their plans the robots of an epoch have come that are or were late.

    By robot, the revision of the course that it drives, and the last knots (at most two) of its
    ride's `passed` (scene.py); one that is on time again stays.
    """

    epoch: int
    passed: dict[str, tuple[int, list[Knot]]]


class LiveCourse:
    """The course of a fleet, put together message by message; `now` is our clock in seconds."""

    def __init__(self, fleet: str | None, document: PlanDocument | None) -> None:
        self.fleet = fleet
        self._course = Course()
        self._stand: tuple[int, tuple[int, int], tuple[str, ...], frozenset[str]] | None = None
        self._granted: dict[int, Granted] = {}
        self._holds = Holds()
        self._faults: dict[str, int] = {}
        self._lost: set[str] = set()
        self._left: set[str] = set()
        """Robots that were taken out: that their links end then is no news."""

        self._back: set[str] = set()
        """Robots that were lost, and have no course since their programs started again."""

        self._first: tuple[int, float] | None = None
        self._latest: tuple[int, float] = (0, 0.0)
        self._word: tuple[float, int] | None = None
        self._headroom = 0.0
        self._lacks_orders = False
        self._asked = 0.0
        self._sequence = (0, 0)
        self._gap: float | None = None
        """When Commands were missed last; until asked once more, states of orders may be, too."""

        self.floor = document
        """The plan that was known before anything was heard, with the floor."""

        self._said = SaidPlans(self._course.plans, document)
        self._explained: dict[int, int] = {}
        self.unheard = UnheardPlans(0 if document is None else document.epoch)
        if document is not None:
            self._course.plans[document.epoch] = document
            self._course.whole.add(document.epoch)

    def hear(self, key: str, payload: bytes, now: float) -> bool:
        """Process a message on a key; return whether a page would look different."""
        place = keys.split(key)
        if place is None or place[0] != (self.fleet or place[0]) or place[1] == "admit":
            return False
        self.fleet = place[0]
        if place[1] == "alive":
            return payload == LINK_GONE and self._lose(place[2], "lost its link", "link", now)
        message = decode(place[1], payload)
        if isinstance(message, Clock) and message.answered_ns is not None:
            self._set_clock(message.answered_ns, now)
        return message is not None and self._take(message, place[2], now)

    def asks_orders(self, now: float) -> bool:
        """Return whether to ask what has become of the orders; if so, record that it was asked.

        A message about an order is sent once: what was missed is asked for after a silence, when
        Commands were missed and a while after the last such time, and now and then.
        """
        is_due = self._lacks_orders or now - self._asked > _ASK_ORDERS
        if self._gap is not None and now - self._asked > _ASK_AGAIN:
            is_due = True
        if self.fleet is None or not is_due:
            return False
        self._lacks_orders, self._asked = False, now
        if self._gap is not None and now - self._gap > _SETTLES:
            self._gap = None
        return True

    def scene(self) -> Scene:
        """Return the scene of what is known, which is empty before the first plan."""
        if not self._course.plans:
            return _nothing(self.fleet or "")
        self._explain()
        before_ns = self._course.last - _KEPT
        if self._course.starts and before_ns > min(self._course.starts.values()):
            self._course.forget(before_ns)
        return msgspec.structs.replace(scene_of_course(self._course), name=self.fleet or "")

    def _explain(self) -> None:
        """Find out why robots wait in epochs that have begun, unless that is known already."""
        plans = self._course.plans
        for epoch in set(self._course.starts) & set(plans):
            count = len(plans[epoch].robots)
            is_told = plans[epoch] is self.floor or self._explained.get(epoch, 0) == count
            if not is_told:
                plans[epoch] = with_reasons(plans[epoch])
                self._explained[epoch] = count

    def clock(self, now: float) -> FleetTime | None:
        """Return the fleet's time; None before its first GO or before its clock is known."""
        if self._first is None or not self._course.starts:
            return None
        zero = self._course.zero_ns()
        speed = self._speed()
        passed = (self._latest[0] - zero) / SECOND + speed * (now - self._latest[1])
        return FleetTime(round(passed, 3), round(speed, 3))

    def word(self, now: float) -> LastWord | None:
        """Return how old the coordinator's last Command is; None before the first one."""
        if self._word is None:
            return None
        at, phase = self._word
        return LastWord(round(max(now - at, 0.0), 3), self._headroom, phase == OVER)

    def held_now(self) -> dict[str, tuple[str, float]]:
        """Return which robots are held now, by whom, and since when [s] after the first GO."""
        zero_ns = self._course.zero_ns()
        return {
            hold.robot: (hold.by, round((hold.since_ns - zero_ns) / SECOND, 3))
            for hold in self._holds.now
        }

    def late(self) -> LateRides | None:
        """Return how far late robots have come in the newest epoch; None if all were on time."""
        epoch = max(self._course.starts, default=0)
        last = {
            robot: (revision, [(round(t, 3), round(p, 3)) for t, p in knots])
            for robot, (revision, knots) in self._course.said.late(epoch).items()
        }
        return LateRides(epoch, last) if last else None

    def _take(self, message: Message, robot: str, now: float) -> bool:
        """Process a message of the fleet; return whether a page would look different."""
        before = self.unheard.robots
        self.unheard.take(message, robot)
        changed = self.unheard.robots != before
        return self._take_in(message, robot, now) or changed

    def _take_in(self, message: Message, robot: str, now: float) -> bool:
        course = self._course
        if isinstance(message, Command):
            self._set_clock(message.said_ns, now)
            if self._word is None or now - self._word[0] > _SURE:
                self._lacks_orders = True
            self._word = (now, message.phase)
            before, self._sequence = self._sequence, (message.boot, message.sequence)
            if before[0] == message.boot and message.sequence > before[1] + 1:
                self._gap = now
            self._headroom = max(message.headroom_ms / 1000.0, 0.0)
            course.take_command(message, self._now_ns(now))
            held = self._take_held(message, now)
            silent = course.said.silent(message.epoch, self._now_ns(now))
            for name in sorted(silent):  # One that has started again speaks, but of no course.
                heard_ns = course.said.last_ns(name)
                if heard_ns is not None and heard_ns < self._now_ns(now) - SILENT:
                    self._lose(name, "fell silent", "silence", now)
            phase = (message.phase, message.start_ns)
            stand = (message.epoch, phase, self._reasons(message.epoch), silent)
            changed = self._stand != stand
            self._stand = stand
            return changed or held
        if isinstance(message, Report):
            return self._take_report(message, robot, now)
        if isinstance(message, OrderState):
            return self._take_order(message, now)
        course.take_radius(message, robot)
        changed = self._said.take(message, robot, self.fleet or "")
        return (isinstance(message, Plan) and self._take_plan(message, now)) or changed

    def _take_plan(self, plan: Plan, now: float) -> bool:
        self._left.discard(plan.robot)
        if not self._course.take_plan(plan, self._now_ns(now)):
            return False
        if plan.robot in self._back:
            self._back.discard(plan.robot)
            self._return(plan.robot, "is admitted and has a course", now)
        if plan.epoch in self._granted:
            self._granted[plan.epoch].take_plan(plan.robot, plan)
        return True

    def _take_order(self, state: OrderState, now: float) -> bool:
        is_news = self._course.orders.take(state, self._now_ns(now))
        if is_news and state.id == f"{LEAVE}{state.robot}" and state.state == ORDER_DONE:
            self._left.add(state.robot)
            self._return(state.robot, "was taken out", now)
        return is_news

    def _take_held(self, command: Command, now: float) -> bool:
        """Find out who is held; return whether that has changed.

        What is granted is followed from the first Command on that grants some robot too little, as
        every Command and Report states all.  Who begins to listen when all robots have had orders
        knows no course of the plan, and not who is held.
        """
        epoch, plans = command.epoch, self._course.plans
        is_known = epoch in plans and bool(plans[epoch].robots)
        if epoch not in self._granted and late_numbers(command) and is_known:
            self._granted[epoch] = granted_of(plans[epoch])
            for one in self._course.sent.of(epoch):
                self._granted[epoch].take_plan(one.driven.id, one.driven.plan)
        granted = self._granted.get(epoch)
        if granted is not None:
            granted.take_command(command)
        self._holds.take(command, granted, self._now_ns(now))
        before, self._course.held = self._course.held, self._holds.all
        return before != self._course.held

    def _reasons(self, epoch: int) -> tuple[str, ...]:
        """Return why each known robot has no part in an epoch, as far as messages show."""
        plans = self._course.plans
        if epoch not in plans:
            return ()
        names = {robot.id for document in plans.values() for robot in document.robots}
        aside = names - self._course.takes_part(plans[epoch])
        return tuple(self._course.why_aside(epoch, name) for name in sorted(aside))

    def _lose(self, robot: str, what: str, kind: str, now: float) -> bool:
        """Take in that a robot of the fleet is not heard any more; return whether that is news."""
        takes_part = (
            robot in self._course.said.who(max(self._course.starts, default=0)) - self._left
        )
        if robot in self._lost or not takes_part or self._word is None or self._word[1] == OVER:
            return False
        self._lost.add(robot)
        self._course.faults.append((self._now_ns(now), FaultSummary(0.0, robot, what, kind)))
        return True

    def _return(self, robot: str, what: str, now: float) -> None:
        self._course.news.append((self._now_ns(now), robot, f"{robot} {what}", "go"))

    def _take_report(self, report: Report, robot: str, now: float) -> bool:
        course, now_ns = self._course, self._now_ns(now)
        is_back = robot in self._lost
        if is_back:
            self._lost.discard(robot)
            self._return(robot, "is heard again", now)
        if report.phase != IDLE:
            self._back.discard(robot)
        elif is_back:
            self._back.add(robot)
        stops = course.said.take(report, robot, now_ns)
        if report.epoch in self._granted:
            self._granted[report.epoch].take_report(robot, report)
        learning = (
            report.phase == IDLE and report.fault == CLOCK_UNSURE
        )  # as every robot does at first
        fault = NO_FAULT if learning else report.fault
        changed = fault != self._faults.get(robot, NO_FAULT)
        self._faults[robot] = fault
        if changed and fault != NO_FAULT:
            name = FAULT_NAMES[fault] if fault < len(FAULT_NAMES) else "a fault"
            course.faults.append((now_ns, FaultSummary(0.0, robot, name, "report")))
        return changed or stops or is_back

    def _set_clock(self, said_ns: int, now: float) -> None:
        """Take in the coordinator's time [ns], heard at our time [s]."""
        self._first = self._first or (said_ns, now)
        if said_ns >= self._latest[0]:
            self._latest = (said_ns, now)

    def _speed(self) -> float:
        """Return how many of the fleet's seconds pass in one of our seconds."""
        if self._first is None or self._latest[1] - self._first[1] < _SURE:
            return 1.0
        passed = (self._latest[0] - self._first[0]) / SECOND
        return passed / (self._latest[1] - self._first[1])

    def _now_ns(self, now: float) -> int:
        """Return the fleet's time [ns], or the last Command's time if the clock is not known."""
        if self._first is None:
            return self._course.last
        return self._latest[0] + round(self._speed() * (now - self._latest[1]) * SECOND)


def _nothing(fleet: str) -> Scene:
    return Scene(
        name=fleet,
        policy="safe",
        tau=0.0,
        margin=0.0,
        proven=None,
        source="live",
        end=1.0,
        boundary=[],
        obstacles=[],
        robots=[],
        epochs=[],
    )
