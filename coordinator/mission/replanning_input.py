"""What a new plan starts from: the floor with all robots on it, and which of them are to drive.

A robot that is planned for starts where it rests.  One with a given path drives the remainder of
that path; if it rests off the path, it finds its own way to the same goal.  A robot that is not
planned for stands aside: it is at its goal, lost, unfit, or closed in.  It is an obstacle that
covers all places where it may stand.

Decides: where robots stand, and what of a scenario is left to do.  Must not know: how plans are
found, phases.
"""

from __future__ import annotations

import math
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field
from dataclasses import replace as changed
from typing import Final, Literal

import numpy as np
import shapely
from msgspec.structs import replace

from coordinator.curves.knots import piece
from coordinator.curves.nurbs import Array
from coordinator.fleet.rest_places import Standing
from coordinator.paths.given_path import path_of
from coordinator.plan.wire import Driven
from coordinator.scenario.margin import track_mm_for
from coordinator.scenario.model import Point, Pose, Robot, Scenario

Why = Literal["arrived", "lost", "unfit", "overloaded", "closed in"]

_CORNERS: Final = 24
"""Corners of the polygon around a disc; they lie outside of it by 0.9 % of the radius.  A way past
more corners has more control points, and small robots hold few."""

_STEP: Final = 0.02
"""Distance between samples of a stretch of path on which a robot may stand [m]."""

_ON_PATH: Final = 0.75
"""A robot that is off its path by at most this share of its track tolerance starts on the path.

It arms if it is off by a little more than that.  The margin covers this distance.
"""

_TOLD: Final = 1.25e-3
"""A bound on the error of a place that a robot states [m].

The place is rounded to millimetres, and a place up to _THERE short of the goal is taken for the
goal.  The margin covers this error, too."""

_PER_TURN: Final = 0.037
"""How far [m] a robot deviates from its path per radian that its start is turned from the path."""

TURNING: Final = 0.1
"""Free space [m] that a via point needs beyond a robot's reach, because paths turn there."""

_THERE: Final = 1e-3
"""A robot nearer to its goal than this [m] is at its goal.

A robot that is short of its goal by no more than it may be off its path counts as arrived, too:
the rest of the path is too short to drive."""

SAME: Final = 0.012
"""A course that ends no farther from a robot's goal than this [m] leads there."""


@dataclass(frozen=True, eq=False)
class Aside:
    """A robot that is not planned for: why, the places (n, 2) [m] where it may stand, its pose.

    `pose` is None if it is not known well enough for the robot to start from there.
    """

    robot: Robot
    why: Why
    places: Array
    pose: Pose | None

    def __str__(self) -> str:
        """Return where the robot stands, in words."""
        first, last = (f"({x:.2f}, {y:.2f})" for x, y in self.places[[0, -1]])
        return f"stands at {first}" if first == last else f"stands between {first} and {last}"

    def disc(self) -> tuple[Point, ...]:
        """Return the polygon that contains the robot's disc at every place where it may stand."""
        angles = np.arange(_CORNERS) * (math.tau / _CORNERS)
        radius = self.robot.radius / math.cos(math.pi / _CORNERS)
        disc = radius * np.column_stack((np.cos(angles), np.sin(angles)))
        discs = self.places[:, None] + disc
        pairs = np.concatenate((discs, np.roll(discs, -1, axis=0)), axis=1)[
            : max(len(discs) - 1, 1)
        ]
        whole = shapely.union_all(shapely.convex_hull(shapely.multipoints(pairs)))
        ring = shapely.get_coordinates(shapely.orient_polygons(whole).exterior)[:-1]
        return tuple((float(x), float(y)) for x, y in ring)


