"""Idle robots that make room for an order, and how often they do.

Decides: who of those in an order's way makes room for it, and when that is given up.  Must not
know: how courses are found, which robot gets which order.
"""

from __future__ import annotations

from collections.abc import Container, Mapping
from typing import Final, NamedTuple

import numpy as np

from coordinator.curves.nurbs import Array
from coordinator.fleet.core import Fleet
from coordinator.fleet.task import Task
from coordinator.mission.searches import Asked, Searches
from coordinator.planning.course_search import Answer
from coordinator.scenario.model import Robot
from protocol.messages import REFUSED

_MOST_ROOMS: Final = 20
"""Robots that have made room for an order so often take turns in its way, maybe for ever."""

_MOST_TURNS: Final = 10
"""Robots that go back, and of which so many made room for each other, would do so for ever."""


class Tried(NamedTuple):
    """What decides whether a search that found nothing may find something now.

    `commits`: how many courses were committed; `idle`: the robots that have nothing to do.
    """

    commits: int
    idle: tuple[str, ...]


class MakingRoom:
    """The robots of one fleet that make room; `robots`: all its robots by name."""

    def __init__(self, fleet: Fleet, robots: Mapping[str, Robot], searches: Searches) -> None:
        self._fleet, self._robots, self._searches = fleet, robots, searches
        self._ways: dict[str, tuple[float, Array]] = {}
        """By order that makes room: the radius and path of the robot that needs it."""
        self._nowhere: dict[str, Tried] = {}
        """By robot: the state of the fleet when no place was found for it to make room at."""

    def plain(self) -> dict[str, tuple[float, bytes]]:
        """Return the ways as plain data, and forget who found no place."""
        self._nowhere.clear()
        return {name: (radius, way.tobytes()) for name, (radius, way) in self._ways.items()}

    def take_plain(self, told: Mapping[str, tuple[float, bytes]]) -> None:
        """Take over another one's ways."""
        self._ways = {
            name: (radius, np.frombuffer(way).reshape(-1, 2).copy())
            for name, (radius, way) in told.items()
        }

    def way_of(self, task: Task) -> tuple[float, Array] | None:
        """Return the radius and path [m] of the robot for which an order makes room."""
        return self._ways.get(task.order.id)

    def end(self, task: Task) -> None:
        """Take in that an order that may have made room is over, or its robot is on its way."""
        self._ways.pop(task.order.id, None)

    def finds_no_place(self, robot: str, state: Tried) -> None:
        """Take in that no place was found for a robot to make room at."""
        self._nowhere[robot] = state

    def let_make_room(
        self,
        task: Task,
        asked: Asked,
        answer: Answer,
        state: Tried,
        tried: Container[str],
        now_ns: int,
    ) -> None:
        """Let the idle robots among those in an order's way make room for it.

        `tried`: the orders for which nothing was found.  Robots that go back do not make room for
        each other for ever: then the fleet is planned anew.
        """
        fleet, book, robot = self._fleet, self._fleet.orders, asked.wish.robot
        if task.is_return and task.rooms >= _MOST_TURNS:
            fleet.plan_anew("robots make room for each other again and again", now_ns)
            return
        if task.rooms >= _MOST_ROOMS:
            by = ", ".join(dict.fromkeys(answer.blockers)) or "somebody"
            why = f"others made room {task.rooms} times, and {by} is in the way again"
            book.end(task, REFUSED, f"{robot.id} has no way: {why}")
            return
        waiting = {one.robot for one in book.waiting() if one.makes_room}
        for name in filter(fleet.members.__contains__, answer.blockers):  # Others left meanwhile.
            if fleet.members[name].lost:
                fleet.grants.keep_from(robot.id, name)
            own = [one for one in book.waiting() if one.robot == name]
            is_idle = name in state.idle and name not in waiting
            is_idle &= self._nowhere.get(name) != state
            if is_idle and answer.way is not None and all(o.order.id in tried for o in own):
                place, now_ms = self._searches.place(name)[0], fleet.since_go_ms(now_ns)
                room = book.room_for(name, place, task.order.id, now_ms)
                room.returns_to = None if book.is_used else self._robots[name].goal
                self._ways[room.order.id] = (robot.radius, answer.way)
                task.rooms += 1
                room.rooms = task.rooms if task.is_return else 0
