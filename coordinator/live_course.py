"""What a bystander knows of a running fleet: plans as sent, Commands, Reports, the fleet's time.

Decides: how a plan reads that nobody has in a file, and when something new is known.  Must not
know: links, threads, the page.  Why robots wait is not on the wire: it is found from the plans of
an epoch that has begun (live_reasons.py), or known from the plan file.
"""

from __future__ import annotations

from typing import Final

import msgspec

from coordinator.live_reasons import with_reasons
from coordinator.plan import PlanDocument, RobotPlan, Stop
from coordinator.scene import Scene
from coordinator.scene_log import Course, scene_of_course
from coordinator.summary import FaultSummary
from coordinator.wire import path_of, unpack
from protocol import keys
from protocol.codec import decode, encode, seal
from protocol.messages import Clock, Command, Hello, Message, NewTimes, Plan, Report
from protocol.phases import FAULT_NAMES, NO_FAULT
from protocol.plan_parts import unpack_plan
from protocol.timing import SECOND

_RADIUS: Final = 0.15
"""Radius [m] of a robot that did not say its own."""

_SURE: Final = 2.0
"""The fleet's clock is compared with ours over this many seconds before its speed is told."""


class FleetTime(msgspec.Struct, frozen=True):
    """Seconds since the first GO, and how many pass in one of ours."""

    now: float
    speed: float


