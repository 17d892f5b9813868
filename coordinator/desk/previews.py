"""What an order would come to, found by the desk itself from the courses that it has heard.

The fleet is not asked: a preview costs the coordinator nothing, and reserves nothing.  A process of
its own finds it, so that the page goes on meanwhile.

Decides: what of the known fleet a preview is made from.  Must not know: HTTP, the link.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import os
import signal
from collections.abc import Mapping
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from coordinator.desk.answers import PreviewAnswer, PreviewRest, RobotState
from coordinator.desk.bodies import OrderBody
from coordinator.desk.known_fleet import KnownFleet
from coordinator.fleet.task import robot_of
from coordinator.plan.course import Course
from coordinator.plan.document import PlanDocument, RobotPlan
from coordinator.plan.plan_file import from_json, to_json
from coordinator.plan.wire import unpack
from coordinator.scenario.model import TURN_RATE, Point, Robot, Scenario, Workspace
from coordinator.scenario.obstacle_names import closed_place
from protocol.codec import encode
from protocol.messages import Plan

if TYPE_CHECKING:
    from coordinator.planning.preview import Preview
    from coordinator.planning.wish import Site

_MOST_POINTS: Final = 200
"""A way is told with about so many points."""

_NICE: Final = 5
"""The fleet's own programs go first."""


class Asked(NamedTuple):
    """What a preview is made from: robots, their newest courses, and how late they are.

    lost: by robot that is not heard, the points [m] of its course where it may stand.  kept: why
    robots get no course now.
    """

    robots: dict[str, Robot]
    plans: dict[str, Plan]
    now: float
    late: dict[str, float]
    idle: frozenset[str]
    lost: dict[str, list[Point]]
    kept: dict[str, str]
    closed: dict[str, tuple[Point, ...]]
    order: OrderBody


class Previews:
    """Makes previews one at a time; `document`: a plan with the floor, if one is known."""

    def __init__(self, document: PlanDocument | None) -> None:
        is_known = document is not None and document.workspace is not None
        self._document = document if is_known else None
        self._maker: Connection | None = None
        self._one_at_a_time = asyncio.Lock()

    @property
    def are_possible(self) -> bool:
        """Whether the floor is known."""
        return self._document is not None

    def start(self) -> None:
        """Start the process that makes previews; it ends with this one."""
        if self._document is not None:
            context = get_context("spawn")
            self._maker, theirs = context.Pipe()
            context.Process(target=_run, args=(theirs, to_json(self._document))).start()
            theirs.close()

    def stop(self) -> None:
        """End the process."""
        if self._maker is not None:
            self._maker.close()

    async def make(self, known: KnownFleet, body: OrderBody, now: float) -> PreviewAnswer | None:
        """Return what an order would come to at our time [s]; None if none can be made now.

        Raises KeyError if the robot is not known, or has no course.
        """
        assert self._document is not None
        asked = asked_of(self._document, known, body, now)
        async with self._one_at_a_time:
            return await asyncio.to_thread(self._exchange, asked)

    def _exchange(self, asked: Asked) -> PreviewAnswer | None:
        if self._maker is None:
            self.start()
        assert self._maker is not None
        try:
            self._maker.send(asked)
            answer: PreviewAnswer = self._maker.recv()
        except (OSError, EOFError):
            self._maker = None
            return None
        return answer


def asked_of(document: PlanDocument, known: KnownFleet, body: OrderBody, now: float) -> Asked:
    """Return what a preview of an order at our time [s] is made from.

    Raises KeyError if the robot is not known, or has no course.
    """
    robots = {one.id: _robot(one) for one in document.robots}
    robots |= {name: robot_of(join) for name, join in known.joined.items()}
    plans = {name: plan for name, plan in known.plans.items() if name in robots}
    if body.robot and body.robot not in plans:
        raise KeyError(body.robot)
    states = known.robots(now)
    return Asked(
        robots,
        plans,
        known.plan_time(now),
        {one.id: one.late for one in states if one.late > 0.0},
        frozenset(one.id for one in states if one.is_free),
        {one.id: one.stretch for one in states if one.stretch and one.id in robots},
        {one.id: why for one in states if (why := _what_keeps(one))},
        {closed_place(name): block.polygon for name, block in known.blocks.items()},
        body,
    )


