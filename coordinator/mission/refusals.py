"""Which orders are refused without a search: those to closed places, and all when nobody gets on.

Decides: when that is, and in which words.  Must not know: how courses are found, which robot gets
which order, links, files.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Final

import numpy as np

from coordinator.fleet.core import Fleet
from coordinator.fleet.task import Task
from coordinator.mission.obstructions import Obstructions
from coordinator.mission.searches import Searches
from coordinator.scenario.model import Pose, Robot
from coordinator.scenario.order_checks import OWN
from protocol.messages import REFUSED

_NOBODY_MOVES_MS: Final = 20_000
"""Orders for which nothing is found for so long while nobody moves are refused."""

_FLUSH: Final = 2e-6
"""A robot may be so much nearer [m] to something solid than it keeps: that is rounding."""


class Refusals:
    """The refusals of one fleet's orders; `robots`: by name, as a Dispatcher knows them.

    what_stops: says in words why a robot cannot go on, at a time [ns].
    """

    def __init__(
        self,
        fleet: Fleet,
        robots: Mapping[str, Robot],
        obstructions: Obstructions,
        searches: Searches,
        what_stops: Callable[[str, int], str],
    ) -> None:
        self._fleet, self._robots = fleet, robots
        self._obstructions, self._searches = obstructions, searches
        self._what_stops = what_stops
        self._moved_ms = 0
        self._mark = (0, 0)
        """When a robot last got on, and how many courses there were, at _moved_ms."""

    def plain(self) -> tuple[int, tuple[int, int]]:
        """Return as plain data since when [ms] nobody has got on, and by which mark that is told.

        The count of courses begins again at 0 for whoever goes on from this state.
        """
        mark = self._progress()
        self._mark = (mark[0], 0) if mark == self._mark else (-1, 0)
        return self._moved_ms, self._mark

    def take_plain(self, moved_ms: int, mark: tuple[int, int]) -> None:
        """Take over the state of others."""
        self._moved_ms, self._mark = moved_ms, mark

    def nobody_may_drive(self, now_ms: int) -> None:
        """Take in that the fleet is stopped: that nobody gets on means nothing."""
        self._moved_ms = now_ms

    def look(self, now_ns: int, now_ms: int) -> None:
        """Refuse all orders that nobody can do."""
        self._refuse_if_stuck(now_ns)
        self._refuse_closed(now_ms)

    def is_for_nobody_else(self, task: Task, robot: str) -> bool:
        """Take in that a robot can never do an order; return whether no other one might."""
        room, goal = self._room_at(task.order.goal), task.order.goal[:2]
        # Where there is no room at the goal, it is the same for others.
        task.cannot |= {robot} | {
            one.id
            for one in self._robots.values()
            if room < one.radius - _FLUSH or self._obstructions.closed_at(goal, one.radius)
        }
        task.robot = task.order.robot
        return bool(task.order.robot) or self._fleet.members.keys() <= task.cannot

    def _refuse_closed(self, now_ms: int) -> None:
        """Refuse orders that are new and lead to, or through, a place that is closed or solid.

        When a place is closed, those under way to it are refused, too.
        """
        book, blocks = self._fleet.orders, self._fleet.blocks
        new = [one for one in book.waiting() if not one.reason]
        going: list[Task] = []
        if blocks and self._obstructions.has_closed:
            set_out = [one for one in book.waiting() if one.is_urgent and one.revision > 0]
            going = [*book.under_way(), *set_out]  # Some are to go around the place already.
        for task in (*new, *going):
            if task.joins is not None or task.arrived_ms is not None:
                continue
            if task.order.id.startswith(OWN):
                continue
            robot = task.robot if task in going else ""
            names = [one for one in (robot, task.order.robot) if one] or list(self._fleet.members)
            radii = [self._robots[name].radius for name in names if name in self._robots]
            for place in (task.order.goal, *(() if robot else task.order.via)):
                least = min(radii, default=0.0)
                why = self._obstructions.closed_at(place[:2], least)
                if why := why or self._why_not_at(place, least, task.order.robot):
                    book.end(task, REFUSED, why)
                    if robot:
                        book.leave(task, robot, now_ms)
                    break

    def _why_not_at(self, place: Pose, radius: float, robot: str) -> str:
        """Return in words what is solid where a robot would be that is no larger; "" if nothing."""
        site, (x, y, *_) = self._obstructions.site, place
        if site is None or self._room_at(place) >= radius - _FLUSH:
            return ""
        what = site.what_is_at((x, y), radius + site.terms.margin)
        who = f"{robot} cannot" if robot else "no robot can"
        return f"{who} be at ({x:.2f}, {y:.2f}), which {what}" if what else ""

    def _room_at(self, place: Pose) -> float:
        """Return the radius [m] of the largest robot that has room on the floor at a place."""
        site = self._obstructions.site
        if site is None:
            return math.inf
        return float(site.room(np.array([place[:2]]))[0]) - site.terms.margin

    def _refuse_if_stuck(self, now_ns: int) -> None:
        """Refuse all orders when nobody gets on and nothing is found for a long time."""
        book, mark, now_ms = self._fleet.orders, self._progress(), self._fleet.since_go_ms(now_ns)
        under_way = book.under_way()
        dwells = any(one.arrived_ms is not None for one in under_way)
        if mark != self._mark or dwells or book.stays or not (under_way or book.waiting()):
            self._mark, self._moved_ms = mark, now_ms
        elif now_ms - self._moved_ms > _NOBODY_MOVES_MS:
            self._moved_ms = now_ms
            book.refuse_stuck(partial(self._why_stuck, now_ns=now_ns))

    def _why_stuck(self, task: Task, now_ns: int) -> str:
        """Return in words why nobody can do an order."""
        member = self._fleet.members.get(task.order.robot)
        if member is not None and (member.lost or member.has_stopped(self._fleet.epoch)):
            return f"{member.id} {self._what_stops(member.id, now_ns)}"
        return task.reason or "no robot can do it"

    def _progress(self) -> tuple[int, int]:
        """Return when a robot last got on [ms], and how many courses were committed."""
        return self._fleet.grants.standstills.got_on_latest_ms, self._searches.commits
