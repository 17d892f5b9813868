"""The path and motion by which one robot arrives first among the courses of all others.

Tried are its shortest path, paths that move aside for others, detours, and paths that lead off the
course that it drives; for each the earliest motion is found.

Decides: which path one robot takes, and when it drives where on it.  Must not know: messages,
staircases, the proof.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from msgspec.structs import replace as changed

from coordinator.base.errors import PlanError
from coordinator.base.kept import kept
from coordinator.bends.among_courses import Times, pitches_of, traffic_for
from coordinator.bends.courses import may_bend
from coordinator.bends.courses_met import CoursesMet, errand_of, stretch_of
from coordinator.bends.traffic_kernels import Errand
from coordinator.curves.nurbs import Array, Nurbs
from coordinator.ground.free_space import NO_DISCS
from coordinator.motion.velocity_profile import Motion, SpeedLimits, limits_on
from coordinator.paths.path_planner import Pathfinder
from coordinator.plan.course import Course
from coordinator.plan.shares_of_tau import BRAKING_SHARE
from coordinator.plan.wire import Driven
from coordinator.planning.leading_off import UnderWay
from coordinator.planning.planner import NEED_PAD, TAU_PAD
from coordinator.planning.wish import Site, Wish
from coordinator.scenario.model import Robot, Scenario
from coordinator.schedule.forbidden_interval_kernels import BOTH
from coordinator.schedule.junctions import Junctions
from coordinator.schedule.safe_interval_kernels import Departure
from coordinator.schedule.safe_intervals import earliest_motion, rest_of_motion
from coordinator.schedule.timetable import Motions
from coordinator.schedule.track import Track

_TURN_TIME: Final = 0.3
"""A robot that has turned on the spot settles in this time [s]."""

_DETOURS: Final = 3
_LONG: Final = 1.0
"""Up to _DETOURS detours are tried for a robot that waits longer than this [s] for another."""

_WORTH: Final = 0.2
"""How much quicker [s] a detour has to be."""

_TIMES: Final = np.array([[1.0], [1.0], [0.0], [0.0], [0.0], [0.0]])
"""Which rows of Driven.legs are times."""

_OVERLAP: Final = 1.8
"""Copies of a late robot's course are apart by at most this share of tau: 2 would leave no gap
either, but for rounding."""

_MOST_COPIES: Final = 16
"""For a robot that is later than this many copies cover there are gaps."""

_CELL: Final = 0.03
"""Length [m] of the cells of a path.  With shorter ones the robot may leave sooner by as long as it
takes for two cells, and the search takes longer."""

_LONGEST_CELL: Final = 0.06
_ROWS: Final = 5_000
"""Cells are up to _LONGEST_CELL [m] long if there are more rows than this.  Days of 50 robots had
at most 4,800."""

_MOST_IN_ZONES: Final = 1800.0
"""No further path is tried once those tried lead through zones of so many metres.  Among 50 robots
they seldom lead through 400; among 1,000 it spares the slowest searches a fifth of their time."""

_ROUGH: Final = 0.2
"""How much farther [m] than the need others count when it is told what the robot may meet of them:
cells and chords are that coarse."""

_LANE_ROOM: Final = 0.01
_SPACING: Final = 0.25
_MOST_DISCS: Final = 60


@dataclass(frozen=True, eq=False)
class Search:
    """A wish on a site among other courses, and what all tries of paths share."""

    site: Site
    wish: Wish
    others: Sequence[Course]

    @cached_property
    def finder(self) -> Pathfinder:
        """The search for the robot's path from where it rests."""
        return _finder(self.site, self.wish.robot, self.others)

    @cached_property
    def met(self) -> CoursesMet:
        """The other courses, by what the robot can meet of them."""
        return CoursesMet(self.others, self.wish.late)

    @cached_property
    def errand(self) -> Errand:
        """What bounds where the robot can be, and when; under way only when it begins."""
        wish = self.wish
        speed = self.site.scenario.planned_speed(wish.robot) if wish.leaves is None else math.inf
        return errand_of(wish.robot, 0.001 * wish.begin_ms, math.inf, speed)

    def ahead(self, course: Course, delay: float) -> Track | None:
        """Return the part of a course that the robot may meet as a track; None if it meets none.

        `delay` [s]: how late the other robot is.
        """
        key = id(course), delay
        if key not in self._tracks:
            stretch = stretch_of(course, self.errand, self.reach, self.tau, delay)
            self._tracks[key] = None if stretch is None else _part(course.driven, *stretch)
        return self._tracks[key]

    @property
    def reach(self) -> float:
        """How near [m] the rims of others may matter to the robot's centre."""
        return self.wish.robot.radius + self.site.terms.margin + NEED_PAD + _ROUGH

    @property
    def tau(self) -> float:
        """For how long [s] others keep the robot away before and after they pass."""
        return self.site.terms.tau + TAU_PAD

    @cached_property
    def in_zones(self) -> list[float]:
        """How far [m] each path that was tried leads through zones."""
        return []

    @cached_property
    def _tracks(self) -> dict[tuple[int, float], Track | None]:
        return {}


