"""Where one robot can be sent among the courses of all others, and what is in its way if it cannot.

Decides: which of several goals a robot gets, which resting robots are in the way, and where a robot
in the way may rest instead.  Must not know: orders, messages, clocks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import shapely

from coordinator.base.errors import PlanError
from coordinator.curves.nurbs import Array
from coordinator.plan.course import Course
from coordinator.planning.course_proposal import Proposal, propose
from coordinator.planning.earliest_course import alone
from coordinator.planning.wish import Site, Wish
from coordinator.scenario.model import Point, Pose

_RING: Final = 0.5
"""Distance [m] between the circles on which places to rest are looked for, per metre of need."""

_NEAR: Final = 0.03
"""How much farther off [m] than needed a resting robot may be that closes a way."""

_STEP: Final = 0.05
"""Distance [m] between the places of a course that are compared with a place."""

_RINGS: Final = 24
_MOST_PLACES: Final = 6
"""How many places to rest are tried."""


@dataclass(frozen=True)
class Answer:
    """What a search found: a proven course, or why there is none.

    `alone` [s]: how long the robot would take with nobody else on the floor; inf if it has no way
    even then.  `blockers`: robots that rest in the way, whose place or way it is, and late ones
    that have yet to cross it.  `way` (n, 2) [m]: the robot's path alone.
    """

    proposal: Proposal | None
    alone: float = math.inf
    reason: str = ""
    blockers: tuple[str, ...] = ()
    way: Array | None = None


def search(site: Site, wish: Wish, others: Sequence[Course]) -> Answer:
    """Look for a course to the goal of a wish.

    A robot under way leaves its course in motion unless it arrives earlier after a stop.
    """
    wish, under_way = replace(wish, leaves=None), wish
    try:
        path, time = alone(site, wish)
    except PlanError as error:
        return Answer(None, reason=error.sentence)
    moving = None if under_way.leaves is None else _in_motion(site, under_way, others)
    way = Course.chords_of(path).points
    arrives = math.inf if moving is None else moving.course.driven.timeline.finish
    if arrives <= 0.001 * wish.begin_ms + time:
        return Answer(moving, time, way=way)
    try:
        found = propose(site, wish, others)
        is_earlier = found.course.driven.timeline.finish < arrives
        return Answer(found if is_earlier else moving, time, way=way)
    except PlanError as error:
        if moving is not None:
            return Answer(moving, time, way=way)
        in_way = [*resting_on(site, wish, way, others), *late_across(site, wish, way, others)]
        blockers = tuple(dict.fromkeys(one.driven.id for one in in_way))
        return Answer(None, time, error.sentence, blockers, way)


def _in_motion(site: Site, wish: Wish, others: Sequence[Course]) -> Proposal | None:
    """Return a course that a robot goes on to in motion; None if there is no smooth way."""
    try:
        return propose(site, wish.in_motion(), others)
    except (PlanError, ValueError):
        return None


def search_or_rest(site: Site, wish: Wish, others: Sequence[Course]) -> Answer:
    """Look for the same; without a way the course is to rest where the robot is.

    Such an answer has a reason beside its course.
    """
    found = search(site, wish, others)
    return found if found.proposal else replace(found, proposal=rest(site, wish, others).proposal)


def rest(site: Site, wish: Wish, others: Sequence[Course]) -> Answer:
    """Look for a course to rest where the robot is."""
    wish = replace(wish.to(wish.robot.start), leaves=None)
    try:
        proposal = propose(site, wish, others)
    except PlanError as error:
        return Answer(None, 0.0, error.sentence)
    return Answer(proposal, 0.0, "rests first: there is no way yet")


def stand(site: Site, wish: Wish, others: Sequence[Course]) -> Answer:
    """Look for the first course of a robot that joins: it rests where it stands."""
    (x, y), reach = wish.robot.start[:2], wish.robot.radius + site.terms.margin
    if what := site.what_is_at((x, y), reach):
        return Answer(None, reason=f"({x:.2f}, {y:.2f}) {what}")
    found = search(site, wish, others)
    if found.proposal is None and not found.blockers and (by := _yet_to_pass(site, wish, others)):
        drive, have = ("drives", "it has") if len(by) == 1 else ("drive", "they have")
        why = f"{', '.join(by)} still {drive} too near; ask again when {have} passed"
        return replace(found, reason=why)
    return found


def _yet_to_pass(site: Site, wish: Wish, others: Sequence[Course]) -> list[str]:
    """Return the robots whose courses lead too near to where a robot stands, from now on."""
    here, found = np.array(wish.robot.start[:2]), []
    for one in others:
        driven, since = one.driven, max(0.001 * wish.begin_ms - site.terms.tau, 0.0)
        length, begin = driven.curve.length, driven.timeline.s_at(since)
        arcs = np.linspace(begin, length, 2 + math.ceil(max(length - begin, 0.0) / _STEP))
        need = wish.robot.radius + driven.radius + site.terms.margin
        if _distance(here, driven.curve.at_arc(arcs)) < need:
            found.append(driven.id)
    return list(dict.fromkeys(found))


def resting_on(site: Site, wish: Wish, way: Array, others: Sequence[Course]) -> list[Course]:
    """Return the courses of others that end so near to a way (n, 2) [m] that they close it."""
    found = []
    for one in others:
        need = wish.robot.radius + one.driven.radius + site.terms.margin + _NEAR
        if _distance(np.array(one.goal), way) < need:
            found.append(one)
    return found


def late_across(site: Site, wish: Wish, way: Array, others: Sequence[Course]) -> list[Course]:
    """Return the courses of late robots that come near a way (n, 2) [m]."""
    late = [one for one in others if one.driven.id in wish.late and not one.has_ended]
    line, room = shapely.linestrings(way), wish.robot.radius + site.terms.margin
    paths = [shapely.linestrings(one.driven.chain.points) for one in late]
    needs = [room + one.driven.radius for one in late]
    are_near = shapely.dwithin(line, paths, needs)
    return [late[k] for k in np.flatnonzero(are_near).tolist()]


def make_room(
    site: Site,
    wish: Wish,
    others: Sequence[Course],
    ways: Sequence[tuple[float, Array]],
    closed: Sequence[tuple[Point, ...]] = (),
) -> Answer:
    """Look for a course to a place where a robot is in nobody's way: its home, or a place nearby.

    `ways`: radii [m] and paths (n, 2) [m] of the robots whose way is to be left free; `closed`:
    polygons that the robot may leave, but not rest in.
    """
    answer = Answer(None, reason="has no place to make room at")
    for place in _places(site, wish, others, ways, closed):
        found = search(site, wish.to(place), others)
        if found.proposal is not None:
            return found
        answer = found
    return answer


def _places(
    site: Site,
    wish: Wish,
    others: Sequence[Course],
    ways: Sequence[tuple[float, Array]],
    closed: Sequence[tuple[Point, ...]],
) -> list[Pose]:
    """Return places where a robot may rest, the nearest first, its home before all."""
    robot, margin = wish.robot, site.terms.margin
    x, y = wish.robot.start[:2]
    step = _RING * (2.0 * robot.radius + margin)
    spots = [
        (x + ring * step * math.cos(angle), y + ring * step * math.sin(angle))
        for ring in range(1, _RINGS + 1)
        for angle in np.arange(0.0, math.tau, math.tau / (6 + 2 * ring)).tolist()
    ]
    home = [] if robot.home is None else [robot.home]
    places: list[Pose] = [place for place in home if math.dist(place[:2], (x, y)) > 0.01]
    places += spots
    points = np.array([place[:2] for place in places])
    free = site.room(points) >= robot.radius + margin + 0.01
    for one in others:
        need = robot.radius + one.driven.radius + margin + 0.01
        free &= np.hypot(*(points - np.array(one.goal)).T) >= need
    for ring in closed:
        polygon = shapely.Polygon(ring)
        free &= ~shapely.dwithin(shapely.points(points), polygon, robot.radius + margin + 0.01)
    free[free] = [
        all(_distance(point, way) >= robot.radius + radius + margin for radius, way in ways)
        for point in points[free]
    ]
    return [places[k] for k in np.flatnonzero(free)[:_MOST_PLACES].tolist()]


def _distance(point: Array, line: Array) -> float:
    """Return the distance [m] from a point to a polyline (n, 2)."""
    a, b = line[:-1], line[1:]
    along = b - a
    length = np.maximum((along**2).sum(axis=1), 1e-12)
    share = np.clip(((point - a) * along).sum(axis=1) / length, 0.0, 1.0)
    return float(np.hypot(*(a + share[:, None] * along - point).T).min())
