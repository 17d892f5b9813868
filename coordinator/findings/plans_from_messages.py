"""Puts plans together from messages, for plans that no file holds.

Decides: the document of a plan that is known from Plan messages alone.  Must not know: links,
pictures.  Floor, proof and crossings are not on the wire.  The reasons of waits are not either, but
wait_guesses.py finds them from the plans.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from typing import Final

import msgspec

from coordinator.findings.attendance import Attendance
from coordinator.findings.wait_guesses import with_reasons
from coordinator.log.records import Log
from coordinator.plan.document import Limits, PlanDocument, RobotPlan, Stop
from coordinator.plan.wire import path_of, unpack
from coordinator.scenario.margin import margin_for
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import Hello, Message, OrderState, Plan, Report
from protocol.plan_parts import unpack_plan
from protocol.timing import SECOND

RADIUS: Final = 0.15
"""Radius [m] of a robot that did not state its own."""

FROM_MESSAGES: Final = (
    "epoch {epoch}: the plan is put together from messages, without floor, crossings and proof"
)


def is_further(plan: Plan) -> bool:
    """Return whether a course was sent while the fleet drove: not with its epoch's plan."""
    return plan.revision > 0 or plan.begin_ms > 0


class SaidPlans:
    """The plans that messages contain, put into `documents` by epoch.

    `known`: a plan that gives the floor and the radii.
    """

    def __init__(self, documents: dict[int, PlanDocument], known: PlanDocument | None) -> None:
        self._documents = documents
        self._known = known
        self._numbers: dict[tuple[int, str], int] = {}
        self.radius = {} if known is None else {robot.id: robot.radius for robot in known.robots}

    def take(self, message: Message, robot: str, fleet: str) -> bool:
        """Add a message of a fleet about a robot; return whether a document has changed."""
        if isinstance(message, Plan):
            return self._take_plan(message, fleet)
        if isinstance(message, Hello) and message.radius_m > 0.0:
            self.radius[robot] = message.radius_m
        return False

    def _take_plan(self, plan: Plan, fleet: str) -> bool:
        """Add a robot's first course to its epoch's document; skip an invalid one."""
        empty = _document(plan, fleet, self._known)
        document = self._documents.setdefault(plan.epoch, empty)
        if is_further(plan) or any(robot.id == plan.robot for robot in document.robots):
            return False
        try:
            robot = _robot_plan(plan, self.radius.get(plan.robot, RADIUS))
        except (ValueError, msgspec.MsgspecError, IndexError):
            return False
        self._numbers[plan.epoch, plan.robot] = plan.number
        robots = sorted(
            [*document.robots, robot], key=lambda one: (self._numbers[plan.epoch, one.id], one.id)
        )
        self._documents[plan.epoch] = msgspec.structs.replace(document, robots=robots)
        return True


def plans_said(
    log: Log, attached: Collection[int] = (), known: PlanDocument | None = None
) -> dict[int, PlanDocument]:
    """Return by epoch the plans that a log's messages contain, except for those `attached`.

    A plan's `notes` name the robots that drove by a plan that was sent before the log began.
    """
    fleet = log.metadata.get("fleet", "")
    found: dict[int, PlanDocument] = {}
    said = SaidPlans(found, known)
    drivers: dict[int, set[str]] = {}
    for record in log.records:
        place = keys.split(record.key)
        if place is None or place[0] != fleet or place[1] not in ("hello", "plan", "report"):
            continue
        message = decode(place[1], record.payload)
        if isinstance(message, Report):
            drivers.setdefault(message.epoch, set()).add(place[2])
        elif message is not None and getattr(message, "epoch", None) not in attached:
            said.take(message, place[2], fleet)
    return {
        epoch: _with_notes(with_reasons(document), drivers.get(epoch, set()))
        for epoch, document in sorted(found.items())
    }


def in_force(document: PlanDocument, first: PlanDocument, logs: Iterable[Log]) -> PlanDocument:
    """Return the plan of a log's last epoch with the courses that robots were sent since.

    `first`: the first epoch's plan; `logs`: the log and those that it resumes, oldest first.
    Robots that joined are in it, robots that left are not.  What the plan says of two robots of
    which one has got another course is left out, its proof too.
    """
    present = Attendance(robot.id for robot in first.robots)
    newest: dict[str, Plan] = {}
    for record in (record for log in logs for record in log.records):
        place = keys.split(record.key)
        message = None if place is None else decode(place[1], record.payload)
        present.take(message, record.log_ns)
        if isinstance(message, OrderState):
            newest = {name: plan for name, plan in newest.items() if present.is_in(name)}
        elif isinstance(message, Plan) and message.epoch == document.epoch:
            newest |= {message.robot: message} if message.revision or message.begin_ms else {}
    radii = {robot.id: robot.radius for robot in document.robots}
    for name, stays in present.stays.items():
        if stays[-1].join is not None:
            radii[name] = stays[-1].join.radius_m
    same = [one for one in document.robots if one.id not in newest and present.is_in(one.id)]
    sent = [
        _robot_plan(plan, radii.get(name, RADIUS))
        for name, plan in sorted(newest.items())
        if present.is_in(name)
    ]
    if same == document.robots and not sent:
        return document
    names = {robot.id for robot in same}
    sent_to = ", ".join(one.id for one in sent) or "nobody"
    note = f"epoch {document.epoch}: with the newest courses, which {sent_to} got under way"
    return msgspec.structs.replace(
        document,
        robots=[*same, *sent],
        crossings=[one for one in document.crossings if {one.a, one.b} <= names],
        waits=[one for one in document.waits if {one.robot, one.yields_to} <= names],
        proof=None,
        notes=[*document.notes, f"{note}; `splinefleet verify` proves each"],
    )


def _with_notes(document: PlanDocument, drivers: Collection[str]) -> PlanDocument:
    """Return the plan with notes on what it lacks."""
    notes = [FROM_MESSAGES.format(epoch=document.epoch)]
    missing = sorted(set(drivers) - {robot.id for robot in document.robots})
    if missing:
        notes.append(
            f"epoch {document.epoch}: {', '.join(missing)} cannot be drawn: plan not heard"
        )
    return msgspec.structs.replace(document, notes=notes)


def _document(plan: Plan, fleet: str, known: PlanDocument | None) -> PlanDocument:
    """Return an epoch's document without robots."""
    return PlanDocument(
        scenario=fleet,
        epoch=plan.epoch,
        policy="safe",
        tau=plan.tau_ns / SECOND,
        margin=margin_for(plan.track_mm),
        robots=[],
        workspace=None if known is None else known.workspace,
    )


def _robot_plan(plan: Plan, radius: float) -> RobotPlan:
    """Return a robot's part as in a plan file; raise ValueError if the message is invalid."""
    driven = unpack(encode(plan), radius)
    profile_s, profile_v, stop_s, departs, _ = unpack_plan(plan).motion
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
        limits=_limits(plan, max(profile_v)),
    )


def _limits(plan: Plan, speed: float) -> Limits | None:
    """Return the robot's limits as far as its Plan states them: how it brakes, if not at once."""
    if not plan.brake_mmps2:
        return None
    accel = math.nextafter(
        plan.brake_mmps2 / 1000.0, math.inf
    )  # so that packing gives the same value
    return Limits(max_speed=speed, max_accel=accel)