@dataclass(frozen=True, eq=False)
class Try:
    """A path with its earliest motion among others, the robot being 0 and near[k] k + 1.

    Robots that are late are in `near` several times.  The robot may leave its start at `release`
    [s].
    """

    path: Nurbs
    track: Track
    release: float
    motion: Motion
    junctions: Junctions
    near: list[Course]


def alone(site: Site, wish: Wish) -> tuple[Nurbs, float]:
    """Return the path with nobody else on the floor, and how long it takes [s].

    Raises PlanError if there is no way even then.
    """
    path = _finder(site, wish.robot, ()).path(0)
    return path, wish.delay + _turning(path, wish) + _track(site, wish.robot, path).alone


def earliest(search: Search) -> Try:
    """Return the path on which the robot arrives first: the shortest, a bent one, or a detour."""
    bends = search.wish.leaves is None and may_bend(search.wish.robot)
    try:
        return _bent(search) if bends else _detour(search)
    except PlanError:
        if not search.wish.late:
            raise
        return earliest(replace(search, wish=replace(search.wish, late={})))


def _detour(search: Search) -> Try:
    """Return a try on the shortest path, or on one that avoids where the robot waits longest."""
    best = _try(search, NO_DISCS)
    for _ in range(_DETOURS):
        discs = _conflict_discs(search.wish.robot, best)
        if discs is None:
            break
        try:
            other = _try(search, discs)
        except PlanError:
            break
        if other.motion.finish > best.motion.finish - _WORTH:
            break
        best = other
    return best


def _bent(search: Search) -> Try:
    """Return a try on the shortest path, or on one that moves aside if the robot arrives earlier.

    Such a path is looked for on ever finer meshes, as long as the robot loses much.  The finest one
    is searched only if no coarser one has a path, or the motion on the last one found came late: it
    takes as long as both, and seldom improves on one that suits.
    """
    site, wish = search.site, search.wish
    path = search.finder.path(0)
    release, track = _release(wish, path), _track(site, wish.robot, path)
    ramp = 0.5 * site.scenario.planned_speed(wish.robot) / track.limits.ramp
    found, error, finish = None, None, math.inf
    try:
        found = _motion(search, path)
        finish = found.motion.finish
    except PlanError as problem:
        error = problem
    suits, traffic = False, None
    for pitch in pitches_of(site.scenario, wish.robot):
        if finish < release + track.alone + pitch.lost or (suits and pitch.is_last):
            break
        if found is not None and sum(search.in_zones) > _MOST_IN_ZONES:
            break
        latest = finish - _WORTH
        times = Times(release, latest, ramp, site.terms.tau)
        if traffic is None:
            traffic = traffic_for(search.finder, search.met, times)
        aside = site.bends.path(search.finder, traffic, times, pitch)
        if aside is not None:
            suits = False
            with suppress(PlanError):
                found = _motion(search, aside, latest)
                finish, suits = found.motion.finish, True
    if found is None:
        assert error is not None
        raise error
    return found


def _try(search: Search, discs: Array) -> Try:
    """Return a path that avoids discs (k, 3) [m], and its earliest motion."""
    if search.wish.leaves is not None:
        return _motion_under_way(search, search.wish.leaves, discs)
    return _motion(search, search.finder.path(0, discs))


