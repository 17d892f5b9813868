"""What an epoch's messages granted, its robots' further courses included.

A course that a robot was sent while the fleet drove is proven among the courses that the others
may have been driving then.

Decides: which courses a new one is proven against.  Must not know: files, the fleet core.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import shapely

from coordinator.curves.nurbs import Array
from coordinator.fleet.rest_places import standing_of
from coordinator.fleet.task import JOIN, LEAVE, robot_of
from coordinator.mission.replanning_input import resting_pose, stretch
from coordinator.plan.course import Course
from coordinator.plan.document import Limits, PlanDocument
from coordinator.plan.wire import PackedPlan, packed, unpack
from coordinator.proof.course_proof import course_failures, that_may_meet
from coordinator.proof.granted import Granted
from coordinator.proof.shared_course import shared_until
from coordinator.scenario.floor import Floor
from coordinator.scenario.margin import TOLERANCE
from coordinator.schedule.staircase_making import STANDOFF, staircases_among, with_staircases
from protocol.codec import encode
from protocol.messages import (
    CANCELLED,
    ORDER_DONE,
    REFUSED,
    UNDER_WAY,
    Command,
    Join,
    Message,
    OrderState,
    Plan,
    Report,
    Rest,
)
from protocol.phases import DONE, FREEZE, FROZEN, IDLE

_EVERYWHERE: Final = [(-1e6, -1e6), (1e6, -1e6), (1e6, 1e6), (-1e6, 1e6)]
"""The floor of a plan that does not hold one."""


class GrantedCourses(Granted):
    """What one epoch's Commands granted on all courses that robots were sent.

    `plan` has its staircases.  `prove`: whether courses are proven; otherwise only their staircases
    are found.  `courses`: how many courses robots were sent after their first ones.
    """

    def __init__(self, plan: PackedPlan, *, prove: bool = False) -> None:
        super().__init__(plan)
        self.courses = 0
        self._terms, self._prove = plan.document, prove
        self._ways = {one.id: [Course(one, 0.0)] for one in plan.driven}
        self._withdrawn: dict[str, list[Course]] = {}
        """By robot: courses that it had not begun when others were sent around it."""

        self._around: set[str] = set()
        """The robots that others go around: they are granted nothing more."""

        self._found: dict[str, tuple[int, frozenset[str]]] = {}
        self._coming: set[str] = set()
        """Robots that join and have a course, which is sent to them once they are heard."""
        """By robot: the revision of the course found last, and whom others went around then."""

        self.taken_out: set[str] = set()
        """Robots that have left the fleet in this epoch."""

        self._armed: set[str] = set()
        """Robots that have said that they hold a course, and so where they are."""

        self._end_of: dict[str, int] = {}
        """By robot that is at the end of a course while the fleet is frozen: its revision."""

        self._is_frozen = False

        self._rests: dict[str, Rest] = {}
        """By robot that has stopped: where, as it has said."""

        self._limits = {one.id: one.limits for one in plan.document.robots}
        self._radius = {one.id: one.radius for one in plan.driven}
        self._floor: Floor | None = None

    def take_plan(self, robot: str, plan: Plan) -> bool:
        """Take in a Plan; a course that is not known yet is proven and counts from then on."""
        if super().take_plan(robot, plan):
            return True
        self.courses += 1
        radius = self._radius[robot]
        try:
            course = Course(unpack(encode(plan), radius), 0.001 * plan.begin_ms)
        except ValueError as error:
            self.failures.append(f"{robot} was sent a course that it would refuse: {error}")
            return True
        others = [
            one
            for name, ways in self._ways.items()
            if name != robot
            for one in (ways[1:] if name in self._around else ways)
        ]
        before = self._ways.get(robot, [])
        old = before[-1].driven if before else None
        margin = self._terms.margin
        near = that_may_meet(course, others, margin + STANDOFF)
        staircases = staircases_among(course, near, self._terms)
        if self._prove:
            courses = [course, *near]
            limits = self._limits.get(robot) or Limits(max_speed=1e9)
            gap = self._gap().gap
            failures = course_failures(courses, staircases, margin, limits, gap, old)
            failures += self._that_stand_near(course)
            name = f"course {plan.revision} of {robot} in epoch {plan.epoch}"
            self.failures += [f"{name}: {failure}" for failure in failures]
        known = [(one.driven.id, one.driven.plan.revision) for one in near]
        shared = course.since if old is None else shared_until(old, course.driven)
        self.add_course(robot, plan, known, staircases, round(1000.0 * shared))
        self._ways[robot] = [before[-1], course] if before else [course.begun()]
        return True

    def take_report(self, robot: str, report: Report) -> bool:
        """Take in a robot's progress; a course that it has left counts no more.

        Return whether the report is newer than all before it of that process.
        """
        if not super().take_report(robot, report):
            return False
        if report.phase != IDLE:
            self._armed.add(robot)
        self._end_of.pop(robot, None)
        if self._is_frozen and report.phase == DONE:
            self._end_of[robot] = report.revision
        if report.phase != FROZEN:
            self._rests.pop(robot, None)
        elif report.rest is not None and report.rest.epoch == report.epoch:
            self._rests[robot] = report.rest
        ways = self._ways.get(robot, [])
        for one in self._withdrawn.get(robot, ()):
            if report.revision == one.driven.plan.revision:
                ways[:1] = [one.begun()]
        if len(ways) == 2 and report.revision >= ways[1].driven.plan.revision:
            ways[:] = [ways[1].begun()]
            self._withdrawn.pop(robot, None)
            self._around.discard(robot)
        if ways and report.phase == DONE and report.revision == ways[0].driven.plan.revision:
            ways[0] = ways[0].arrived(report.stamp_ms)
        return True

    def take_command(self, command: Command) -> None:
        """Take in what a Command grants; a robot sets out on no course while the fleet freezes."""
        super().take_command(command)
        self._is_frozen = command.phase == FREEZE

    def take_roster(self, message: Message | None) -> None:
        """Take in that a robot is taken into the fleet, or has left it."""
        if isinstance(message, Join):
            if message.robot not in self._ways:
                self.join(message.robot)
                self._radius.setdefault(message.robot, message.radius_m)
                self._limits.setdefault(message.robot, Limits.of(robot_of(message)))
        elif isinstance(message, OrderState):
            joins, leaves = (
                message.id.removeprefix(one) if message.id.startswith(one) else ""
                for one in (JOIN, LEAVE)
            )
            if joins and message.state == UNDER_WAY:
                self._coming.add(joins)
            has_course = joins in self._ways or joins in self._coming
            is_refused = message.state == REFUSED and not has_course  # Else it counts as lost.
            if leaves and message.state == ORDER_DONE:
                self._take_out(leaves)
            elif joins and (message.state == CANCELLED or is_refused):
                self._take_out(joins)

    def go_on_from(self, before: GrantedCourses | None) -> None:
        """Take in who was to join in the epoch before, and had no course there."""
        if before is None or before is self:
            return
        for robot in before.joining:
            self.join(robot)
            self._radius.setdefault(robot, before._radius[robot])
            self._limits.setdefault(robot, before._limits[robot])

    def _take_out(self, robot: str) -> None:
        """Take in that a robot has left the fleet; when it joins again, it may be another one."""
        self.leave(robot)
        self.taken_out.add(robot)
        self._ways.pop(robot, None)
        self._coming.discard(robot)
        self._around.discard(robot)
        self._withdrawn.pop(robot, None)
        self._rests.pop(robot, None)
        self._radius.pop(robot, None)
        self._limits.pop(robot, None)

    def take_search(self, robot: str, revision: int) -> None:
        """Take in that a course was found; its Plan may be sent later, when the robot is heard."""
        self._found[robot] = revision, frozenset(self._around)

    def go_around(self, robot: str) -> None:
        """Take in that others are sent around a robot, which is granted nothing more."""
        if robot in self._ways:
            self.end_grants(robot)
            self._around.add(robot)
            self._withdrawn.setdefault(robot, []).extend(self._ways[robot][1:])
            del self._ways[robot][1:]

    def _that_stand_near(self, course: Course) -> list[str]:
        """Return sentences on robots that a course comes too near.

        They are those that others went around when it was found.  It is enough to keep clear of
        either of the places where one stands by its progress and by its word.
        """
        mine, found = course.driven, []
        revision, around = self._found.get(mine.id, (-1, frozenset()))
        if revision != mine.plan.revision:
            around = frozenset(self._around)
        way = shapely.linestrings(mine.chain.points)
        for name in sorted(self._around & around):
            need = mine.radius + self._radius[name] + self._terms.margin
            where = [shapely.distance(way, one) for one in self._standing(name)]
            apart = float(max(where)) - mine.chain.bound
            if name != mine.id and apart < need - TOLERANCE:
                found.append(f"comes within {apart:.4f} m of where {name} may stand")
        return found

    def _standing(self, robot: str) -> list[shapely.Geometry]:
        """Return where a robot stands that others go around, by its progress and by its word.

        Its progress may be as far ahead of where it rests as its tolerance lets it; where that is
        farther off, it was pushed, and only its word counts.
        """
        ride, rest = self._ways[robot][0].driven, self._rests.get(robot)
        since, until = self.stretch_of(robot)
        passed = shapely.linestrings(stretch(ride, since / 1000.0, until / 1000.0))
        if rest is None or rest.revision != ride.plan.revision:
            return [passed]
        place = resting_pose(ride, standing_of(robot, rest), self._terms.margin)[:2]
        stands = shapely.linestrings([place, place])
        is_near = shapely.distance(passed, stands) <= ride.plan.track_mm / 1000.0
        return [passed, stands] if is_near else [stands]

    @property
    def document(self) -> PlanDocument:
        """The plan of the epoch."""
        return self._terms

    def may_stand(self) -> dict[str, tuple[shapely.Geometry, float]]:
        """Return by robot where its middle may be by the end of the epoch, and its radius [m].

        Robots that never held a course of this epoch are where they were before.
        """
        return {
            robot: (shapely.multipoints(np.concatenate(self._may_be(robot))), self._radius[robot])
            for robot in self._ways.keys() & self._armed
        }

    def _may_be(self, robot: str) -> list[Array]:
        rides = {one.driven.plan.revision: one.driven for one in self._ways[robot]}
        rest = self._rests.get(robot)
        if rest is not None and rest.revision in rides:
            where = standing_of(robot, rest)
            return [np.array([resting_pose(rides[rest.revision], where, self._terms.margin)[:2]])]
        ended = self._end_of.get(robot)
        return [
            stretch(rides[revision], min(since, until) / 1000.0, until / 1000.0)
            for revision, since, until in self.stretches(robot)
            if revision in rides and ended in (None, revision)
        ]

    def _gap(self) -> Floor:
        if self._floor is None:
            site = self._terms.workspace
            self._floor = Floor(site.boundary, site.obstacles) if site else Floor(_EVERYWHERE, [])
        return self._floor


def granted_of(document: PlanDocument) -> GrantedCourses:
    """Return what has been granted in a plan's epoch: nothing yet."""
    return GrantedCourses(with_staircases(packed(document)))