def _what_keeps(robot: RobotState) -> str:
    """Return in words what a robot waits for before it gets a course; "" if nothing."""
    if robot.is_back:
        return "waits to be admitted"
    return "is lost until it is heard" if robot.stretch and not robot.is_heard else ""


_courses: dict[str, Course] = {}
"""In the process that makes previews: the newest course of each robot."""


def _run(asks: Connection, document: bytes) -> None:
    """Answer until the other side has ended."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(_NICE)
    with contextlib.suppress(OSError, EOFError):
        site = prepared(from_json(document))
        while True:
            asks.send(outlook(site, asks.recv()))


def prepared(document: PlanDocument) -> Site:
    """Return the floor, prepared for previews."""
    from coordinator.planning.wish import Site

    floor = document.workspace
    assert floor is not None
    solid = tuple(tuple(corners) for corners in floor.obstacles)
    workspace = Workspace(boundary=tuple(floor.boundary), obstacles=solid)
    robots = tuple(_robot(one) for one in document.robots)
    scenario = Scenario(
        name=document.scenario, workspace=workspace, robots=robots, margin=document.margin
    )
    return Site(scenario, document)


def outlook(site: Site, asked: Asked) -> PreviewAnswer:
    """Return what an order would come to; where lost robots may stand is solid."""
    from coordinator.mission.replanning_input import Aside
    from coordinator.planning.preview import Fleet, Preview, preview

    order, solid = asked.order, dict(asked.closed)
    if order.robot in asked.kept:
        why = f"{order.robot} {asked.kept[order.robot]}; its orders wait until then"
        return _answer(Preview(order.robot, np.empty((0, 2)), reason=why), asked.now, order.dwell)
    for name, points in asked.lost.items():
        stands = Aside(asked.robots[name], "lost", np.array(points), None)
        solid[f"the place where {name} may stand"] = stands.disc()
    if solid:
        site = site.with_obstacles(solid)
    courses = _known(asked.plans, asked.robots)
    others = {name: one for name, one in courses.items() if name not in asked.lost}
    fleet = Fleet(asked.robots, others, asked.now, asked.late, asked.idle)
    x, y, *heading = order.goal
    goal = (x, y, heading[0]) if heading else (x, y)
    found = preview(site, fleet, order.robot, goal, order.via, at_once=order.now)
    return _answer(found, asked.now, order.dwell)


def _known(plans: Mapping[str, Plan], robots: Mapping[str, Robot]) -> dict[str, Course]:
    for name, plan in plans.items():
        mine = _courses.get(name)
        if mine is None or mine.driven.plan != plan:
            driven = unpack(encode(plan), robots[name].radius)
            _courses[name] = Course(driven, 0.001 * plan.begin_ms)
    return {name: _courses[name] for name in plans}


def _robot(one: RobotPlan) -> Robot:
    """Return a robot as a plan knows it."""
    limits, (start, *_, goal) = one.limits, one.path.control_points
    speed = limits.max_speed if limits else max(v for _, v in one.profile)
    accel = speed if limits is None else limits.max_accel or math.inf
    lateral = accel if limits is None else limits.max_lateral_accel or math.inf
    turning = TURN_RATE if limits is None else limits.max_turn_rate or math.inf
    return Robot(
        id=one.id,
        start=start,
        goal=goal,
        radius=one.radius,
        max_speed=speed,
        max_accel=accel,
        max_lateral_accel=lateral,
        min_turn_radius=0.0 if limits is None else limits.min_turn_radius,
        max_turn_rate=turning,
    )


def _answer(found: Preview, now: float, dwell: float) -> PreviewAnswer:
    step = max(math.ceil(len(found.way) / _MOST_POINTS), 1)
    points = [(round(x, 3), round(y, 3)) for x, y in found.way.tolist()]
    is_found = not found.reason
    return PreviewAnswer(
        robot=found.robot,
        way=[*points[:-1:step], *points[-1:]],
        begins=round(found.begin - now, 1) if is_found else None,
        arrives=round(found.finish - now, 1) if is_found else None,
        done=round(found.finish - now + dwell, 1) if is_found else None,
        alone=round(found.alone, 1) if is_found else None,
        waits=[
            PreviewRest(one.robot, (round(x, 3), round(y, 3)), round(one.seconds, 1))
            for one in found.waits
            for x, y in [one.place]
        ],
        reason=found.reason,
    )
