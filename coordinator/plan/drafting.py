"""Make the plan document and its packed messages from paths and motions.

Decides: how a motion is rounded to the wire, and the verdict on each crossing.  Must not know:
how paths and motions were found.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from typing import Final

import msgspec
import numpy as np

from coordinator.base.errors import PlanError
from coordinator.curves.nurbs import Array, Nurbs
from coordinator.curves.nurbs_kernels import Indices
from coordinator.motion.velocity_profile import Motion
from coordinator.plan.crossings import CrossingSearch
from coordinator.plan.document import Crossing, Floor, Limits, PlanDocument, RobotPlan, Stop
from coordinator.plan.wire import PackedPlan, address, float32, float32_below, pack, path_of
from coordinator.scenario.model import Robot, Scenario
from protocol.plan_bytes import OversizeError
from protocol.timeline import Timeline

_LONGEST_BOOT: Final = 2**32 - 1


def draft_plan(
    scenario: Scenario,
    paths: Sequence[Nurbs],
    motions: Sequence[Motion],
    tau: float,
    epoch: int,
    notes: Sequence[str],
    crossings: CrossingSearch | None = None,
    shortest: Sequence[Nurbs] | None = None,
) -> PackedPlan:
    """Return the plan without its proof; tau in seconds.

    `crossings`: the search for crossings of the paths; by default all pairs are searched here.
    `shortest`: the paths that the robots would take alone; by default the same.

    Raises PlanError when a robot's path is too long for a message.
    """
    bare = _bare(scenario, tau, epoch, notes)
    names = [robot.id for robot in scenario.robots]
    parts = zip(scenario.robots, paths, motions, strict=True)
    drafted = [_robot_plan(bare, *part, number, names) for number, part in enumerate(parts)]
    robots = [
        plan if alone is path else msgspec.structs.replace(plan, shortest=path_of(alone))
        for (plan, _), path, alone in zip(drafted, paths, shortest or paths, strict=True)
    ]
    if crossings is None:
        pairs = np.array(list(combinations(range(len(robots)), 2)), dtype=np.int64).reshape(-1, 2)
        crossings = CrossingSearch(paths, pairs, None)
    said = _crossings(robots, motions, crossings.pairs, crossings.result())
    document = msgspec.structs.replace(bare, robots=robots, crossings=said)
    return PackedPlan(document, {plan.id: message for plan, message in drafted})


def can_be_sent(
    scenario: Scenario, paths: Sequence[Nurbs], motions: Sequence[Motion], tau: float
) -> bool:
    """Return whether each robot's part fits in a message."""
    bare, names = _bare(scenario, tau, 1, []), [robot.id for robot in scenario.robots]
    try:
        for number, part in enumerate(zip(scenario.robots, paths, motions, strict=True)):
            _robot_plan(bare, *part, number, names)
    except PlanError:
        return False
    return True


def _bare(scenario: Scenario, tau: float, epoch: int, notes: Sequence[str]) -> PlanDocument:
    """Return the document without robots."""
    return PlanDocument(
        scenario=scenario.name,
        epoch=epoch,
        policy=scenario.policy,
        tau=tau,
        margin=scenario.margin,
        link=scenario.link,
        robots=[],
        workspace=Floor(
            boundary=list(scenario.workspace.boundary),
            obstacles=[list(corners) for corners in scenario.workspace.obstacles],
        ),
        notes=list(notes),
    )


def _robot_plan(
    document: PlanDocument,
    robot: Robot,
    path: Nurbs,
    motion: Motion,
    number: int,
    names: Sequence[str],
) -> tuple[RobotPlan, bytes]:
    """Return a robot's part and its message; `wire_bytes` is the message's greatest length."""
    planned = rounded(robot, path, motion, names)
    try:
        message = pack(document, planned, number)
        size = len(address(message, _LONGEST_BOOT))
    except OversizeError as error:
        helps = "fewer via points" if robot.via else "a nearer goal"
        raise PlanError(str(error), robot.id, helps=helps) from None
    return msgspec.structs.replace(planned, wire_bytes=size), message


def rounded(robot: Robot, path: Nurbs, motion: Motion, names: Sequence[str]) -> RobotPlan:
    """Return a robot's part of a plan, rounded to the wire; `names`: those whom it may let pass."""
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


def _crossings(
    robots: Sequence[RobotPlan], motions: Sequence[Motion], pairs: Indices, table: Array
) -> list[Crossing]:
    """Return the crossings with times and verdicts, one per row of crossings.crossing_table."""
    whose = pairs[table[:, 0].astype(np.int64)]
    times = [_times(motions, whose[:, side], table[:, 3 + side]).tolist() for side in (0, 1)]
    waiting = {(r.id, stop.yields_to) for r in robots for stop in r.stops}
    waiting |= {(r.id, r.start_yields_to) for r in robots}
    found = []
    for (i, j), (_, x, y, s_a, s_b), t_a, t_b in zip(
        whose.tolist(), table.tolist(), *times, strict=True
    ):
        a, b = robots[i], robots[j]
        said = ""
        if (a.id, b.id) in waiting or (b.id, a.id) in waiting:
            said = _verdict(a, b, s_a) or _verdict(b, a, s_b)
        found.append(
            Crossing(
                a=a.id,
                b=b.id,
                x=x,
                y=y,
                s_a=s_a,
                s_b=s_b,
                t_a=t_a,
                t_b=t_b,
                verdict=said or "no stop",
            )
        )
    return found


def _times(motions: Sequence[Motion], whose: Indices, s: Array) -> Array:
    """Return when robots (m,) reach arc lengths (m,) [m]; at the start, when they leave it."""
    times = np.empty(len(s))
    order = np.argsort(whose, kind="stable")
    borders = np.flatnonzero(np.diff(whose[order])) + 1
    for its in np.split(order, borders) if len(order) else []:
        motion = motions[int(whose[its[0]])]
        places = np.minimum(s[its], motion.limits.length)
        times[its] = np.where(places <= 0.0, motion.start_time, motion.reached(places))
    return times


def _verdict(me: RobotPlan, other: RobotPlan, s: float) -> str:
    """Return how `me` waits for `other` before the crossing at s [m]; empty if it does not."""
    waits = [stop for stop in me.stops if stop.yields_to == other.id and stop.s <= s]
    if waits:
        return f"{me.id} stops {waits[-1].depart - waits[-1].arrive:.1f} s"
    if me.start_yields_to == other.id:
        return f"{me.id} starts {me.start_time:.1f} s later"
    return ""
