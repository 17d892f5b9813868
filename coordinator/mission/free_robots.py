"""Which robots are free for orders, or will be in a moment, and which of them gets which order.

Decides: who counts as free, what people are told of those that are not, who does an order for which
no robot is named.  Must not know: how courses are found, when an order is refused.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterator, Mapping
from typing import Final

import numpy as np
from scipy.optimize import linear_sum_assignment

from coordinator.fleet.core import Fleet
from coordinator.fleet.task import Task
from coordinator.mission.searches import Searches
from coordinator.scenario.model import Robot
from protocol.phases import MOVING, fault_name

_NEVER: Final = 1e12
"""How long [s] a robot takes to a goal that it cannot drive to."""


class FreeRobots:
    """The robots of one fleet, by name in `robots`, that may get courses by these searches."""

    def __init__(self, fleet: Fleet, robots: Mapping[str, Robot], searches: Searches) -> None:
        self._fleet, self._robots, self._searches = fleet, robots, searches

    def idle(self, now_ns: int) -> list[str]:
        """Return the robots that rest at their goals and have nothing to do."""
        fleet = self._fleet
        busy = {one.robot for one in fleet.orders.under_way()}
        return [
            member.id
            for member in fleet.members.planned
            if member.has_arrived
            and member.id not in busy
            and member.is_heard(now_ns)
            and (mine := fleet.grants.of(member.id)) is not None
            and not mine.is_changing(member.holds)
        ]

    def arriving(self, now_ns: int) -> list[str]:
        """Return the robots that will be idle in a moment: nothing holds them up any more."""
        fleet = self._fleet
        stay = {one.robot for one in fleet.orders.under_way() if one.order.dwell > 0.0}
        stay |= {one.robot for one in fleet.orders.waiting() if one.is_urgent}
        return [
            member.id
            for member in fleet.members.planned
            if member.phase == MOVING
            and member.epoch == fleet.epoch
            and member.driven == member.revision
            and member.id not in stay
            and not member.lost
            and member.is_heard(now_ns)
            and (mine := fleet.grants.of(member.id)) is not None
            and mine.next is None
            and self._searches.is_time_for(member.id, now_ns)
        ]

    def what_stops(self, robot: str, now_ns: int) -> str:
        """Return in words why a robot can be sent nowhere; "" if it can."""
        member = self._fleet.members[robot]
        if member.has_come_back(now_ns):
            return "is back and waits to be admitted"
        if member.lost:
            return "is lost"
        if not member.is_heard(now_ns):
            return "is not heard"
        if member.has_stopped(self._fleet.epoch):
            return f"has stopped: {fault_name(member.fault)}"
        if member.came_back_to is not None:
            return "is back and waits for a course from where it stands"
        return "" if member.planned else "has no part in this epoch"

    def say_who_is_busy(self, idle: list[str], tried: Container[str], now_ns: int) -> None:
        """State why orders wait for their robots.

        `tried`: orders for which no course was found; it was said then why not.
        """
        book = self._fleet.orders
        members = self._fleet.members
        under_way = [one for one in reversed(book.under_way()) if not members[one.robot].lost]
        does = {one.robot: one.order.id for one in under_way}
        for task in book.waiting():
            robot = task.order.robot
            if task.makes_room or task.joins is not None:
                continue
            if robot in does:
                task.reason = f"{robot} does {does[robot]} first"
            elif robot and robot not in idle:
                stops, member = self.what_stops(robot, now_ns), members[robot]
                may_go_on = member.is_fit and not member.lost and member.is_heard(now_ns)
                if task.order.id not in tried or (stops and not may_go_on):
                    task.reason = f"{robot} {stops or 'has not arrived yet'}"
            elif not robot and not idle:
                task.reason = "no robot is free"

    def assigned(self, tasks: list[Task], ready: list[str], now_ns: int) -> list[tuple[Task, str]]:
        """Return which orders robots get that are idle, or will be soon.

        First those of the highest priority; of equal ones those that name their robots, then
        others, for which no robot is taken that a waiting order of this priority names.
        """
        free = {name: None for name in ready if not self._searches.has(name)}
        wanted: dict[str, float] = {}
        for one in self._fleet.orders.waiting():
            robot = one.order.robot
            wanted[robot] = max(wanted.get(robot, -math.inf), _priority(one))
        pairs = []
        for priority in sorted(set(map(_priority, tasks)), reverse=True):
            equal = [task for task in tasks if _priority(task) == priority]
            for task in equal:
                if task.order.robot in free:
                    del free[task.order.robot]
                    pairs.append((task, task.order.robot))
            names = [name for name in free if wanted.get(name, -math.inf) < priority]
            others = [task for task in equal if not task.order.robot]
            for task, robot in self._soonest(others, names, now_ns):
                del free[robot]
                pairs.append((task, robot))
        return pairs

    def _soonest(
        self, tasks: list[Task], names: list[str], now_ns: int
    ) -> Iterator[tuple[Task, str]]:
        """Yield orders with the robots that do them soonest in total."""
        if not (tasks and names):
            return
        cost = np.array([[self._time_to(name, task, now_ns) for name in names] for task in tasks])
        for row, column in zip(*linear_sum_assignment(cost), strict=True):
            if cost[row, column] < _NEVER:
                yield tasks[row], names[column]

    def _time_to(self, robot: str, task: Task, now_ns: int) -> float:
        """Return how long [s] a robot would take straight to an order's goal; _NEVER: it cannot.

        It sets out when it has arrived at its own.
        """
        if robot in task.cannot:
            return _NEVER
        place, _ = self._searches.place(robot)
        now_ms = self._fleet.times.plan_ms(now_ns)
        left_ms = max((self._fleet.grants.arrival_ms(robot, now_ms) or now_ms) - now_ms, 0)
        far = math.dist(place, task.order.goal[:2])
        return 0.001 * left_ms + far / self._robots[robot].max_speed


def _priority(task: Task) -> float:
    """Return the priority of an order; robots that make room go before all others."""
    return math.inf if task.makes_room else task.order.priority
