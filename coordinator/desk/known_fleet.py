"""What is known of a running fleet from its messages: robots, orders, closed places, phase.

Decides: what counts as not heard.  Must not know: links, HTTP; `now` is our clock [s].
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from itertools import islice
from typing import Final, NamedTuple

import numpy as np

from coordinator.desk.alarms import Alarms
from coordinator.desk.answers import FleetAnswer, RobotState
from coordinator.exchange.vda5050_state import Seen
from coordinator.findings.info_fields import OrderSummary
from coordinator.fleet.log_records import LINK_UP
from coordinator.fleet.member import place_of
from coordinator.fleet.task import LEAVE
from coordinator.plan.wire import unpack
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import (
    CANCELLED,
    ORDER_DONE,
    ORDER_STATES,
    REFUSED,
    UNDER_WAY,
    Block,
    Command,
    Hello,
    Join,
    Message,
    OrderState,
    Plan,
    Report,
    Unblock,
)
from protocol.phases import (
    COMMAND_NAMES,
    DONE,
    GO,
    HOLD,
    IDLE,
    NO_FAULT,
    OVER,
    PHASE_NAMES,
    STOP,
    fault_name,
)
from protocol.plan_parts import unpack_plan
from protocol.timing import LATE_STEP_MS, REPORT_TIMEOUT, SECOND

_SILENCE: Final = REPORT_TIMEOUT / SECOND
"""Who has said nothing for so long [s] is not heard; robots on the coordinator's clock, too."""

_CATCHES_UP_S: Final = 3.0
"""For so long [s] after its beginning it hears of orders that were refused before it."""

_MISSED_S: Final = 5.0
"""A robot of a fleet that drives, of which nothing was heard for so long [s], is missed."""

CARRIED_S: Final = 60.0
"""Who takes out a robot that is heard has so long to switch it off and carry it away."""

_APART: Final = 0.2
"""Points of a stretch are at most this far apart [m], along it."""

ENDED: Final = (ORDER_DONE, CANCELLED, REFUSED)


class _Heard(NamedTuple):
    """What a robot reported last, when [s], and the newest Command then."""

    report: Report
    at: float
    command: Command | None


class _Reached(NamedTuple):
    """A stretch of a course between two plan times [ms], as points [m]."""

    plan: Plan
    times_ms: tuple[int, int]
    points: list[tuple[float, float]]


