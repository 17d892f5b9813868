"""What truly happened in a run of several epochs: which robots touched what, and which arrived.

Decides: what counts as a touch, and which robots are excused from arriving.  Two robots touch when
their true centres are nearer than r_i + r_j; a robot touches something solid when its centre is
nearer to it than r_i.  Distances are exact for straight motion between two rows of a black box.
Must not know: how faults are chosen.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import combinations
from typing import Final

import msgspec
import numpy as np
from msgspec.structs import replace

from coordinator.mission.replanning_input import Aside
from coordinator.plan.document import PlanDocument
from coordinator.scenario.model import Point
from protocol.phases import DONE
from protocol.timing import SECOND
from sim.floors.free_space import free_space
from sim.judging.blackbox import BlackBox
from sim.judging.clearance import SolidGround
from sim.judging.judge import least_separation
from sim.world.fault_text import Fault
from sim.world.virtual_fleet import World

_OWN: Final = ("hang", "slow", "stall", "skid", "driver-error", "clock-pause", "clock-jump")
"""Faults that a robot causes itself, after which it may be declared unfit."""

_DEADLY: Final = {"kill": "killed", "restart": "restarted"}
"""Faults after which a robot does not go on by itself, and the reasons that are told."""

_NOISE: Final = 0.005
"""How much [m] noisy positions may add to the tolerance at a goal."""

_SPARE: Final = 0.02
"""Room [m] that a way must leave beyond radius and margin; a narrower one does not count."""

SOLID: Final = "something solid"
"""The name of what a robot touches when that is an obstacle or the edge of the floor."""

_RETURN: Final = 5.0
"""A robot whose fault ended less than this [s] before the end had no time to come back."""


class Touch(msgspec.Struct, frozen=True):
    """Two robots whose centres were nearer [m] than their radii allow, and when [s since GO].

    If `b` is SOLID: a robot `a` whose centre was nearer to something solid than its radius.
    """

    a: str
    b: str
    separation: float
    least: float
    t: float

    def text(self) -> str:
        """Return the touch as a sentence."""
        near = f"{self.separation:.4f} m apart, {self.least:.3f} m are needed"
        return f"{self.a} and {self.b} touch at {self.t:.2f} s: {near}"


def touches(
    document: PlanDocument, boxes: Mapping[str, BlackBox], faults: Sequence[Fault] = ()
) -> list[Touch]:
    """Return the pairs that touched, each at its least distance.

    A body that slides may come nearer by the distance of its slide: no plan can prevent that.
    """
    slides = _slides(faults)
    found = []
    spans = {name: _span(box) for name, box in boxes.items()}
    for a, b in combinations(document.robots, 2):
        one, other = boxes[a.id], boxes[b.id]
        least = a.radius + b.radius - slides.get(a.id, 0.0) - slides.get(b.id, 0.0)
        if not _come_near(spans[a.id], spans[b.id], least):
            continue
        separation, t = least_separation(one, other)
        if separation < least:
            found.append(Touch(a.id, b.id, separation, least, t))
    return found


def obstacle_touches(
    document: PlanDocument, boxes: Mapping[str, BlackBox], faults: Sequence[Fault] = ()
) -> list[Touch]:
    """Return the robots that touched something solid, each at its least distance.

    As in `touches`, the distance of a slide is allowed for.
    """
    floor, slides, found = document.workspace, _slides(faults), []
    if floor is None:
        return []
    solid = SolidGround(floor.boundary, floor.obstacles)
    for robot in document.robots:
        if not len(boxes[robot.id].t):
            continue
        least = robot.radius - slides.get(robot.id, 0.0)
        separation, t = solid.nearest(boxes[robot.id])
        if separation < least:
            found.append(Touch(robot.id, SOLID, separation, least, t))
    return found


def _slides(faults: Sequence[Fault]) -> dict[str, float]:
    """Return how far [m] faults make robots slide."""
    slides: dict[str, float] = {}
    for fault in faults:
        if fault.kind == "skid":
            slides[fault.robot] = slides.get(fault.robot, 0.0) + abs(fault.value)
    return slides


_Span = tuple[float, float, float, float]


def _span(box: BlackBox) -> _Span:
    """Return the least and the greatest x and y [m] of a track; inf and -inf without rows."""
    if not len(box.t):
        return math.inf, math.inf, -math.inf, -math.inf
    (x0, y0), (x1, y1) = box.places.min(axis=0).tolist(), box.places.max(axis=0).tolist()
    return x0, y0, x1, y1


def _come_near(a: _Span, b: _Span, least: float) -> bool:
    """Return whether the bounding boxes of two robots' tracks are nearer than `least` [m]."""
    return max(a[0], b[0]) - min(a[2], b[2]) < least and max(a[1], b[1]) - min(a[3], b[3]) < least