@dataclass(frozen=True, eq=False)
class Site:
    """The robots of a fleet: the scenario has those to plan for, `aside` has the others."""

    scenario: Scenario
    aside: tuple[Aside, ...] = field(default=())

    def planned(self) -> Scenario:
        """Return the scenario to plan, in which the robots aside are obstacles."""
        floor = self.scenario.workspace
        discs = tuple(one.disc() for one in self.aside)
        names = tuple(f"the place where {one.robot.id} may stand" for one in self.aside)
        solid = replace(floor, obstacles=floor.obstacles + discs, names=floor.names + names)
        return replace(self.scenario, workspace=solid)

    def without(self, robot: str) -> Site:
        """Return the site with a robot put aside at its start, because it is closed in."""
        (one,) = (r for r in self.scenario.robots if r.id == robot)
        rest = tuple(r for r in self.scenario.robots if r.id != robot)
        here = np.array([one.start[:2]])
        stays = Aside(one, "closed in", here, one.start)
        return Site(replace(self.scenario, robots=rest), (*self.aside, stays))

    def not_passing(self, robot: str, closed: Container[Point]) -> Site:
        """Return the site without these via points of a robot."""
        robots = []
        for one in self.scenario.robots:
            left = tuple(place for place in one.via if one.id != robot or place not in closed)
            robots.append(replace(one, via=left))
        return Site(replace(self.scenario, robots=tuple(robots)), self.aside)

    def sent(self, robot: Robot) -> Site:
        """Return the site in which a robot is on its way to another goal."""
        others = tuple(r for r in self.scenario.robots if r.id != robot.id)
        aside = tuple(one for one in self.aside if one.robot.id != robot.id)
        return Site(replace(self.scenario, robots=(*others, robot)), aside)

    def among(self, known: Container[str]) -> Site:
        """Return the site without robots that have left the fleet."""
        robots = tuple(robot for robot in self.scenario.robots if robot.id in known)
        aside = tuple(one for one in self.aside if one.robot.id in known)
        return Site(replace(self.scenario, robots=robots), aside)

    def idling(self, silent: Container[str]) -> Site:
        """Return the site in which robots at their goals are planned for, as idle ones.

        Those that are silent stand aside: they would not arm.
        """
        heard = [one for one in self.aside if one.robot.id not in silent]
        stay = [one for one in heard if one.why == "arrived"]
        idle = [replace(one.robot, start=one.robot.goal, via=(), path=None) for one in stay]
        robots = sorted([*self.scenario.robots, *idle], key=lambda robot: robot.id)
        aside = tuple(one for one in self.aside if one not in stay)
        return Site(replace(self.scenario, robots=tuple(robots)), aside)

    def on_given_path(self, robot: str) -> bool:
        """Return whether a robot that is planned for has a given path."""
        return any(r.id == robot and r.path is not None for r in self.scenario.robots)

    def off_given_path(self, robot: str) -> Site:
        """Return the site in which a robot finds its own way to the end of its given path."""
        robots = (replace(r, path=None) if r.id == robot else r for r in self.scenario.robots)
        return Site(replace(self.scenario, robots=tuple(robots)), self.aside)


_NOWHERE: Final[Mapping[str, Pose]] = {}

Rides = Mapping[tuple[str, int, int], Driven]
"""The courses that robots were sent, by robot, epoch and revision."""


def next_site(
    site: Site, rides: Rides, told: Sequence[Standing], homes: Mapping[str, Pose] = _NOWHERE
) -> Site:
    """Return the site after the fleet has come to rest.

    `rides` has the courses that the standings refer to; `homes`: where robots that have made room
    go back to.  A robot of the site's scenario without a
    standing keeps its start.  A robot aside without a standing stays aside, unless it is closed in:
    then it is planned for again.
    """
    known = {standing.robot: standing for standing in told}
    robots: list[Robot] = []
    aside: list[Aside] = []
    before = {one.robot.id: one for one in site.aside}
    everybody = [*site.scenario.robots, *(one.robot for one in site.aside)]
    for robot in sorted(everybody, key=lambda robot: robot.id):
        was, standing = before.get(robot.id), known.get(robot.id)
        found = _stands(robot, was, standing, rides, site.scenario.margin)
        if robot.id in homes:
            found = _going_back(found, homes[robot.id])
        if isinstance(found, Robot):
            robots.append(found)
        else:
            aside.append(found)
    return Site(replace(site.scenario, robots=tuple(robots)), tuple(aside))


def passable(site: Site) -> tuple[Site, list[str]]:
    """Drop the via points that robots aside block; return the site and a sentence for each."""
    said: list[str] = []
    robots = []
    for robot in site.scenario.robots:
        room = robot.radius + site.scenario.margin + TURNING
        left = []
        for place in robot.via:
            here = shapely.Point(place)
            by = [a for a in site.aside if shapely.Polygon(a.disc()).distance(here) <= room]
            if by:
                where = f"({place[0]:.2f}, {place[1]:.2f})"
                said.append(f"{robot.id} does not pass {where}: {by[0].robot.id} stands there")
            else:
                left.append(place)
        robots.append(replace(robot, via=tuple(left)))
    return Site(replace(site.scenario, robots=tuple(robots)), site.aside), said


def _stands(
    robot: Robot,
    was: Aside | None,
    standing: Standing | None,
    rides: Rides,
    margin: float,
) -> Robot | Aside:
    """Return a robot with its new start, or an Aside if it is not to be planned for."""
    if standing is not None and standing.place is not None:
        return _comes_back(robot, standing, standing.place, margin)
    if standing is None or (was is not None and was.why == "arrived"):
        if was is None or was.why != "closed in" or was.pose is None:
            return robot if was is None else was
        return replace(was.robot, start=was.pose)
    ride = rides.get((robot.id, standing.epoch, standing.revision))
    if standing.state == "arrived":
        return _at_end(robot, ride)
    if ride is None:
        known = was or Aside(robot, "lost", np.array([robot.start[:2]]), None)
        return changed(known, why="lost") if standing.state == "lost" else known
    if standing.s is None:
        return Aside(robot, "lost", _stretches(rides, standing), None)
    s, pose = min(standing.s, ride.curve.length), resting_pose(ride, standing, margin)
    if standing.state != "rests":
        return Aside(robot, standing.state, np.array([pose[:2]]), pose)
    end = ride.curve.points[-1]
    if math.dist(end, robot.goal[:2]) > SAME:  # It has been sent elsewhere since.
        return replace(robot, start=pose, path=None)
    if _is_on_path(standing, margin, max(ride.curve.length - s - _THERE, 0.0)):
        return Aside(robot, "arrived", np.array([robot.goal[:2]]), None)
    path = None
    if robot.path is not None and _is_on_path(standing, margin):
        u = float(ride.curve.parameter_at([s])[0])
        path = path_of(piece(ride.curve, u, float(ride.curve.knots[-1])))
    return replace(robot, start=pose, via=via_ahead(ride, robot.via, s), path=path)


