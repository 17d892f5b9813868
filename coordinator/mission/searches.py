"""The courses that are looked for now: from what each is searched, and what came in between.

A course that was found counts only if no course committed since it was asked for comes near it.

Decides: where and when a robot's next course begins, and among which courses it is looked for.
Must not know: which robot does which order, how courses are found.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
from msgspec.structs import replace

from coordinator.curves.nurbs import Array
from coordinator.fleet.core import Fleet
from coordinator.fleet.log_records import CourseRequest, Found
from coordinator.fleet.task import Task
from coordinator.mission.obstructions import Obstructions, Ring
from coordinator.plan.course import Course
from coordinator.planning.course_proposal import proposal_of
from coordinator.planning.course_search import (
    Answer,
    make_room,
    rest,
    search,
    search_or_rest,
    stand,
)
from coordinator.planning.leading_off import UnderWay
from coordinator.planning.wish import Site, Wish
from coordinator.scenario.model import Point, Pose, Robot
from coordinator.scenario.order_checks import OWN

_LEAD_MS: Final = 300
"""How long before a course begins it is asked for: enough to find it and to tell the robot."""

_TICK_MS: Final = 100
"""How often it is looked whether it is time to ask."""

_HELD_MS: Final = 500
"""A robot that was told less than the headroom by more than this [ms] is held, or late."""

_GRID_MS: Final = 10
"""Courses part at multiples of this [ms]; shared_course.py compares them there."""

_SETTLES: Final = 0.3
"""A robot that has braked settles in this time [s]."""

_MOST_LOST: Final = 4.0
"""A late robot that lets others go first may lose so much [s]: it has to stop, and set out anew."""

_WORTH: Final = 1.0
"""So much more [s] than it loses the others have to win together."""

_SAME: Final = 0.01
"""Places nearer to each other than this [m] are one place."""


@dataclass(frozen=True, eq=False)
class Asked:
    """What a request is answered from."""

    site: Site
    wish: Wish
    others: tuple[Course, ...]
    ways: tuple[tuple[float, Array], ...] | None
    """Radii and paths of the robots that need room; None if the robot goes where it is wanted."""

    commits: int
    closed: dict[str, Ring]
    leaves: bool
    """Whether the robot leaves its course for this one, instead of driving to its goal."""

    has_stopped: bool
    """Whether the robot had given up its timetable; if that changes, it does not count."""

    follows: bool
    """Whether the robot had not arrived at its goal yet, where this course begins."""

    until: float
    """The plan time [s] by which the course has to arrive, for it to be worth while."""

    waits_for: str = ""
    """Whom the robot waits for, who cannot go on before it has left its course: if nothing is
    found, it rests where it is."""

    goes_around: bool = False
    """Whether others that may go on again were solid for it."""

    stays: bool = False
    """Whether the robot first rests where it is: then it is known that it stands there."""


class Searches:
    """The searches of one fleet; `robots`: all its robots by name."""

    def __init__(
        self, fleet: Fleet, robots: Mapping[str, Robot], obstructions: Obstructions
    ) -> None:
        self._fleet, self._robots, self._obstructions = fleet, robots, obstructions
        self.serial = 0
        """How many searches there have been."""
        self.commits = 0
        """How many courses were committed since the epoch began, or a state was taken over."""
        self._asked: dict[CourseRequest, Asked] = {}
        self._committed: deque[tuple[int, Course]] = deque()
        """The courses that were committed since something that is looked for now was asked."""

    def begin(self) -> None:
        """Begin an epoch: all searches are void."""
        self._asked.clear()
        self._committed.clear()
        self.commits = 0

    def give_up(self) -> None:
        """Take in that the answers to all searches are lost, with the coordinator that asked."""
        for request in list(self._asked):
            asked = self.take(request)
            if asked is not None and asked.leaves:
                self._fleet.grants.ends.go_on(request.robot)

    def has(self, robot: str) -> bool:
        """Return whether a course is looked for for a robot."""
        return any(one.robot == robot for one in self._asked)

    def orders(self) -> set[str]:
        """Return the orders for which a course is looked for."""
        return {one.order for one in self._asked}

    def take(self, request: CourseRequest) -> Asked | None:
        """End a search, and return what it was answered from; None if it had been given up."""
        asked = self._asked.pop(request, None)
        if asked is not None:
            self._fleet.grants.release(request.number)
        return asked

    def committed_since(self, asked: Asked) -> list[Course]:
        """Return the courses that were committed since a search was asked for."""
        return [one for commits, one in self._committed if commits >= asked.commits]

    def note_commit(self, course: Course) -> None:
        """Take in that a course counts from now on."""
        self._committed.append((self.commits, course))
        self.commits += 1
        oldest = min((one.commits for one in self._asked.values()), default=self.commits)
        while self._committed and self._committed[0][0] < oldest:
            self._committed.popleft()

    def search_for(self, request: CourseRequest) -> Callable[[], Answer]:
        """Return the search for a course; it is pure, and may take long."""
        asked = self._asked[request]
        if request.revision == 0:
            return partial(stand, asked.site, asked.wish, asked.others)
        if asked.ways is None:
            look = rest if asked.stays else search_or_rest if asked.waits_for else search
            return partial(look, asked.site, asked.wish, asked.others)
        closed = tuple(asked.closed.values())
        return partial(make_room, asked.site, asked.wish, asked.others, asked.ways, closed)

    def recorded(self, request: CourseRequest, found: Found) -> Answer:
        """Return the answer to a request that a log holds; its course is not proven again.

        Raises ValueError if a robot would refuse the course.
        """
        asked, way, proposal = self._asked[request], None, None
        if found.message is not None:
            proposal = proposal_of(found.message, asked.site, asked.wish, asked.others)
        if found.way:
            way = np.frombuffer(found.way).reshape(-1, 2).copy()
        alone = math.inf if found.alone is None else found.alone
        return Answer(proposal, alone, found.reason, found.blockers, way)

    def ask(
        self,
        task: Task,
        robot: str,
        way: tuple[float, Array] | None,
        now_ns: int,
        *,
        leaves: bool = False,
        follows: bool = False,
        until: float = math.inf,
    ) -> CourseRequest:
        """Look for a robot's next course: from where it rests, or will rest, or can leave its own.

        `way`: the radius and path of the robot for which it makes room.
        """
        fleet = self._fleet
        mine = fleet.grants.of(robot)
        assert mine is not None
        self.serial += 1
        begin_ms = self._soon_ms(now_ns)
        now_ms = fleet.times.plan_ms(now_ns)
        delay, at_rest = 0.0, self._obstructions.rest_of(robot) if leaves else None
        stays = leaves and at_rest is None and fleet.grants.ends.may_have_more(robot)
        under_way = None
        if leaves and at_rest is None:
            under_way = None if stays else self._under_way(robot, now_ms)
            leave_ms = 0 if under_way is None else under_way.leave_ms
            soon_ms, begin_ms = begin_ms, fleet.grants.ends.halt(robot, leave_ms)
            behind = fleet.grants.late(now_ms).get(robot, 0.0)
            delay = max(behind + self._braking(robot), (soon_ms - begin_ms) / 1000.0)
        if follows:
            arrival_ms = fleet.grants.arrival_ms(robot, fleet.times.plan_ms(now_ns))
            assert arrival_ms is not None
            begin_ms = max(begin_ms, arrival_ms)
        number, revision = fleet.grants.reserve(), mine.newest.revision + 1
        request = CourseRequest(self.serial, task.order.id, robot, number, revision, begin_ms)
        if at_rest is not None:
            x, y, heading = self._obstructions.pose_of(robot, at_rest)
        else:
            (x, y), heading = self.place(robot, begin_ms if leaves else None)
        is_car = self._robots[robot].min_turn_radius > 0.0
        start: Pose = (x, y, heading) if is_car else (x, y)
        via = task.order.via
        if task.order.id.startswith(OWN):
            via = self._obstructions.passable(robot, via, now_ns)
        goal, via = _apart((x, y), via, task.order.goal)
        wanted = replace(self._robots[robot], start=start, goal=goal, via=via, path=None)
        others = [one for one in fleet.grants.possible() if one.driven.id != robot]
        late = fleet.grants.late(fleet.times.plan_ms(now_ns))
        site = self._obstructions.site_for(robot, (x, y))
        self._asked[request] = Asked(
            site,
            Wish(
                wanted,
                heading,
                number,
                revision,
                begin_ms,
                delay,
                late,
                under_way,
                fleet.members[robot].capacity,
            ),
            tuple(others),
            (() if way is None else (way,)) if task.makes_room else None,
            self.commits,
            self._obstructions.closed,
            leaves,
            fleet.members[robot].has_stopped(fleet.epoch),
            follows,
            until,
            waits_for=self._obstructions.held_up().get(robot, "") if leaves else "",
            goes_around=self._obstructions.goes_around(robot),
            stays=stays,
        )
        return request

    def _soon_ms(self, now_ns: int) -> int:
        """Return the plan time [ms] at which a course that is asked for now can begin.

        Not before 0: an authority of 0 has to grant nothing on it.
        """
        whole, fleet = self._obstructions.site, self._fleet
        tau_ms = 0 if whole is None else round(1000.0 * whole.terms.tau)
        wait_ms = max(fleet.grants.headroom_ms - tau_ms, 0)
        return max(fleet.times.plan_ms(now_ns) + _LEAD_MS + wait_ms, 0)

    def is_time_for(self, robot: str, now_ns: int) -> bool:
        """Return whether to look for the course that a robot drives after the one in force.

        It is not held up any more, and a later search would let it stand.  An earlier one would
        hold up others: until it begins its next course, it may be at the end of this one for ever.
        """
        arrival_ms = self._fleet.grants.arrival_ms(robot, self._fleet.times.plan_ms(now_ns))
        return arrival_ms is not None and arrival_ms <= self._soon_ms(now_ns) + _TICK_MS

    def worth_until(self, robot: str, now_ns: int) -> float:
        """Return by when [s] a late robot has to arrive on a new course, so that it is worth while.

        It then loses no more than _MOST_LOST, and less by _WORTH than what the robots that it holds
        win: those are free when it begins the new course, where its authority ends, instead of
        where they wait for it to be.  0 if that cannot be.
        """
        grants, now_ms = self._fleet.grants, self._fleet.times.plan_ms(now_ns)
        mine, late = grants.of(robot), grants.late(now_ms)
        assert mine is not None
        assert mine.now.course is not None
        free = 0.001 * grants.ends.told_ms(robot) + self._braking(robot) + 0.001 * _LEAD_MS
        won = sum(max(0.001 * need - free, 0.0) for need in grants.waited_for_ms(robot))
        if won < _WORTH:
            return 0.0
        arrives = mine.now.course.driven.timeline.finish + late.get(robot, 0.0)
        return arrives + min(won - _WORTH, _MOST_LOST)

    def _under_way(self, robot: str, now_ms: int) -> UnderWay | None:
        """Return how a robot can leave its course in motion; None if it has to stop.

        The new course begins when it is found and told.  It is the present one for the headroom
        that the robot then has: by when it has to brake, it has been heard to drive the new one.
        """
        grants = self._fleet.grants
        mine, told_ms = grants.of(robot), grants.ends.told_ms(robot)
        assert mine is not None
        begin_ms = max(now_ms + _LEAD_MS, 0)
        leave_ms = max(begin_ms + grants.headroom_ms, told_ms)
        leave_ms = -(-leave_ms // _GRID_MS) * _GRID_MS
        is_held = told_ms < now_ms + grants.headroom_ms - _HELD_MS or robot in grants.given_up
        at_once = math.isinf(self._robots[robot].max_accel)
        if mine.now.course is None or is_held or at_once or leave_ms > grants.ends.limit_of(robot):
            return None
        found = UnderWay(mine.now.course.driven, begin_ms, leave_ms)
        return found if found.is_possible() else None

    def _braking(self, robot: str) -> float:
        """Return how much later [s] a robot that leaves its course is where its authority ends.

        It brakes for that place, where its course may have it at full speed.
        """
        one = self._robots[robot]
        return one.max_speed / one.max_accel + _SETTLES

    def ask_join(self, task: Task, robot: Robot, now_ns: int) -> CourseRequest:
        """Ask for the first course of a robot that joins: to rest where it stands."""
        fleet = self._fleet
        self.serial += 1
        number, begin_ms = fleet.grants.reserve(), max(fleet.times.plan_ms(now_ns) + _LEAD_MS, 1)
        request = CourseRequest(self.serial, task.order.id, robot.id, number, 0, begin_ms)
        x, y, *heading = robot.start
        self._asked[request] = Asked(
            self._obstructions.site_for(robot.id, (x, y)),
            Wish(robot, heading[0] if heading else 0.0, number, 0, begin_ms),
            tuple(fleet.grants.possible()),
            None,
            self.commits,
            self._obstructions.closed,
            leaves=False,
            has_stopped=False,
            follows=False,
            until=math.inf,
        )
        return request

    def place(self, robot: str, at_ms: int | None = None) -> tuple[tuple[float, float], float]:
        """Return where a robot is at a plan time [m], by default at its goal, and its heading."""
        mine = self._fleet.grants.of(robot)
        assert mine is not None
        assert mine.now.course is not None
        driven = mine.now.course.driven
        curve = driven.curve
        if at_ms is None:
            u = float(curve.knots[-1])
        else:
            (u,) = curve.parameter_at([driven.timeline.s_at(at_ms / 1000.0)]).tolist()
        places, ahead = curve.derivatives([u], 1)
        x, y = places[0].tolist()
        return (x, y), math.atan2(ahead[0, 1], ahead[0, 0])


def found_of(answer: Answer) -> Found:
    """Return an answer as the log holds it; the way counts only where somebody rests in it."""
    return Found(
        None if answer.proposal is None else answer.proposal.message,
        answer.alone if math.isfinite(answer.alone) else None,
        answer.reason,
        answer.blockers,
        b"" if answer.way is None or not answer.blockers else answer.way.tobytes(),
    )


def _apart(start: Point, via: Iterable[Point], goal: Pose) -> tuple[Pose, tuple[Point, ...]]:
    """Return the goal and the places to pass, without those where the robot is already.

    A robot that is at its goal, and passes no place, stays where it is.
    """
    kept: list[Point] = []
    for place in via:
        if math.dist(place, kept[-1] if kept else start) >= _SAME:
            kept.append(place)
    while kept and math.dist(kept[-1], goal[:2]) < _SAME:
        kept.pop()
    if not kept and math.dist(start, goal[:2]) < _SAME:
        return start, ()
    return goal, tuple(kept)