def _conflict_discs(robot: Robot, found: Try) -> Array | None:
    """Return discs (k, 3) [m] around the part of another course for which the robot waits longest.

    None if it does not wait for long.
    """
    motion = found.motion
    at_start = bool(motion.waits) and motion.waits[0].s <= 0.0
    arrivals = [found.release, *motion.arrivals[1:]][0 if at_start else 1 :]
    waits = [
        (wait.depart - arrival, wait)
        for wait, arrival in zip(motion.waits, arrivals, strict=True)
        if wait.owner > 0 and wait.zone >= 0
    ]
    length, longest = max(waits, key=lambda one: one[0], default=(0.0, None))
    if longest is None or length < _LONG:
        return None
    other = found.near[longest.owner - 1]
    begin, end = found.junctions.zones.extent[longest.zone, 2:]
    reach = robot.radius + other.driven.radius + found.junctions.margin + _LANE_ROOM
    curve = other.driven.curve
    low, high = max(begin - reach, 0.0), min(end + reach, curve.length)
    count = 2 + int((high - low) / (_SPACING * reach))
    centers = curve.at_arc(np.linspace(low, high, min(count, _MOST_DISCS)))
    anchors = np.array([robot.start[:2], *robot.via, robot.goal[:2]])
    apart = np.hypot(*(centers[:, None, :] - anchors).transpose(2, 0, 1)).min(axis=1)
    beside = centers[apart > 1.15 * reach]
    return np.column_stack((beside, np.full(len(beside), reach))) if len(beside) else None


def _finder(site: Site, robot: Robot, others: Sequence[Course]) -> Pathfinder:
    """Return a search for a robot's path among others that stand where they will rest."""
    staying = [one for one in others if one.until == math.inf]
    stand = tuple(_resting(one.driven) for one in staying)
    parked = [index for index, one in enumerate(staying, start=1) if one.has_ended]
    scenario = Scenario(
        name=site.scenario.name,
        workspace=site.scenario.workspace,
        robots=(robot, *stand),
        margin=site.scenario.margin,
        speed_reserve=site.scenario.speed_reserve,
    )
    return Pathfinder(scenario, site.floor, parked)


@kept
def _resting(driven: Driven) -> Robot:
    """Return the robot of a course as one that stands at its end."""
    x, y = driven.curve.points[-1].tolist()
    return Robot(
        id=driven.id,
        start=(x, y),
        goal=(x, y),
        radius=driven.radius,
        max_speed=1.0,
        max_accel=1.0,
        max_lateral_accel=1.0,
    )


def _track(site: Site, robot: Robot, path: Nurbs) -> Track:
    return _driven_alone(path, robot, site.scenario.planned_speed(robot))


@kept
def _driven_alone(path: Nurbs, robot: Robot, speed: float) -> Track:
    accel = BRAKING_SHARE * robot.max_accel
    limits = limits_on(path, speed, accel, robot.max_lateral_accel, robot.max_turn_rate)
    return Track(limits, Course.chords_of(path))


def _turning(path: Nurbs, wish: Wish) -> float:
    """Return how long [s] a robot at rest takes to turn towards its path."""
    _, ahead = path.derivatives([0.0], 1)
    turn = math.remainder(math.atan2(ahead[0, 1], ahead[0, 0]) - wish.heading, 2.0 * math.pi)
    return abs(turn) / wish.robot.max_turn_rate + _TURN_TIME if abs(turn) > 0.01 else 0.0


def _release(wish: Wish, path: Nurbs) -> float:
    """Return when [s] a robot at rest has turned towards its path."""
    return 0.001 * wish.begin_ms + wish.delay + _turning(path, wish)


def _motion(search: Search, path: Nurbs, latest: float = math.inf) -> Try:
    """Return the earliest motion of a robot that stands at its start until it has turned.

    Raises PlanError if it cannot hold the path, or does not arrive before `latest` [s].
    """
    wish = search.wish
    if 0 < wish.holds.points < len(path.points):
        raise PlanError("cannot hold its path", wish.robot.id)
    release = _release(wish, path)
    track = _track(search.site, wish.robot, path)
    junctions, motions, near = _among(search, track, latest)
    departure = Departure(release, math.inf, 0.001 * wish.begin_ms)
    motion = earliest_motion(
        junctions, motions, 0, departure=departure, latest=latest, quickest=latest < math.inf
    )
    if motion is None:
        raise PlanError("has no way among the others, whenever it sets out", wish.robot.id)
    return Try(path, track, release, motion, junctions, near)


