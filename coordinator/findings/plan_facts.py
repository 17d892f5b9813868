"""Fills a summary with the facts of plans: the robots' times, stops and waits, and the proof.

Decides: which of several plans gives a robot's times and stops, namely the last one that got a GO,
or the last further course that it drove.  Must not know: files, what happened during the drive.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, NamedTuple

import msgspec

from coordinator.base.errors import InputError
from coordinator.findings.giving_way import GivingWay, giving_way
from coordinator.findings.info_fields import NearestSummary, RobotSummary, StopSummary, Summary
from coordinator.findings.nearness import nearest_of_all
from coordinator.findings.ride_samples import ride_of_plan, times_between
from coordinator.findings.traffic_numbers import is_own
from coordinator.findings.wait_summary import waits_of
from coordinator.plan import plan_file
from coordinator.plan.document import PlanDocument
from protocol import codec, keys
from protocol.messages import Command, Plan
from protocol.phases import GO
from protocol.plan_parts import unpack_plan
from protocol.timeline import Timeline

if TYPE_CHECKING:
    from coordinator.log.records import Log


class SentPlan(NamedTuple):
    """A Plan that a robot was sent, its size in bytes, and whether the log itself holds it.

    start_ns: the time zero that its epoch's plan had then, on the coordinator's clock; None before
    the epoch's GO.
    """

    robot: str
    plan: Plan
    size: int
    start_ns: int | None
    is_here: bool

    @property
    def course(self) -> tuple[int, int]:
        """The course's epoch and revision."""
        return self.plan.epoch, self.plan.revision


def plans_sent(
    log: Log, before: Iterable[Log], fleet: str
) -> tuple[list[SentPlan], dict[int, int]]:
    """Return the Plans in a log and in those that it resumes, and each epoch's first time zero."""
    found: list[SentPlan] = []
    first: dict[int, int] = {}
    now: dict[int, int] = {}
    for one in (*before, log):
        for record in one.records:
            place = keys.split(record.key)
            if place is None or place[0] != fleet or place[1] not in ("command", "plan"):
                continue
            message = codec.decode(place[1], record.payload)
            if isinstance(message, Command) and message.phase == GO and is_own(one, message):
                now[message.epoch] = message.start_ns
                first.setdefault(message.epoch, message.start_ns)
            elif isinstance(message, Plan):
                start_ns = now.get(message.epoch)
                size = len(record.payload)
                found.append(SentPlan(place[2], message, size, start_ns, one is log))
    return found, first


def summarise_plan(document: PlanDocument) -> dict[str, object]:
    """Return the summary of a plan that has not been driven; it has the fields of `Summary`."""
    summary = Summary(
        fleet=document.scenario,
        policy=document.policy,
        tau=document.tau,
        duration=0.0,
        complete=True,
        damage="",
        messages=0,
        source="plan",
    )
    take_plans(summary, [document], {})
    for robot in document.robots:
        told = summary.robots[robot.id]
        told.plan_bytes = robot.wire_bytes
        told.control_points = len(robot.path.control_points)
    summary.largest_plan_bytes = max((robot.wire_bytes for robot in document.robots), default=0)
    _tell_nearest(summary, document)
    told_all: dict[str, object] = msgspec.to_builtins(summary)
    return told_all


def read_plans(attachments: Mapping[str, bytes]) -> list[PlanDocument]:
    """Return the plans among a log's attachments, sorted by epoch; skip damaged ones.

    For an epoch that got new times, it is the plan with the newest times.
    """
    documents: dict[int, PlanDocument] = {}
    for name, data in attachments.items():
        if plan_file.is_plan_name(name):
            try:
                document = plan_file.from_json(data, name)
            except InputError:
                continue
            documents[document.epoch] = document
    return [documents[epoch] for epoch in sorted(documents)]


def take_plans(
    summary: Summary, documents: list[PlanDocument], starts: Mapping[int, float]
) -> None:
    """Fill in each robot's times and stops, all plans' waits, and the last plan's proof.

    starts: the time zero [s] of each epoch that got a GO.  If it is empty, times are plan times.
    """
    for document in documents:
        summary.waits += waits_of(document)
        summary.giving_way += _giving_way(document)
        summary.proof = document.proof
        if starts and document.epoch not in starts:
            continue
        zero = starts.get(document.epoch, 0.0)
        for robot in document.robots:
            told = summary.robot(robot.id)
            told.planned_start = zero + robot.start_time
            told.planned_finish = zero + robot.finish_time
            told.stops = [
                StopSummary(stop.s, zero + stop.depart, stop.yields_to) for stop in robot.stops
            ]


def take_message(plan: Plan, told: RobotSummary, zero: float) -> None:
    """Fill in a robot's times and stops from its Plan message, if the log holds no plan file."""
    motion = unpack_plan(plan).motion
    try:
        told.planned_finish = zero + Timeline(*motion).finish
    except ValueError:
        return
    _, _, stop_s, departs, _ = motion
    rests = list(zip(stop_s, departs, strict=True))
    begin = 0.001 * plan.begin_ms
    told.planned_start = zero + next((depart for s, depart in rests if s <= 0.0), begin)
    told.stops = [StopSummary(s, zero + depart, "") for s, depart in rests if s > 0.0]


def _giving_way(document: PlanDocument) -> list[GivingWay]:
    """Return how the robots of a plan give way; nothing of one that robots would refuse."""
    try:
        return giving_way(document)
    except InputError:
        return []


def _tell_nearest(summary: Summary, document: PlanDocument) -> None:
    """Fill in for each robot which other robot comes nearest according to the plan."""
    try:
        rides = [ride_of_plan(robot) for robot in document.robots]
    except ValueError:
        return
    times = times_between(0.0, max((ride.line.finish for ride in rides), default=0.0))
    tracks = [ride.places_at(ride.arcs_at(times)) for ride in rides]
    for robot, near in zip(document.robots, nearest_of_all(times, tracks), strict=False):
        summary.robots[robot.id].nearest = NearestSummary(
            document.robots[near.other].id, round(near.distance, 4), round(near.t, 3), "plans"
        )