def _comes_back(robot: Robot, standing: Standing, place: Pose, margin: float) -> Robot | Aside:
    """Return a robot that has come back and has stated its place, which may be its goal."""
    if standing.state == "lost":
        return Aside(robot, "lost", np.array([place[:2]]), place)
    if math.dist(place[:2], robot.goal[:2]) <= max(on_path(margin), _THERE):
        return Aside(robot, "arrived", np.array([robot.goal[:2]]), None)
    return replace(robot, start=place, via=(), path=None)


def _at_end(robot: Robot, ride: Driven | None) -> Aside:
    """Return a robot that has driven its course to the end, which may not be where it was sent."""
    if ride is not None and math.dist(ride.curve.points[-1], robot.goal[:2]) > SAME:
        goal = pose_beside(ride, ride.curve.length)
        robot = replace(robot, goal=goal, via=(), path=None)
    return Aside(robot, "arrived", np.array([robot.goal[:2]]), None)


def _going_back(found: Robot | Aside, home: Pose) -> Robot | Aside:
    """Return a robot that goes back from where it was sent to make room, if it can drive."""
    if isinstance(found, Robot):
        return replace(found, goal=home, via=(), path=None)
    robot = found.robot
    if found.why != "arrived" or math.dist(robot.goal[:2], home[:2]) <= SAME:
        return found
    return replace(robot, start=robot.goal, goal=home, via=(), path=None)


def _stretches(rides: Rides, standing: Standing) -> Array:
    """Return the places (n, 2) [m] where a robot may stand if only plan times are known."""
    first = (standing.revision, standing.since, standing.until)
    ways = [
        stretch(ride, since, until)
        for revision, since, until in (first, *standing.also)
        if (ride := rides.get((standing.robot, standing.epoch, revision))) is not None
    ]
    return np.concatenate(ways)


def stretch(ride: Driven, since: float, until: float) -> Array:
    """Return the places (n, 2) [m] of a robot's course between two plan times [s]."""
    low = ride.timeline.s_at(max(since, 0.0))
    high = max(ride.timeline.s_at(max(until, 0.0)), low)
    return ride.curve.at_arc(np.linspace(low, high, 2 + math.ceil((high - low) / _STEP)))


def resting_pose(ride: Driven, standing: Standing, margin: float) -> tuple[float, float, float]:
    """Return where a robot has said that it rests [m] and its heading [rad].

    It counts as on its path if it is near enough.
    """
    assert standing.s is not None
    s = min(standing.s, ride.curve.length)
    if _is_on_path(standing, margin):
        return pose_beside(ride, s)
    return pose_beside(ride, s, standing.off, standing.beyond, standing.turn)


def pose_beside(
    ride: Driven, s: float, off: float = 0.0, beyond: float = 0.0, turn: float = 0.0
) -> tuple[float, float, float]:
    """Return x, y [m] and heading [rad] of a robot that is beside its path at arc length s [m].

    The robot is `off` [m] to the left of that place, `beyond` [m] ahead of it, and turned from the
    path by `turn` [rad].
    """
    places, first = ride.curve.derivatives(ride.curve.parameter_at([s]), 1)
    x, y = places[0].tolist()
    heading = math.atan2(first[0, 1], first[0, 0])
    x += beyond * math.cos(heading) - off * math.sin(heading)
    y += beyond * math.sin(heading) + off * math.cos(heading)
    return x, y, math.remainder(heading + turn, math.tau)


def _is_on_path(standing: Standing, margin: float, short: float = 0.0) -> bool:
    """Return whether a robot that is `short` [m] of a place on its path may start from there."""
    off = abs(standing.off) + abs(standing.beyond)
    return short + off + _PER_TURN * abs(standing.turn) <= on_path(margin)


def on_path(margin: float) -> float:
    """Return how far [m] a robot may be off its path and still start as if it stood on it."""
    track = track_mm_for(margin) / 1000.0
    return min(_ON_PATH * track, track - _TOLD)


def via_ahead(ride: Driven, via: Sequence[Point], s: float) -> tuple[Point, ...]:
    """Return the via points that a robot has yet to pass, in order."""
    if not via:
        return ()
    arcs = np.linspace(0.0, ride.curve.length, 2 + math.ceil(ride.curve.length / _STEP))
    places, passed, left = ride.curve.at_arc(arcs), 0, []
    for place in via:
        passed += int(np.argmin(np.hypot(*(places[passed:] - place).T)))
        if arcs[passed] > s:
            left.append(place)
    return tuple(left)
