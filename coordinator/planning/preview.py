"""What an order would come to: the robot's way, its arrival, and for whom it would wait.

Nothing is reserved: what the fleet does meanwhile may make it otherwise.

Decides: where a robot would begin, which robot would do an order for anybody, and for whom each
rest on the way is.  Must not know: messages to and from operators, links, clocks.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from msgspec.structs import replace

from coordinator.base.errors import PlanError
from coordinator.curves.nurbs import Array
from coordinator.plan.course import Course
from coordinator.planning.course_proposal import Proposal
from coordinator.planning.course_search import search
from coordinator.planning.earliest_course import alone
from coordinator.planning.wish import Site, Wish
from coordinator.scenario.model import Point, Pose, Robot

_MOST_ROBOTS: Final = 3
"""Of robots that are free, so many nearest ones are compared."""

_LEAD: Final = 0.5
"""So soon [s] a robot at rest can begin."""

_SHORTEST: Final = 0.05
"""Rests shorter than this [s] are not told."""


@dataclass(frozen=True)
class PreviewWait:
    """A rest of `seconds` at a place [m], for another robot; "" if it is for none."""

    robot: str
    place: Point
    seconds: float


@dataclass(frozen=True)
class Preview:
    """The outlook of an order; `begin` and `finish` [s] are plan times, `alone` [s] is a duration.

    `way` (n, 2) [m]; empty if there is none, and then `reason` says why.
    """

    robot: str
    way: Array
    begin: float = 0.0
    finish: float = 0.0
    alone: float = 0.0
    waits: tuple[PreviewWait, ...] = ()
    reason: str = ""


@dataclass(frozen=True, eq=False)
class Fleet:
    """Robots that can get orders, and the courses of all at plan time `now` [s].

    `late` [s]: who is late, and how much.  `idle`: who has nothing to do.
    """

    robots: Mapping[str, Robot]
    courses: Mapping[str, Course]
    now: float
    late: Mapping[str, float]
    idle: frozenset[str]


def preview(
    site: Site, fleet: Fleet, robot: str, goal: Pose, via: Sequence[Point], *, at_once: bool
) -> Preview:
    """Return what an order would come to; `robot`: "" for whoever would be there first.

    `at_once`: the robot leaves what it does; otherwise it goes on when it has done that.
    """
    names = [robot] if robot else _nearest(fleet, goal)
    if not names:
        return Preview("", np.empty((0, 2)), reason="no robot is free; the first that is gets it")
    wishes = [_wish(fleet, name, goal, via, at_once) for name in names]
    wish = min(wishes, key=lambda one: _time_alone(site, one)) if len(wishes) > 1 else wishes[0]
    name = wish.robot.id
    others = [one for id_, one in fleet.courses.items() if id_ != name]
    answer = search(site, wish, others)
    if answer.proposal is None:
        way = np.empty((0, 2)) if answer.way is None else answer.way
        return Preview(name, way, reason=_why(answer.reason, answer.blockers))
    line = answer.proposal.course.driven.timeline
    return Preview(
        name,
        Course.chords_of(answer.proposal.course.driven.curve).points,
        max(0.001 * wish.begin_ms, fleet.now),
        line.finish,
        answer.alone,
        tuple(_waits(answer.proposal, 0.001 * wish.begin_ms + wish.delay)),
    )


def _why(reason: str, blockers: Sequence[str]) -> str:
    if not blockers:
        return reason
    return f"{', '.join(blockers)} {'rest' if len(blockers) > 1 else 'rests'} in the way"


def _nearest(fleet: Fleet, goal: Pose) -> list[str]:
    def away(name: str) -> float:
        return math.dist(fleet.courses[name].goal, goal[:2])

    return sorted(fleet.idle & fleet.courses.keys() & fleet.robots.keys(), key=away)[:_MOST_ROBOTS]


def _time_alone(site: Site, wish: Wish) -> float:
    try:
        return alone(site, wish)[1]
    except PlanError:
        return math.inf


def _wish(fleet: Fleet, name: str, goal: Pose, via: Sequence[Point], at_once: bool) -> Wish:
    """Return what is looked for: from the robot's goal, or from where it can stop now."""
    robot, driven = fleet.robots[name], fleet.courses[name].driven
    line, late = driven.timeline, fleet.late.get(name, 0.0)
    arrival = line.finish + late
    begin, s = max(arrival, fleet.now + _LEAD), line.length
    if at_once and arrival > fleet.now:
        stops = robot.max_speed / robot.max_accel
        begin = fleet.now + _LEAD + stops
        s = float(line.s_at(begin - late))
    places, ahead = driven.curve.derivatives(driven.curve.parameter_at([s]), 1)
    x, y = places[0].tolist()
    heading = math.atan2(ahead[0, 1], ahead[0, 0])
    start: Pose = (x, y, heading) if robot.min_turn_radius > 0.0 else (x, y)
    wanted = replace(robot, start=start, goal=goal, via=tuple(via), path=None)
    return Wish(wanted, heading, 0, 0, round(1000.0 * begin), 0.0, fleet.late)


def _waits(proposal: Proposal, release: float) -> list[PreviewWait]:
    """Return the rests of a course after `release` [s], each with for whom it is.

    A course that is the earliest comes as close as it may, between this rest and the next one, to
    the robot for which it rests.
    """
    driven, stairs = proposal.course.driven, proposal.staircases
    rests = [(s, max(arrive, release), depart) for s, arrive, depart in driven.rests]
    ends = [depart for _, _, depart in rests[1:]] + [math.inf]
    found = []
    for (s, begin, depart), end in zip(rests, ends, strict=True):
        if depart - begin < _SHORTEST:
            continue
        owner, nearest = 0, -math.inf
        for k in np.flatnonzero(stairs.behind == 0).tolist():
            at, need = stairs.knots_of(k).T
            behind = (need - at)[(at > 1000.0 * depart) & (at <= 1000.0 * end)]
            if len(behind) and behind.max() > nearest:
                owner, nearest = int(stairs.ahead[k]), float(behind.max())
        if owner == 0 and s <= 0.0:
            continue  # The robot turns on the spot.
        x, y = driven.curve.at_arc([s])[0].tolist()
        name = proposal.near[owner - 1].driven.id if owner else ""
        found.append(PreviewWait(name, (x, y), depart - begin))
    return found