class LiveCourse:
    """The course of a fleet, heard message by message; `now` is our clock in seconds."""

    def __init__(self, fleet: str | None, document: PlanDocument | None) -> None:
        self.fleet = fleet
        self._course = Course()
        self._radius: dict[str, float] = {}
        self._phase: tuple[int, int] | None = None
        self._plans: dict[tuple[int, str], Plan] = {}
        self._faults: dict[str, int] = {}
        self._first: tuple[int, float] | None = None
        self._latest: tuple[int, float] = (0, 0.0)
        self._floor = document
        self._explained: dict[int, int] = {}
        if document is not None:
            self._course.plans[document.epoch] = document
            self._radius = {robot.id: robot.radius for robot in document.robots}

    def hear(self, key: str, payload: bytes, now: float) -> bool:
        """Take in what was said on a key; tell whether a page would look different."""
        place = keys.split(key)
        if place is None or place[0] != (self.fleet or place[0]) or place[1] in ("alive", "admit"):
            return False
        self.fleet = place[0]
        message = decode(place[1], payload)
        if isinstance(message, Clock) and message.answered_ns is not None:
            self._set_clock(message.answered_ns, now)
        return message is not None and self._take(message, place[2], now)

    def scene(self) -> Scene:
        """Return the scene of what is known; an empty one before the first plan."""
        if not self._course.plans:
            return _nothing(self.fleet or "")
        self._explain()
        return msgspec.structs.replace(scene_of_course(self._course), name=self.fleet or "")

    def _explain(self) -> None:
        """Find out why robots wait in epochs that have begun, once for the plans heard so far."""
        plans = self._course.plans
        for epoch in set(self._course.starts) & set(plans):
            count = len(plans[epoch].robots)
            if plans[epoch] is not self._floor and self._explained.get(epoch) != count:
                plans[epoch] = with_reasons(plans[epoch])
                self._explained[epoch] = count

    def clock(self, now: float) -> FleetTime | None:
        """Return the fleet's time; None before its first GO or before its clock was heard."""
        if self._first is None or not self._course.starts:
            return None
        zero = min(self._course.starts.values())
        speed = self._speed()
        passed = (self._latest[0] - zero) / SECOND + speed * (now - self._latest[1])
        return FleetTime(round(passed, 3), round(speed, 3))

    def _take(self, message: Message, robot: str, now: float) -> bool:
        """Take in a message of the fleet."""
        course = self._course
        if isinstance(message, Command):
            course.take_command(message, self._now_ns(now))
            changed = self._phase != (message.epoch, message.phase)
            self._phase = (message.epoch, message.phase)
            return changed
        if isinstance(message, Report):
            return self._take_report(message, robot, now)
        if isinstance(message, Plan):
            return self._take_plan(message)
        if isinstance(message, NewTimes):
            return self._take_times(message, robot)
        if isinstance(message, Hello) and message.radius_m > 0.0:
            self._radius[robot] = message.radius_m
        return False

    def _take_report(self, report: Report, robot: str, now: float) -> bool:
        course, now_ns = self._course, self._now_ns(now)
        known = len(course.rests)
        course.take_report(report, robot, now_ns)
        changed = report.fault != self._faults.get(robot, NO_FAULT)
        self._faults[robot] = report.fault
        if changed and report.fault != NO_FAULT:
            name = FAULT_NAMES[report.fault] if report.fault < len(FAULT_NAMES) else "a fault"
            course.faults.append((now_ns, FaultSummary(0.0, robot, name, "report")))
        return changed or len(course.rests) > known

    def _take_plan(self, plan: Plan, anew: bool = False) -> bool:
        """Add a robot's plan to its epoch's document; a plan that is no plan is passed over."""
        documents = self._course.plans
        document = documents.get(plan.epoch, _document(plan, self.fleet or "", self._floor))
        self._plans.setdefault((plan.epoch, plan.robot), plan)
        if not anew and any(robot.id == plan.robot for robot in document.robots):
            return False
        try:
            robot = _robot_plan(plan, self._radius.get(plan.robot, _RADIUS))
        except (ValueError, msgspec.MsgspecError, IndexError):
            return False
        others = [one for one in document.robots if one.id != plan.robot]
        robots = sorted([*others, robot], key=lambda one: one.id)
        documents[plan.epoch] = msgspec.structs.replace(document, robots=robots)
        return True

    def _take_times(self, times: NewTimes, robot: str) -> bool:
        """Give a plan that is known other times."""
        plan = self._plans.get((times.epoch, robot))
        if plan is None or plan.boot != times.boot:
            return False
        parts = {name: getattr(times, name) for name in ("speeds", "profile", "stops")}
        return self._take_plan(seal(msgspec.structs.replace(plan, **parts)), anew=True)

    def _set_clock(self, answered_ns: int, now: float) -> None:
        self._first = self._first or (answered_ns, now)
        if answered_ns >= self._latest[0]:
            self._latest = (answered_ns, now)

    def _speed(self) -> float:
        """Return how many of the fleet's seconds pass in one of ours."""
        if self._first is None or self._latest[1] - self._first[1] < _SURE:
            return 1.0
        passed = (self._latest[0] - self._first[0]) / SECOND
        return passed / (self._latest[1] - self._first[1])

    def _now_ns(self, now: float) -> int:
        """Return the fleet's time [ns]; before its clock was heard that of the last Command."""
        if self._first is None:
            return self._course.last
        return self._latest[0] + round(self._speed() * (now - self._latest[1]) * SECOND)


def _document(plan: Plan, fleet: str, floor: PlanDocument | None) -> PlanDocument:
    """Return an epoch's document without robots."""
    return PlanDocument(
        scenario=fleet,
        epoch=plan.epoch,
        policy="safe",
        tau=plan.tau_ns / SECOND,
        margin=plan.track_mm / 500.0,
        robots=[],
        workspace=None if floor is None else floor.workspace,
    )


def _robot_plan(plan: Plan, radius: float) -> RobotPlan:
    """Return a robot's part of a plan as a file would have it; ValueError when it is none."""
    driven = unpack(encode(plan), radius)
    profile_s, profile_v, stop_s, departs = unpack_plan(plan).motion
    rows = list(zip(stop_s, driven.timeline.arrivals, departs, strict=True))
    late = rows[0][2] if rows and rows[0][0] <= 0.0 else 0.0
    return RobotPlan(
        id=plan.robot,
        radius=radius,
        start_time=max(late, 0.0),
        finish_time=driven.timeline.finish,
        length=driven.timeline.length,
        path=path_of(driven.curve),
        profile=list(zip(profile_s, profile_v, strict=True)),
        stops=[
            Stop(s=s, arrive=arrive, depart=max(depart, arrive))
            for s, arrive, depart in rows
            if s > 0.0
        ],
        wire_bytes=0,
    )


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