def arrived(world: World, document: PlanDocument, boxes: Mapping[str, BlackBox]) -> set[str]:
    """Return the robots that are truly at their goals.

    Only robots count that report this themselves or that the fleet counts as arrived.
    """
    held = {one.robot.id for one in world.mission.site.aside if one.why == "arrived"}
    held |= {name for name, member in world.fleet.members.items() if member.finished}
    held |= {name for name, one in world.robots.items() if one.service.agent.phase == DONE}
    there = set()
    for robot in document.robots:
        goal = robot.path.control_points[-1]
        place = boxes[robot.id].places[-1] if len(boxes[robot.id].t) else (math.nan, math.nan)
        if robot.id in held and math.dist(place, goal) <= 0.5 * document.margin + _NOISE:
            there.add(robot.id)
    return there


def excused(world: World, document: PlanDocument, over_ns: int) -> dict[str, str]:
    """Return the robots that cannot be expected to reach their goals of the plan, and why."""
    failed = {one.fault.robot for one in world.struck if one.fault.kind in _OWN}
    why = dict[str, str]()
    for name, member in world.fleet.members.items():
        if not member.is_fit and name in failed:
            why[name] = "unfit"
    for one in world.struck:
        fault = one.fault
        if fault.kind in _DEADLY:
            why[fault.robot] = _DEADLY[fault.kind]
        elif fault.kind in ("hang", "stall", "cut", "clock-pause"):
            ends = one.now_ns + (fault.value + _RETURN) * SECOND
            if ends > over_ns:
                why[fault.robot] = fault.kind
    why |= dict.fromkeys(_too_near(world, document).difference(why), "too near")
    while closed := _closed_in(world, document, why):
        why |= dict.fromkeys(closed, "closed in")
    return {name: reason for name, reason in why.items() if name in world.robots}


def _too_near(world: World, document: PlanDocument) -> set[str]:
    """Return the robots that stand nearer to another one than any course may begin, by a slide."""
    slid = {one.fault.robot for one in world.struck if one.fault.kind == "skid"}
    found = set[str]()
    for a, b in combinations(document.robots, 2):
        if (a.id in slid or b.id in slid) and a.id in world.robots and b.id in world.robots:
            apart = math.dist(_place(world, a.id), _place(world, b.id))
            if apart < a.radius + b.radius + document.margin:
                found |= {a.id, b.id}
    return {name for name in found if not world.fleet.members[name].finished}


def _closed_in(world: World, document: PlanDocument, stay: Collection[str]) -> list[str]:
    """Return the robots that are not at their goals and truly have no way there.

    Those that `stay` where they are count as solid, and those that are at their goals.  Others that
    stand in the way do not: they could drive.  Via points are disregarded.
    """
    site, members, around = world.mission.site, world.fleet.members, dict(_solid(world, stay))
    robots = [
        one
        for one in (*site.scenario.robots, *(one.robot for one in site.aside))
        if one.id not in stay
    ]
    goals = {one.id: one.path.control_points[-1] for one in document.robots}
    closed = []
    for one in robots:
        if one.id not in world.robots or one.id not in goals:
            continue
        place = _place(world, one.id)
        if members[one.id].finished and math.dist(place, goals[one.id]) <= site.scenario.margin:
            continue
        solid = tuple(ring for name, ring in around.items() if name != one.id)
        floor = replace(
            site.scenario.workspace, obstacles=site.scenario.workspace.obstacles + solid
        )
        reach = one.radius + site.scenario.margin + _SPARE
        here, there = free_space(floor, reach).at(np.array([place, goals[one.id]]))
        if here != there or here < 0:
            closed.append(one.id)
    return closed


def _solid(world: World, stay: Collection[str]) -> Iterator[tuple[str, tuple[Point, ...]]]:
    """Yield what is solid for others: where robots that go no farther may stand, or stand."""
    around, site = world.mission.dispatcher.obstructions.around, world.mission.site
    for robot in (*site.scenario.robots, *(one.robot for one in site.aside)):
        member = world.fleet.members.get(robot.id)
        rests = robot.id in stay or (member is not None and member.finished)
        if robot.id in world.robots and rests:
            here = np.array([_place(world, robot.id)])
            yield robot.id, around.get(robot.id) or Aside(robot, "arrived", here, None).disc()


def _place(world: World, robot: str) -> Point:
    """Return where a robot truly is [m]."""
    body = world.robots[robot].body
    return body.x, body.y
