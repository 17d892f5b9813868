"""Paths and motions made into the plan document, with the numbers that robots will get.

Decides: how a motion is rounded to the wire, and what is said about each crossing.  Must not know:
how paths and motions were found.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

import msgspec
import numpy as np

from coordinator.crossings import Meeting, find_crossings
from coordinator.errors import PlanError
from coordinator.motion import Motion
from coordinator.nurbs import Nurbs
from coordinator.plan import Crossing, Floor, Limits, PlanDocument, RobotPlan, Stop
from coordinator.scenario import Robot, Scenario
from coordinator.wire import float32, float32_below, pack, path_of
from protocol.packing import OversizeError
from protocol.timeline import Timeline


def make_document(
    scenario: Scenario,
    paths: Sequence[Nurbs],
    motions: Sequence[Motion],
    tau: float,
    epoch: int,
    notes: Sequence[str],
) -> PlanDocument:
    """Return the document without its proof; tau in seconds.

    Raises PlanError when a robot's path is too long for a message.
    """
    bare = PlanDocument(
        scenario=scenario.name,
        epoch=epoch,
        policy=scenario.policy,
        tau=tau,
        margin=scenario.margin,
        robots=[],
        workspace=Floor(
            boundary=list(scenario.workspace.boundary),
            obstacles=[list(corners) for corners in scenario.workspace.obstacles],
        ),
        notes=list(notes),
    )
    names = [robot.id for robot in scenario.robots]
    robots = []
    for robot, path, motion in zip(scenario.robots, paths, motions, strict=True):
        planned = _robot_plan(robot, path, motion, names)
        try:
            size = len(pack(bare, planned, boot=2**32 - 1))
        except OversizeError as error:
            raise PlanError(f"{robot.id}: {error}; fewer via points would help") from None
        robots.append(msgspec.structs.replace(planned, wire_bytes=size))
    crossings = [
        _crossing(robots[i], robots[j], motions[i], motions[j], meeting)
        for i, j in combinations(range(len(robots)), 2)
        for meeting in find_crossings(paths[i], paths[j])
    ]
    return msgspec.structs.replace(bare, robots=robots, crossings=crossings)


def _robot_plan(robot: Robot, path: Nurbs, motion: Motion, names: Sequence[str]) -> RobotPlan:
    waits = [wait for wait in motion.waits if wait.s > 0.0]
    starts = [wait for wait in motion.waits if wait.s <= 0.0]
    profile = _rounded_profile(motion)
    stop_s = float32([wait.s for wait in waits])
    start_time = motion.start_time
    departs = [wait.depart for wait in waits]
    timeline = Timeline(
        [s for s, _ in profile],
        [v for _, v in profile],
        [0.0, *stop_s],
        [start_time, *departs],
    )
    stops = []
    for s, wait, arrive in zip(stop_s, waits, timeline.arrivals[1:], strict=True):
        owner = names[wait.owner] if wait.owner >= 0 else ""
        stops.append(Stop(s=s, arrive=arrive, depart=max(wait.depart, arrive), yields_to=owner))
    return RobotPlan(
        id=robot.id,
        radius=robot.radius,
        start_time=start_time,
        finish_time=timeline.finish,
        length=timeline.length,
        path=path_of(path),
        profile=profile,
        stops=stops,
        wire_bytes=0,
        start_yields_to=names[starts[0].owner] if starts and starts[0].owner >= 0 else "",
        limits=Limits.of(robot),
    )


def _rounded_profile(motion: Motion) -> list[tuple[float, float]]:
    """Return the speed knots as float32: places to the nearest, speeds never upwards."""
    at_once = math.isinf(motion.limits.accel)
    knots: list[tuple[float, float]] = []
    for s, w in zip(motion.knots_s.tolist(), motion.knots_w.tolist(), strict=True):
        place = float(np.float32(s))
        if knots and place <= knots[-1][0]:
            knots[-1] = (knots[-1][0], min(knots[-1][1], float32_below(math.sqrt(w))))
            continue
        if at_once and len(knots) > 1 and knots[-1][1] == knots[-2][1] == float32_below(w**0.5):
            knots.pop()
        knots.append((place, float32_below(math.sqrt(w))))
    return knots


def _crossing(
    a: RobotPlan, b: RobotPlan, motion_a: Motion, motion_b: Motion, meeting: Meeting
) -> Crossing:
    return Crossing(
        a=a.id,
        b=b.id,
        x=meeting.x,
        y=meeting.y,
        s_a=meeting.s_a,
        s_b=meeting.s_b,
        t_a=_when(motion_a, meeting.s_a),
        t_b=_when(motion_b, meeting.s_b),
        verdict=_verdict(a, b, meeting.s_a) or _verdict(b, a, meeting.s_b) or "no stop",
    )


def _when(motion: Motion, s: float) -> float:
    """Return when a robot comes to arc length s [m]; its departure at the start."""
    if s <= 0.0:
        return motion.start_time
    return float(motion.reached(np.array([min(s, motion.limits.length)]))[0])


def _verdict(me: RobotPlan, other: RobotPlan, s: float) -> str:
    """Say how I wait for the other before the crossing at s, or return nothing."""
    waits = [stop for stop in me.stops if stop.yields_to == other.id and stop.s <= s]
    if waits:
        return f"{me.id} stops {waits[-1].depart - waits[-1].arrive:.1f} s"
    if me.start_yields_to == other.id:
        return f"{me.id} starts {me.start_time:.1f} s later"
    return ""
