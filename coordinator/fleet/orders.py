"""The orders of a fleet: which are known, who does them, what became of them.

Decides: when an order becomes known, when it is done, and which order comes next.  Must not know:
courses, messages, clocks; times are in ms since the first GO.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from random import Random
from typing import Any, Final

import msgspec
import numpy as np
import numpy.typing as npt
from msgspec.structs import replace
from scipy.spatial.distance import cdist

from coordinator.fleet.task import Task, task_of, task_over
from coordinator.scenario import plain
from coordinator.scenario.model import Demand, Order, Point, Pose
from coordinator.scenario.order_checks import OWN
from protocol.messages import (
    CANCELLED,
    ORDER_DONE,
    REFUSED,
    UNDER_WAY,
    WAITING,
    OrderState,
)

_, _, _ROOM, _WAY = OWN

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

_SAME: Final = 1e-3
"""Places no farther apart than this [m] are one."""

_FORGOTTEN: Final[Pose] = (math.nan, math.nan)
"""The goal of an order that was over before a checkpoint of an older version, which lacks it."""


class PlainBook(msgspec.Struct, frozen=True):
    """An OrderBook as plain data, for a checkpoint.

    `over`: orders of which nothing more becomes; `led_to`: the goals that they had, and the robots
    that they named.  `tasks`: the others.  `ended` are over, and it was not said yet.
    """

    over: list[OrderState]
    tasks: list[dict[str, Any]]
    stays: bool
    robots: list[str]
    later: list[dict[str, Any]]
    has_demand: bool
    given: dict[str, int]
    said: dict[str, OrderState]
    ended: list[str]
    made_room: int
    done: int
    led_to: dict[str, tuple[tuple[float, ...], str]] = {}


class OrderBook:
    """The orders of one fleet.

    `orders`: those that become known by themselves; `robots`: the fleet's.  `stays`: whether the
    fleet waits for further orders when all are done.
    """

    def __init__(
        self,
        orders: Sequence[Order] = (),
        demand: Demand | None = None,
        robots: Sequence[str] = (),
        *,
        stays: bool = False,
    ) -> None:
        self.tasks: dict[str, Task] = {}
        self.stays = stays
        self._robots = list(robots)
        self._later = {order.id: order for order in orders}
        self._demand = demand
        self._given = dict.fromkeys(robots, 0)
        self._open: dict[str, Task] = {}
        self._said: dict[str, OrderState] = {}
        self._ended: list[Task] = []
        self._made_room = 0
        self.done = 0
        """How many orders are over."""

    def plain(self) -> PlainBook:
        """Return the book as plain data."""
        return PlainBook(
            sorted(
                (task.message() for task in self.tasks.values() if task.is_over),
                key=lambda one: one.id,
            ),
            [
                {**msgspec.to_builtins(task), "cannot": sorted(task.cannot)}
                for task in self._open.values()
            ],
            self.stays,
            self._robots,
            [msgspec.to_builtins(order) for order in self._later.values()],
            self._demand is not None,
            self._given,
            self._said,
            [task.order.id for task in self._ended],
            self._made_room,
            self.done,
            {
                name: (task.order.goal, task.order.robot)
                for name, task in sorted(self.tasks.items())
                if task.is_over
            },
        )

    def take_plain(self, told: PlainBook) -> None:
        """Take over what another book of the same orders and demand knew.

        Raises KeyError or TypeError if it does not fit.
        """
        tasks = [task_of(fields) for fields in told.tasks]
        self._open = {task.order.id: task for task in tasks}
        over = [(one, *told.led_to.get(one.id, (_FORGOTTEN, ""))) for one in told.over]
        self.tasks = {one.id: task_over(one, plain.pose_of(goal), by) for one, goal, by in over}
        self.tasks |= self._open
        later = [plain.order_of(fields) for fields in told.later]
        self._later = {order.id: order for order in later}
        self._ended = [self.tasks[name] for name in told.ended]
        self._demand = self._demand if told.has_demand else None
        self.stays, self._robots, self._given = told.stays, told.robots, told.given
        self._said, self._made_room, self.done = told.said, told.made_room, told.done

    @property
    def is_used(self) -> bool:
        """Whether the fleet has orders beside the coordinator's own, had some, or may get some."""
        given = any(not name.startswith(OWN) for name in self.tasks)
        return given or self.stays or bool(self._later or self._demand)

    @property
    def is_open(self) -> bool:
        """Whether an order is not over, or one may become known by itself."""
        return bool(self._open or self._later) or self._wants_more()

    @property
    def is_open_or_stays(self) -> bool:
        """Whether the fleet is not to end yet, even if all robots rest."""
        return self.stays or self.is_open

    @property
    def is_quiet(self) -> bool:
        """Whether all known orders are over, and others will become known."""
        return not self._open and bool(self._later)

    def _wants_more(self) -> bool:
        demand = self._demand
        return demand is not None and any(
            count < demand.per_robot for count in self._given.values()
        )

    def know(self, robot: str) -> None:
        """Take in that there is a robot more."""
        if robot not in self._robots:
            self._robots.append(robot)

    def forget(self, robot: str) -> None:
        """Take in that there is a robot less; orders that name it are refused, others wait."""
        if robot in self._robots:
            self._robots.remove(robot)
        self._given.pop(robot, None)
        for task in self.all_of(robot):
            if task.joins is None:
                self.let_wait(task)
        for task in list(self._open.values()):
            if task.order.robot == robot:
                self.end(task, REFUSED, f"{robot} has left the fleet")
            elif task.robot == robot:
                task.robot = ""

    def give(self, order: Order, now_ms: int, *, makes_room: bool = False) -> Task:
        """Take in an order; the same id again is the same order."""
        known = self.tasks.get(order.id)
        if known is not None:
            return known
        task = Task(order, now_ms, order.robot, makes_room=makes_room)
        self.tasks[order.id] = self._open[order.id] = task
        if order.robot and order.robot not in self._robots:
            self.end(task, REFUSED, f"there is no robot {order.robot} in this fleet")
        return task

    def other(self, order: Order) -> Order | None:
        """Return the order that has this one's id, if it is known to have another goal or robot."""
        task = self.tasks.get(order.id)
        known = self._later.get(order.id) if task is None else task.order
        if known is None or math.isnan(known.goal[0]):
            return None
        return None if (known.goal, known.robot) == (order.goal, order.robot) else known

    def has(self, order_id: str) -> bool:
        """Return whether there is such an order, known or put off."""
        return order_id in self.tasks or order_id in self._later

    def put_off(self, order: Order, now_ms: int) -> OrderState | None:
        """Keep an order until it becomes known; return its state, None if it is known now."""
        if order.id in self.tasks or self._is_known(order, now_ms):
            return None
        if order.after and order.after not in self.tasks.keys() | self._later.keys():
            why = f"there is no order {order.after} to come after"
            return OrderState(order.id, REFUSED, order.robot, reason=why)
        known = self._later.setdefault(order.id, order)
        when = f"until {known.release:g} s after the first GO"
        why = f"waits for {known.after} to end" if known.after else f"waits {when}"
        return OrderState(known.id, WAITING, known.robot, reason=why)

    def go_around(
        self, robot: str, course: tuple[int, Pose, tuple[Point, ...]], what: str, now_ms: int
    ) -> None:
        """Let the order that a robot does, or is to do next, be looked for from where it is now.

        `course`: the revision of the course in force, where it leads, and the places that it has
        yet to pass on it.  A robot without an order gets one of the coordinator's own for these.
        """
        revision, goal, via = course
        task = self.of_robot(robot)
        does = task is not None
        self.put_back(robot)
        if task is None:
            task = next((one for one in self.waiting() if one.order.robot == robot), None)
        if task is None or task.is_over:
            self._made_room += 1
            order = Order(id=f"{_WAY}{self._made_room}", robot=robot, goal=goal, via=via)
            known = (one for one in reversed(self.tasks.values()) if one.order.robot == robot)
            before = next((one for one in known if one.order.id.startswith(_WAY)), None)
            task = self.give(order, now_ms)
            task.purpose = f"goes around {what}"
            if before is not None and before.state == REFUSED and before.order.goal == goal:
                task.rooms = before.rooms  # Or others would make room for the same way for ever.
        elif does or task.revision == revision > 0:
            task.order = replace(task.order, via=via)
        task.robot, task.is_urgent, task.reason = robot, True, f"goes around {what}"

    def _return(self, robot: str, goal: Pose, since_ms: int, rooms: int) -> None:
        """Let a robot that has made room go back, once nobody else has an order."""
        if not any(one.is_return and one.robot == robot for one in self._open.values()):
            self._made_room += 1
            order = Order(id=f"{_WAY}{self._made_room}", robot=robot, goal=goal)
            task = self.give(order, since_ms)
            task.is_return, task.purpose, task.rooms = True, "goes back", rooms

    def homes(self) -> dict[str, Pose]:
        """Return by robot where those that make room, or have done so, are to go back to."""
        return {
            task.order.robot: home
            for task in self._open.values()
            if (home := task.order.goal if task.is_return else task.returns_to) is not None
        }

    def room_for(self, robot: str, goal: Pose, whose: str, now_ms: int) -> Task:
        """Return a new order of the coordinator's own: a robot makes room for another order."""
        self._made_room += 1
        order = Order(id=f"{_ROOM}{self._made_room}", robot=robot, goal=goal)
        task = self.give(order, now_ms, makes_room=True)
        task.reason = task.purpose = f"makes room for {whose}"
        return task

    def offer_again(self) -> None:
        """Take in that ways have opened: robots that could not do an order may be able to now."""
        for task in self._open.values():
            task.cannot.clear()

    def end(self, task: Task, state: int, reason: str = "") -> None:
        """Take in that an order is over; a robot that left its place for it is to go back."""
        task.state, task.reason = state, reason
        self._open.pop(task.order.id, None)
        self._ended.append(task)
        self.done += 1
        robot, place = task.order.robot, task.returns_to
        has_left = state == ORDER_DONE or (state == REFUSED and task.revision > 0)
        if place is not None and has_left and robot in self._robots:
            self._return(robot, place, task.released_ms, task.rooms)

    def cancel(self, order_id: str, now_ms: int) -> Task | None:
        """Take an order back, unless it is over; return it, or None if there is no such order.

        A robot that is under way for it goes on to its next order, or makes room.
        """
        later = self._later.pop(order_id, None)
        if later is not None:
            self.give(later, now_ms)
        task = self.tasks.get(order_id)
        if task is not None and not task.is_over:
            under_way = task.state == UNDER_WAY and task.arrived_ms is None
            self.end(task, CANCELLED)
            if under_way:
                self.leave(task, task.robot, now_ms)
        return task

    def leave(self, task: Task, robot: str, now_ms: int) -> None:
        """Let a robot leave an order that is over for its next one, or for a place to rest.

        It goes on as it was told if it has a course for its next order already.
        """
        if any(one.revision > task.revision for one in self.all_of(robot)):
            return
        others = [one for one in self.waiting() if one.robot == robot]
        if others:
            urgent = others[0]
        else:
            urgent = self.room_for(robot, task.order.goal, task.order.id, now_ms)
            urgent.reason = urgent.purpose = f"leaves {task.order.id}"
        urgent.is_urgent, urgent.leaves = True, task.revision

    def put_back(self, robot: str) -> None:
        """Let the orders that a robot does wait again: the robot is sent elsewhere."""
        for task in self.all_of(robot):
            self.let_wait(task)

    def let_wait(self, task: Task) -> None:
        """Let an order wait again; a robot that was joining by it has joined."""
        if task.joins is not None:
            self.end(task, ORDER_DONE)
        else:
            task.put_back += task.state == UNDER_WAY
            task.state, task.accepted_ms = WAITING, None
            task.planned_arrival_ms = task.arrived_ms = None
            task.robot = task.order.robot

    def begin_epoch(self, robots: Collection[str], stays: Mapping[str, str]) -> None:
        """Take in that robots have first courses again: to the goals that they were sent to last.

        Those that have made room go back by these.  `robots`: those that have one; the orders that
        others did wait again.  `stays`: those that have no way, and why: they do not go back.
        """
        for task in list(self._open.values()):
            robot, home = task.order.robot, task.returns_to
            if task.makes_room and home is not None and robot in robots:
                task.returns_to = None
                self.end(task, CANCELLED)
                self._return(robot, home, task.released_ms, 0)
        for task in list(self._open.values()):
            if task.is_return and task.order.robot in stays:
                self.end(task, REFUSED, stays[task.order.robot])
            elif task.is_return and task.order.robot in robots:
                task.state, task.rooms = UNDER_WAY, 0
        for task in self.under_way():
            if task.robot not in robots or task is not self.all_of(task.robot)[-1]:
                self.let_wait(task)
        for task in self._open.values():
            task.revision = task.leaves = 0

    def of_robot(self, robot: str) -> Task | None:
        """Return the order that a robot does now."""
        return next(iter(self.all_of(robot)), None)

    def all_of(self, robot: str) -> list[Task]:
        """Return the order that a robot does now, and the next one if it has a course for it."""
        return [one for one in self.under_way() if one.robot == robot]

    def under_way(self) -> list[Task]:
        """Return the orders for which robots have courses, in the order of each robot's courses."""
        found = [one for one in self._open.values() if one.state == UNDER_WAY]
        return sorted(found, key=lambda one: one.revision)

    def waiting(self) -> list[Task]:
        """Return the orders that wait and may be served, in the order in which they are to be."""
        is_over = all(one.is_return for one in self._open.values())
        found = [
            one
            for one in self._open.values()
            if one.state == WAITING and (is_over or not one.is_return)
        ]
        return sorted(found, key=lambda one: (not one.makes_room, -one.order.priority))

    def look(
        self,
        now_ms: int,
        has_arrived: Callable[[str, int], bool],
        are_free: Callable[[str, Array], Flags],
    ) -> None:
        """Let time pass: orders are done, and others become known.

        `has_arrived`: whether a robot has come to the end of its course of a revision; `are_free`:
        at which places (n, 2) [m] a robot could rest, where no other one is or is bound for (n,).
        """
        for task in self.under_way():
            if task.arrived_ms is None and has_arrived(task.robot, task.revision):
                task.arrived_ms = now_ms
            dwell_ms = round(1000.0 * task.order.dwell)
            if task.arrived_ms is not None and now_ms >= task.arrived_ms + dwell_ms:
                self.end(task, ORDER_DONE)
        for order in list(self._later.values()):
            if self._is_known(order, now_ms):
                del self._later[order.id]
                self.give(order, now_ms)
        if self._demand is not None:
            for robot in self._given:
                self._demand_of(self._demand, robot, now_ms, are_free)

    def _is_known(self, order: Order, now_ms: int) -> bool:
        if not order.after:
            return now_ms >= 1000.0 * order.release
        before = self.tasks.get(order.after)
        return before is not None and before.is_over

    def _demand_of(
        self, demand: Demand, robot: str, now_ms: int, are_free: Callable[[str, Array], Flags]
    ) -> None:
        """Give a robot its next order to one of the places, when its last one is over."""
        count = self._given[robot]
        if count >= demand.per_robot or (count and not self.tasks[f"{robot}-{count}"].is_over):
            return
        dice = Random(f"{demand.seed} {robot} {count}")
        if count == 0 and now_ms < 1000.0 * dice.uniform(0.0, demand.first_within):
            return
        places = np.array([place[:2] for place in demand.places])
        is_open = are_free(robot, places)
        bound = np.array([one.order.goal[:2] for one in self._open.values()]).reshape(-1, 2)
        is_open &= (cdist(places, bound) > _SAME).all(axis=1)
        if is_open.any():
            self._given[robot] = count + 1
            goal = demand.places[dice.choice(np.flatnonzero(is_open).tolist())]
            order = Order(id=f"{robot}-{count + 1}", robot=robot, goal=goal, dwell=demand.dwell)
            self.give(order, now_ms)

    def refuse_stuck(self, reason: Callable[[Task], str]) -> None:
        """Refuse all orders because nobody gets on; robots that made room may still go back."""
        stuck = [one for one in self._open.values() if not one.is_return]
        if not stuck or len(stuck) == len(self._open):
            self.refuse_all(reason)
        for task in stuck:
            if not task.is_over:
                self.end(task, REFUSED, reason(task))

    def refuse_all(self, reason: Callable[[Task], str]) -> None:
        """Refuse all orders that are open or that would become known by themselves."""
        for task in list(self._open.values()):
            self.end(task, REFUSED, reason(task))
        for order in self._later.values():
            task = self.tasks[order.id] = Task(order, 0, order.robot)
            self.end(task, REFUSED, "did not become known before nobody could go on")
        self._later.clear()
        self._demand = None

    def changed(self) -> list[OrderState]:
        """Return what is to be said of orders that have changed; they count as said."""
        news = [task.message() for task in self._ended]
        for task in self._ended:
            self._said.pop(task.order.id, None)
        self._ended = []
        for order_id, task in self._open.items():
            said = task.message()
            if self._said.get(order_id) != said:
                self._said[order_id] = said
                news.append(said)
        return news

    def states(self) -> list[OrderState]:
        """Return what is to be said of every order."""
        return [task.message() for task in self.tasks.values()]