def _motion_under_way(search: Search, leaves: UnderWay, discs: Array) -> Try:
    """Return the earliest motion of a robot that leaves its course while it drives."""
    robot = search.wish.robot
    path, limits, track = _leading_off(search, leaves, discs)
    junctions, motions, near = _among(search, track, math.inf)
    modes = np.full(len(junctions.zones_of(0)), BOTH)
    motion = rest_of_motion(junctions, motions, 0, leaves.begun(limits), modes)
    if motion is None:
        raise PlanError("has no way among the others without a stop", robot.id)
    motion = leaves.without_run_up(motion, limits)
    return Try(path, track, 0.001 * search.wish.begin_ms, motion, junctions, near)


def _leading_off(
    search: Search, leaves: UnderWay, discs: Array
) -> tuple[Nurbs, SpeedLimits, Track]:
    """Return the quickest path that leads off a course, of several that turn early or later."""
    site, robot, others = search.site, search.wish.robot, search.others
    speed, accel = site.scenario.planned_speed(robot), BRAKING_SHARE * robot.max_accel
    found, error = [], PlanError("has no smooth way off its course", robot.id)
    for braking, turning in leaves.leads(accel, robot.max_lateral_accel):
        try:
            if robot.min_turn_radius > 0.0:
                finder = _finder(site, changed(robot, start=leaves.start(braking)), others)
                path = leaves.joined(finder.fit(0, discs), braking)
            else:
                finder = _finder(site, changed(robot, start=leaves.start()[:2]), others)
                lead = leaves.start(braking + turning)[:2]
                path = leaves.joined(finder.fit(0, discs, lead=lead), 0.0)
            limits = leaves.limits(path, robot, speed, accel)
        except PlanError as problem:
            error = problem
            continue
        found.append((path, limits, leaves.track(path, limits)))
    if not found:
        raise error
    return min(found, key=lambda one: one[2].alone)


def _among(search: Search, track: Track, latest: float) -> tuple[Junctions, Motions, list[Course]]:
    """Return where a robot meets others, the motions of these, and their courses.

    latest [s]: when the robot has to arrive.
    """
    site, wish = search.site, search.wish
    robot, margin = wish.robot, site.terms.margin + NEED_PAD
    errand = search.errand._replace(latest=latest)
    met = search.met.met_along(track.chords.points, errand, search.reach, search.tau)
    among = [search.others[k] for k in met]
    # No path leads through robots that are parked.
    among = [one for one in among if not one.has_ended or one.until < math.inf]
    copies = [(one, delay) for one in among for delay in _delays(site, wish, one)]
    parts = [search.ahead(one, delay) for one, delay in copies]
    copies = [copy for copy, part in zip(copies, parts, strict=True) if part is not None]
    near = [one for one, _ in copies]
    tracks = [track, *(part for part in parts if part is not None)]
    radii = [robot.radius, *(one.driven.radius for one in near)]
    junctions = Junctions(tracks, radii, margin, search.tau, among=(0,), cell=_CELL)
    junctions = junctions.in_fewer(0, _ROWS, _LONGEST_CELL)
    search.in_zones.append(float(np.ptp(junctions.spans(0), axis=1).sum()))
    motions = Motions(junctions.lengths())
    for index, (one, delay) in enumerate(copies, start=1):
        legs = one.driven.legs
        motions.put_legs(index, legs + delay * _TIMES if delay else legs)
    return junctions, motions, near


def _delays(site: Site, wish: Wish, other: Course) -> list[float]:
    """Return by how much [s] copies of a course are put off, so that nobody goes between them.

    Each copy keeps others away for tau before and after it.
    """
    late = wish.late.get(other.driven.id, 0.0)
    if not late:
        return [0.0]
    count = min(math.ceil(late / (_OVERLAP * site.terms.tau)), _MOST_COPIES)
    return list(np.linspace(0.0, late, count + 1))


def _part(driven: Driven, begin: float, end: float) -> Track:
    """Return a course as a track, with the chords from one place to another [m] only."""
    track = _known(driven)
    chords, last = track.chords, len(track.chords.s) - 1
    first = min(int(chords.s.searchsorted(begin, side="right")) - 1, last - 1)
    stop = max(int(chords.s.searchsorted(end, side="left")), first + 1)
    if first <= 0 and stop >= last:
        return track
    return replace(track, chords=chords.part(max(first, 0), stop))


@kept
def _known(driven: Driven) -> Track:
    """Return a course as a track; its motion may end beyond its curve, by rounding."""
    chords = Course.chords_of(driven.curve)
    length = min(driven.timeline.length, float(chords.s[-1]))
    return Track(SpeedLimits(length, 1.0, math.inf, ()), chords, _CELL)