class KnownFleet:
    """A fleet, put together message by message; without a name, the first one that is heard.

    `wall_s`: what our clock lacks to the seconds since 1970.
    """

    def __init__(self, fleet: str | None = None, wall_s: float = 0.0) -> None:
        self.fleet = fleet
        self._wall_s = wall_s
        self.orders: dict[str, OrderState] = {}
        """What was said last of each order; the one that changed last is the last one."""

        self.order_changes = 0
        self.blocks: dict[str, Block] = {}
        self.alarms = Alarms()
        self.heard: Counter[str] = Counter()
        """Messages by kind; `bad` for those that are none."""

        self.faults: Counter[str] = Counter()
        """Faults that robots have reported, by name."""

        self.plans: dict[str, Plan] = {}
        """The newest course of each robot."""

        self._driven: dict[str, dict[int, Plan]] = {}
        """The newest courses of each robot by revision: it drives one of them."""

        self._reached: dict[str, _Reached] = {}
        """By robot: where it may stand if it is not heard."""

        self.joined: dict[str, Join] = {}
        """What was said of robots that have joined."""

        self._since = math.inf
        """When [s] the first message was heard."""

        self._places: dict[str, tuple[float, float, float] | None] = {}
        """By robot: where its program said that it stands, x, y [m] and heading [rad]."""

        self._known_since: dict[str, float] = {}
        """When [s] each robot's newest course was first heard."""

        self._robots: dict[str, _Heard | None] = {}
        self._cut_off: frozenset[str] = frozenset()
        """Robots whose links were lost, and that have not been heard since."""

        self._outside: dict[str, tuple[float, float]] = {}
        """By robot that was taken out: from when [s] on it may not be heard, and when it was."""

        self._command: tuple[Command, float] | None = None
        self._granting: dict[int, Command] = {}
        """By epoch: the newest Command that lets robots drive."""

    def hear(self, key: str, payload: bytes, now: float) -> Message | None:
        """Take in a message of the fleet and return it; None if it is none."""
        place = keys.split(key)
        if place is None or place[0] != (self.fleet or place[0]):
            return None
        _, kind, name = place
        if kind == "alive":
            self._cut_off = self._cut_off - {name} if payload == LINK_UP else self._cut_off | {name}
            return None
        message = decode(kind, payload)
        if message is None:
            self.heard["bad"] += 1
            return None
        self.fleet = place[0]
        self._since = min(self._since, now)
        self.heard[kind] += 1
        self._take(message, kind, name, now)
        return message

    def _take(self, message: Message, kind: str, name: str, now: float) -> None:
        if isinstance(message, Command):
            self._command = (message, now)
            if message.phase == GO:
                self._granting[message.epoch] = message
        elif isinstance(message, Report):
            self._take_report(message, name, now)
        elif isinstance(message, OrderState):
            self._take_order(message, now)
        elif isinstance(message, Block) and kind == "blocks":
            self.blocks[message.id] = message
        elif isinstance(message, Unblock) and kind == "blocks":
            self.blocks.pop(message.id, None)
        elif isinstance(message, Plan):
            self._outside.pop(name, None)
            self._robots.setdefault(name, None)
            self._take_plan(message, now)
        elif isinstance(message, Hello):
            self._places[name] = place_of(message)
        elif isinstance(message, Join):
            self.joined[message.robot] = message

    def is_heard(self, now: float) -> bool:
        """Return whether the coordinator is heard."""
        return self._command is not None and now - self._command[1] < _SILENCE

    @property
    def command(self) -> Command | None:
        """The last Command; None before the first one."""
        return None if self._command is None else self._command[0]

    def answer(self, now: float, held: Mapping[str, tuple[str, float]]) -> FleetAnswer:
        """Return the fleet as it is known now; `held`: who is held, by whom, and since when [s]."""
        robots = self.robots(now, held)
        command = self.command
        if command is None or command.phase != OVER:
            is_heard = self.is_heard(now) or command is None
            outside = [
                name
                for name, (until, at) in self._outside.items()
                if at > until and now - at < _SILENCE
            ]
            arms = command is not None and command.phase == HOLD
            self.alarms.look(is_heard, robots, now + self._wall_s, outside, arms=arms)
        states = Counter(ORDER_STATES[one.state] for one in self.orders.values())
        return FleetAnswer(
            fleet=self.fleet or "",
            phase="" if command is None else COMMAND_NAMES[command.phase].lower(),
            epoch=0 if command is None else command.epoch,
            age=None if self._command is None else round(now - self._command[1], 3),
            is_heard=self.is_heard(now),
            robots=robots,
            orders={name: states[name] for name in ORDER_STATES},
            blocks=sorted(self.blocks),
            alarms=self.alarms.now(),
        )

    def robots(
        self, now: float, held: Mapping[str, tuple[str, float]] | None = None
    ) -> list[RobotState]:
        """Return the state of each robot; `held` as in `answer`."""
        return [self._robot(one, now, held or {}) for one in sorted(self._robots) if self.has(one)]

    def has(self, name: str) -> bool:
        """Return whether a robot is in the fleet: it was sent a course, or has joined.

        Any program may report under any name.  As long as no course is known, all count.
        """
        return name in self.plans or name in self.joined or not self.plans

    def plan_time(self, now: float) -> float:
        """Return the plan time [s] now; it stands unless the fleet drives, and is 0 before GO."""
        if self._command is None or not self._command[0].start_ns:
            return 0.0
        command, heard = self._command
        passed = now - heard if command.phase == GO else 0.0
        return (command.said_ns - command.start_ns) / SECOND + passed

    def changed_orders(self, seen: int) -> list[OrderSummary]:
        """Return the orders that have changed since there were so many changes of orders."""
        last = islice(reversed(self.orders.values()), self.order_changes - seen)
        return [OrderSummary.of(state) for state in last][::-1]

    def summaries(self) -> list[OrderSummary]:
        """Return all orders, in the order in which they became known."""
        found = [OrderSummary.of(state) for state in self.orders.values()]
        return sorted(found, key=lambda one: (one.released or 0.0, one.id))

    def seen(self, name: str, now: float) -> Seen | None:
        """Return a robot as a VDA 5050 state tells of it; None if it was never heard."""
        heard = self._robots.get(name)
        if heard is None or not self.has(name):
            return None
        report = heard.report
        mine = [one for one in self.orders.values() if one.robot == name]
        done = [one for one in mine if one.state == ORDER_DONE]
        going = _under_way(mine)
        order, plan = next(iter(going or done[-1:]), None), self.plans.get(name)
        if len(going) > 1:
            plan = self._driven.get(name, {}).get(report.revision, plan)
        return Seen(
            name,
            report.phase,
            report.fault,
            self._hears(name, heard, now),
            "" if order is None else order.id,
            order is not None and order.state == ORDER_DONE,
            None if plan is None else _end_of(plan),
        )

    def _robot(self, name: str, now: float, held: Mapping[str, tuple[str, float]]) -> RobotState:
        heard = self._robots[name]
        if heard is None:
            known_s = now - self._known_since.get(name, now)
            return RobotState(id=name, stretch=self._stretch(name) if known_s > _MISSED_S else [])
        report, is_heard = heard.report, self._hears(name, heard, now)
        mine = [one for one in self.orders.values() if one.robot == name]
        going = _under_way(mine)
        waiting = [one for one in mine if one.state not in (*ENDED, UNDER_WAY)]
        held_by, held_since = held.get(name, ("", None))
        return RobotState(
            id=name,
            phase=PHASE_NAMES[report.phase] if report.phase < len(PHASE_NAMES) else "",
            fault="" if report.fault == NO_FAULT else fault_name(report.fault),
            late=report.late * LATE_STEP_MS / 1000.0,
            age=round(now - heard.at, 3),
            is_heard=is_heard,
            order=going[0].id if going else "",
            next=[one.id for one in [*going[1:], *waiting]],
            held_by=held_by,
            held_since=held_since,
            stretch=[] if is_heard else self._stretch(name, report),
            is_back=self._is_back(name, heard),
            place=self._places.get(name) if report.epoch == 0 else None,
        )

    def _is_back(self, name: str, heard: _Heard) -> bool:
        """Return whether a robot speaks of no course, although it was sent one of this epoch."""
        report, since = heard.report, self._known_since.get(name, math.inf)
        plan, command = self.plans.get(name), self.command
        drives = command is not None and command.phase in (GO, STOP)
        was_sent = plan is not None and command is not None and plan.epoch == command.epoch
        has_none = report.phase == IDLE and report.epoch == 0 and heard.at - since > _SILENCE
        return drives and was_sent and has_none

    def _hears(self, name: str, heard: _Heard, now: float) -> bool:
        """Return whether a robot is heard still.

        A simulated fleet may be slower than our clock, and messages may come in bursts: while the
        coordinator is heard, it is its clock that says how long a robot has been silent.
        """
        then, command = heard.command, self.command
        if name in self._cut_off:
            return False
        if now - heard.at < _SILENCE:
            return True
        if then is None or command is None or then.boot != command.boot or not self.is_heard(now):
            return False
        return command.said_ns - then.said_ns < REPORT_TIMEOUT

    def _stretch(self, name: str, report: Report | None = None) -> list[tuple[float, float]]:
        """Return where a robot may stand on the course that it drives, as points [m].

        `report`: what it said last, None if it was never heard; then it may be anywhere on its
        newest course.
        """
        plan = self.plans.get(name)
        if report is not None:
            plan = self._driven.get(name, {}).get(report.revision)
        epoch = report.epoch if report is not None else self.command and self.command.epoch
        if plan is None or plan.epoch != epoch:
            return []
        granting = self._granting.get(plan.epoch)
        until_ms = None if granting is None else granting.authority_of(plan.number)
        known = self._reached.get(name)
        if until_ms is not None:
            passed_ms = plan.begin_ms if report is None else _passed_ms(report, until_ms)
            times = (min(passed_ms, until_ms), until_ms)
            if known is None or (known.plan, known.times_ms) != (plan, times):
                known = self._reached[name] = _Reached(plan, times, _points(plan, times))
        return known.points if known is not None and known.plan is plan else []

    def _take_plan(self, plan: Plan, now: float) -> None:
        courses = self._driven.setdefault(plan.robot, {})
        courses[plan.revision] = plan
        for old in [revision for revision in courses if revision < plan.revision - 1]:
            del courses[old]
        mine = self.plans.get(plan.robot)
        if mine is None or (mine.epoch, mine.revision) <= (plan.epoch, plan.revision):
            self.plans[plan.robot] = plan
            if mine != plan:
                self._known_since[plan.robot] = now
            if mine is not None and mine.revision < plan.revision:
                self.alarms.admitted(plan.robot)

    def _take_report(self, report: Report, robot: str, now: float) -> None:
        if robot in self._outside:
            until, _ = self._outside[robot]
            self._outside[robot] = (until, now)
            return
        before = self._robots.get(robot)
        if report.fault != NO_FAULT and (before is None or before.report.fault != report.fault):
            self.faults[fault_name(report.fault)] += 1
        self._robots[robot] = _Heard(report, now, self.command)
        self._cut_off -= {robot}

    def _take_order(self, state: OrderState, now: float) -> None:
        if state.released_ms is None and state.state == REFUSED:
            return  # There is no such order.
        before = self.orders.pop(state.id, None)
        self.orders[state.id] = state
        if before == state:
            return
        self.order_changes += 1
        is_old = before is None and now - self._since < _CATCHES_UP_S
        if not (is_old and state.state == REFUSED):
            self.alarms.take_order(state, now + self._wall_s)
        is_news = before is None or before.state != state.state
        if is_news and state.state == ORDER_DONE and state.id == f"{LEAVE}{state.robot}":
            heard = self._robots.pop(state.robot, None)
            is_heard = heard is not None and self._hears(state.robot, heard, now)
            self._outside[state.robot] = (now + CARRIED_S if is_heard else -math.inf, -math.inf)
            self.plans.pop(state.robot, None)
            self.joined.pop(state.robot, None)
            self.alarms.forget(state.robot)


