"""Which robot gets its next course when, and what that does to the fleet.

A course for an order is looked for (searches.py), and put into effect if it is found (`commit`).
It counts only if no authority told since breaks it, and it is proven among the courses committed
since, too; otherwise it is looked for again.

Decides: when a robot's next course is looked for.  Must not know: how courses are found, which
robot gets which order, what is refused without a search (refusals.py), links, files.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any, Final

import msgspec
import numpy as np
from msgspec.structs import replace
from scipy.spatial.distance import cdist

from coordinator.curves.nurbs import Array
from coordinator.fleet.core import Fleet
from coordinator.fleet.events import Incident
from coordinator.fleet.log_records import CourseRequest
from coordinator.fleet.orders import Flags
from coordinator.fleet.task import Task
from coordinator.mission.free_robots import FreeRobots
from coordinator.mission.making_room import MakingRoom, Tried
from coordinator.mission.obstructions import Obstructions, PlainObstructions
from coordinator.mission.refusals import Refusals
from coordinator.mission.searches import Asked, Searches
from coordinator.plan.wire import address
from coordinator.planning.course_proposal import among_further
from coordinator.planning.course_search import Answer
from coordinator.planning.wish import Site
from coordinator.scenario import plain
from coordinator.scenario.model import Robot
from protocol.messages import REFUSED, UNDER_WAY, WAITING
from protocol.phases import GO, MOVING
from protocol.timing import SECOND

_AGAIN_MS: Final = 2_000
"""An order for which nothing was found is looked for again when the fleet has changed, or after
this."""

_LATE: Final = 4.0
"""A robot that is later than this [s] and holds others may get its times anew."""

_HELD_MS: Final = 1_000
"""Others have to be held for so long before."""

_OFTEN: Final = 3
_TURN_MS: Final = 20_000
"""Orders that were put back so often are looked at one at a time, each for so long."""

_RENEW_MS: Final = 15_000
"""A robot gets its times anew, or is looked at for that, no more often than after this."""

_JOIN_PATIENCE: Final = 60 * SECOND
"""How long a robot that joins has to be heard for the first time."""


class PlainDispatcher(msgspec.Struct, frozen=True):
    """A Dispatcher as plain data; `ways`: by order, a radius [m] and the bytes of a path [m]."""

    robots: list[dict[str, Any]]
    serial: int
    moved_ms: int
    mark: tuple[int, int]
    ways: dict[str, tuple[float, bytes]]
    obstructions: PlainObstructions


class Dispatcher:
    """The orders of one fleet on their way to courses; `robots`: the scenario's."""

    def __init__(self, fleet: Fleet, robots: Iterable[Robot]) -> None:
        self._fleet = fleet
        self.robots = {robot.id: robot for robot in robots}
        """All robots of the fleet by name, as the scenario and operators give them.

        Goals and places to pass are those of their newest courses, but for making room."""

        self.obstructions = Obstructions(fleet, self.robots, self._may_leave)
        self.searches = Searches(fleet, self.robots, self.obstructions)
        self._rooms = MakingRoom(fleet, self.robots, self.searches)
        self._free = FreeRobots(fleet, self.robots, self.searches)
        self._refusals = Refusals(
            fleet, self.robots, self.obstructions, self.searches, self._free.what_stops
        )
        self._tried: dict[str, tuple[Tried, int]] = {}
        """By order: the state of the fleet and the time [ms] when nothing was found for it."""
        self._renewed: dict[str, int] = {}
        """By late robot: when [ms] new times were last looked for."""

    def plain(self) -> PlainDispatcher:
        """Give up all searches, and return the state as plain data.

        What was looked for is looked for again, here and by whoever goes on from this state.
        """
        self.searches.give_up()
        moved_ms, mark = self._refusals.plain()
        self.searches.begin()
        self._tried.clear()
        self._renewed.clear()
        return PlainDispatcher(
            [plain.plain(robot) for robot in self.robots.values()],
            self.searches.serial,
            moved_ms,
            mark,
            self._rooms.plain(),
            self.obstructions.plain(),
        )

    def take_plain(self, told: PlainDispatcher) -> None:
        """Take over another dispatcher's state; raise TypeError if a robot cannot be read."""
        known = [plain.robot_of(fields) for fields in told.robots]
        self.robots.clear()  # The obstructions know the same table.
        self.robots.update((robot.id, robot) for robot in known)
        self.searches.serial = told.serial
        self._refusals.take_plain(told.moved_ms, told.mark)
        self._rooms.take_plain(told.ways)
        self.obstructions.take_plain(told.obstructions)

    def begin(self, make_site: Callable[[], Site] | None) -> None:
        """Begin an epoch: earlier requests are void, and nothing was tried yet.

        `make_site` prepares its floor when the first order needs it; None if nobody can drive.
        """
        self.searches.begin()
        self.obstructions.begin(make_site)
        self._tried.clear()
        self._renewed.clear()

    def look(self, now_ns: int) -> list[CourseRequest]:
        """Let orders become known and done, and return the courses that are to be looked for."""
        fleet, book = self._fleet, self._fleet.orders
        if not fleet.has_gone:
            return []
        now_ms = fleet.since_go_ms(now_ns)
        book.look(now_ms, self._has_driven, self._are_free)
        if fleet.phase != GO or not self.obstructions.has_site or fleet.superseded:
            self._refusals.nobody_may_drive(now_ms)
            return []
        self.obstructions.look(now_ns, now_ms)
        self._refusals.look(now_ns, now_ms)
        idle = self._free.idle(now_ns)
        asked = self.searches.orders()
        state = Tried(self.searches.commits, tuple(idle))
        tasks = [
            task
            for task in book.waiting()
            if task.order.id not in asked and self._is_due(task, state, now_ms)
        ]
        tasks = self._in_turn(tasks, asked, now_ms)
        self._free.say_who_is_busy(idle, self._tried, now_ns)
        joins = [task for task in tasks if task.joins is not None]
        tasks = [task for task in tasks if task.joins is None]
        found = [self._ask_join(task, task.joins, now_ns) for task in joins if task.joins]
        free = [*idle, *self._free.arriving(now_ns)] if tasks else idle
        for task, robot in self._free.assigned(tasks, free, now_ns):
            found.append(self._ask(task, robot, now_ns, follows=robot not in idle))
        found += (  # One by one: once a robot is asked for, it leaves for no other order.
            self._ask(task, task.robot, now_ns, leaves=True)
            for task in tasks
            if task.is_urgent and self._leaves_for(task, now_ns)
        )
        return found + self._renewals(now_ns, now_ms)

    def _in_turn(self, tasks: list[Task], asked: set[str], now_ms: int) -> list[Task]:
        """Return the orders to look at: of those that were put back often, only one at a time.

        Robots that are sent around each other all at once may stand in each other's way for ever.
        """
        book, members = self._fleet.orders, self._fleet.members
        often = [one for one in tasks if one.put_back >= _OFTEN]
        if not often:
            return tasks
        going = [one for one in book.under_way() if now_ms - (one.accepted_ms or 0) < _TURN_MS]
        going += [book.tasks[name] for name in asked if name in book.tasks]
        if any(one.put_back >= _OFTEN and one.arrived_ms is None for one in going):
            turn = None
        else:
            lost = {member.id for member in members.values() if member.lost}
            able = [one for one in often if one.robot not in lost]
            turn = min(able, key=lambda one: one.put_back, default=None)
        return [one for one in tasks if one.put_back < _OFTEN or one is turn]

    def _renewals(self, now_ns: int, now_ms: int) -> list[CourseRequest]:
        """Look for courses with new times for robots that are late for long and hold others."""
        grants, plan_ms = self._fleet.grants, self._fleet.times.plan_ms(now_ns)
        held, late, found = grants.standstills.held(), grants.late(plan_ms), []
        holders = {one.by for one in held if plan_ms - one.since_ms >= _HELD_MS}
        for name in sorted(holders - {one.robot for one in held}):
            task = self._fleet.orders.of_robot(name)
            if task is None or task.makes_room or task.order.via or late.get(name, 0.0) < _LATE:
                continue
            is_due = now_ms - self._renewed.get(name, -_RENEW_MS) >= _RENEW_MS
            if not (is_due and grants.gets_on(name, plan_ms) and self._can_leave(name, now_ns)):
                continue
            until = self.searches.worth_until(name, now_ns)
            if until > 0.0:
                self._renewed[name] = now_ms
                found.append(self.searches.ask(task, name, None, now_ns, leaves=True, until=until))
        return found

    def _has_driven(self, robot: str, revision: int) -> bool:
        return self._fleet.members[robot].has_driven(self._fleet.epoch, revision)

    def _leaves_for(self, task: Task, now_ns: int) -> bool:
        """Return whether a robot is to leave its course for an urgent order now."""
        mine = self._fleet.grants.of(task.robot)
        if mine is None:
            return False
        if mine.now.revision < task.leaves and not self._fleet.grants.is_over(task.robot):
            return False  # It has yet to begin the course that it is to leave.
        return self._can_leave(task.robot, now_ns)

    def _can_leave(self, robot: str, now_ns: int) -> bool:
        """Return whether a robot may leave its course, and it is known where at the latest."""
        at_rest = self.obstructions.rest_of(robot) is not None
        is_known = at_rest or self._fleet.grants.ends.is_end_known(robot)
        return is_known and self._may_leave(robot, now_ns)

    def _may_leave(self, robot: str, now_ns: int) -> bool:
        """Return whether a robot drives, and has not been sent elsewhere already."""
        member, mine = self._fleet.members.get(robot), self._fleet.grants.of(robot)
        if member is None or mine is None or mine.now.course is None:
            return False
        is_asked = self.searches.has(robot)
        if self.obstructions.rest_of(robot) is not None:
            can_change = member.is_fit and (mine.next is None or mine.next.is_withdrawn)
        else:
            drives = member.phase == MOVING and member.driven >= member.revision
            can_change = drives and not mine.is_changing(member.holds)
        return can_change and not is_asked and member.is_heard(now_ns)

    def commit(self, request: CourseRequest, answer: Answer, now_ns: int) -> Robot | None:
        """Put an answer into effect; return the robot with its new goal if it gets a course."""
        asked = self.searches.take(request)
        if asked is None or request.robot not in self._fleet.members:  # It has left.
            return None
        robot = self._commit(request, asked, answer, now_ns)
        if robot is None and asked.leaves:
            self._fleet.grants.ends.go_on(request.robot)
        if robot is not None and asked.ways is None:
            wanted = asked.wish.robot if answer.reason else robot  # It rests, and is to go on.
            known = self.robots[request.robot]
            self.robots[request.robot] = replace(known, goal=wanted.goal, via=wanted.via)
        return robot

    def _commit(
        self, request: CourseRequest, asked: Asked, answer: Answer, now_ns: int
    ) -> Robot | None:
        fleet = self._fleet
        task, idle = fleet.orders.tasks[request.order], self._free.idle(now_ns)
        can_go = self._can_go(request, asked, task, idle, now_ns)
        renews = asked.until < math.inf
        does = fleet.orders.of_robot(request.robot)
        is_wanted = task is does if renews else task.state == WAITING
        if not is_wanted or fleet.phase != GO or not can_go:
            return None
        now_ms = fleet.since_go_ms(now_ns)
        proposal = answer.proposal
        if renews and (proposal is None or proposal.course.driven.timeline.finish > asked.until):
            return None
        if proposal is None:
            self._not_found(task, asked, answer, idle, now_ns)
            return None
        since = self.searches.committed_since(asked)
        proposal = among_further(proposal, since, asked.site.terms)
        if proposal is None or fleet.grants.was_given_up(proposal.near):
            return None  # It is looked for again, around who was given up meanwhile.
        if not self.obstructions.take_course(request.robot, request.revision, asked.closed):
            return None
        if not fleet.grants.commit(
            request.number, proposal.course, proposal.near, proposal.staircases
        ):
            self._tried[task.order.id] = (Tried(self.searches.commits, tuple(idle)), now_ms)
            return None
        self.searches.note_commit(proposal.course)
        plan = address(proposal.message, fleet.boot)
        member = fleet.members[request.robot]
        if answer.reason:  # It has no way, and rests where it is.
            member.take_course(plan, request.revision, now_ns)
            task.is_urgent = False
            self._not_found(task, asked, answer, idle, now_ns)
            return replace(asked.wish.robot, goal=proposal.course.goal)
        if asked.leaves:
            fleet.orders.put_back(request.robot)
        self._rooms.end(task)
        if task.makes_room:
            task.order = replace(task.order, goal=proposal.course.goal)
            text = f"{request.robot} {task.reason or task.purpose}"
            fleet.incidents.append(Incident(now_ns, "order", request.robot, text))
        elif renews:
            text = f"{request.robot} gets new times for {task.order.id}: others go first"
            fleet.incidents.append(Incident(now_ns, "order", request.robot, text))
        task.state, task.robot, task.reason = UNDER_WAY, request.robot, ""
        task.revision = request.revision
        task.is_urgent = False  # Otherwise two such orders would take turns for ever.
        task.accepted_ms = now_ms
        task.alone_ms = round(1000.0 * answer.alone)
        finish_ms = round(1000.0 * proposal.course.driven.timeline.finish)
        task.planned_arrival_ms = finish_ms - fleet.times.plan_ms(now_ns) + now_ms
        if task.joins is not None:
            self.robots[request.robot] = task.joins
            member.take_part(plan, task.joins.max_speed, fleet.epoch)
            fleet.outside_ns.pop(request.robot, None)
            member.await_start(now_ns + _JOIN_PATIENCE)
        member.take_course(plan, request.revision, now_ns)
        return replace(asked.wish.robot, goal=task.order.goal)

    def _can_go(
        self, request: CourseRequest, asked: Asked, task: Task, idle: list[str], now_ns: int
    ) -> bool:
        """Return whether a robot can still join, or go on to a course from the one that it had."""
        if task.joins is not None:  # That may have been taken back, and asked for elsewhere.
            return task.joins == asked.wish.robot
        fleet, robot = self._fleet, request.robot
        member, mine = fleet.members[robot], fleet.grants.of(robot)
        if member.is_out_of_reach:
            return False  # It would not be sent the course.
        if mine is None or mine.newest.revision != request.revision - 1:
            return False
        if mine.newest.number > request.number:
            return False  # It has left the fleet meanwhile, and joined again.
        if asked.leaves:  # One that has stopped meanwhile goes on from where it then rests.
            return member.has_stopped(fleet.epoch) == asked.has_stopped
        return robot in idle or (asked.follows and robot in self._free.arriving(now_ns))

    def _not_found(
        self, task: Task, asked: Asked, answer: Answer, idle: list[str], now_ns: int
    ) -> None:
        """Refuse an order for ever, or let it wait; let idle robots make room for it.

        A robot that waits for one that cannot go on, and finds no way, cannot go on either: others
        go around it, and wait for it no longer.
        """
        fleet, robot = self._fleet, asked.wish.robot.id
        book, now_ms = fleet.orders, fleet.since_go_ms(now_ns)
        if asked.waits_for and answer.proposal is None:
            why = f", which waits for {asked.waits_for} and has no other way"
            fleet.go_around(fleet.members[robot], now_ns, why)
        if task.joins is not None:
            rest = "rest" if len(answer.blockers) > 1 else "rests"
            near = f"{', '.join(answer.blockers)} {rest} too near" if answer.blockers else ""
            book.end(task, REFUSED, f"{robot} cannot stand there: {near or answer.reason}")
            self._fleet.members.pop(robot, None)
            book.forget(robot)
            return
        state = Tried(self.searches.commits, tuple(idle))
        if task.makes_room:
            self._rooms.finds_no_place(robot, state)
        is_closed = math.isinf(answer.alone) and self._refusals.is_for_nobody_else(task, robot)
        # One who closes its way may go on again.
        is_closed &= not (task.order.robot and asked.goes_around)
        if task.makes_room or is_closed:
            book.end(task, REFUSED, f"{robot} {answer.reason}")
            self._rooms.end(task)
            if asked.leaves and task.revision > 0 and book.of_robot(robot) is None:
                book.leave(task, robot, now_ms)  # Its course still leads there.
            return
        self._tried[task.order.id] = (state, now_ms)
        by = ", ".join(dict.fromkeys(answer.blockers))
        if not asked.follows:  # Until it has arrived, its order waits for that.
            task.reason = f"waits for {by}" if by else f"{robot} {answer.reason}"
        if not task.order.robot:
            task.robot = ""
        self._rooms.let_make_room(task, asked, answer, state, self._tried, now_ns)

    def _ask(
        self, task: Task, robot: str, now_ns: int, *, leaves: bool = False, follows: bool = False
    ) -> CourseRequest:
        way = self._rooms.way_of(task)
        return self.searches.ask(task, robot, way, now_ns, leaves=leaves, follows=follows)

    def _ask_join(self, task: Task, robot: Robot, now_ns: int) -> CourseRequest:
        self.robots[robot.id] = robot
        return self.searches.ask_join(task, robot, now_ns)

    def _is_due(self, task: Task, state: Tried, now_ms: int) -> bool:
        tried = self._tried.get(task.order.id)
        return tried is None or tried[0] != state or now_ms - tried[1] >= _AGAIN_MS

    def _are_free(self, robot: str, places: Array) -> Flags:
        """Tell at which places (n, 2) a robot could rest: no other is or is bound there (n,)."""
        site, courses = self.obstructions.site, self._fleet.grants.possible()
        if site is None:
            return np.zeros(len(places), np.bool_)
        goals = np.array([one.goal for one in courses]).reshape(-1, 2)
        room = self.robots[robot].radius + site.terms.margin
        needs = room + np.array([one.driven.radius for one in courses])
        return np.asarray((cdist(places, goals) >= needs).all(axis=1))