def _under_way(orders: Iterable[OrderState]) -> list[OrderState]:
    """Return a robot's orders under way, in order: two, once it has its next course."""
    found = [one for one in orders if one.state == UNDER_WAY]
    return sorted(found, key=lambda one: one.planned_arrival_ms or 0)


def _passed_ms(report: Report, until_ms: int) -> int:
    """Return the plan time [ms] that a robot had passed by its report; `until_ms` if it is done."""
    if report.stamp_ms is None:
        return until_ms if report.phase == DONE else 0
    return report.stamp_ms - LATE_STEP_MS * report.late


def _points(plan: Plan, times_ms: tuple[int, int]) -> list[tuple[float, float]]:
    """Return points [m] of a course between two plan times; none if a robot would refuse it."""
    try:
        driven = unpack(encode(plan), 0.0)
    except (ValueError, OverflowError):
        return []
    first, last = (driven.timeline.s_at(0.001 * time) for time in times_ms)
    count = 2 + int((last - first) / _APART)
    places = driven.curve.at_arc(np.linspace(first, last, count)).tolist()
    return [(round(x, 3), round(y, 3)) for x, y in places]


def _end_of(plan: Plan) -> tuple[float, float, float] | None:
    """Return where a course ends: x, y [m] and heading [rad]; None if the Plan is incomplete."""
    try:
        _, _, xs, ys, _ = unpack_plan(plan).path
    except ValueError:
        return None
    dx, dy = xs[-1] - xs[-2], ys[-1] - ys[-2]
    return xs[-1], ys[-1], math.atan2(dy, dx)
