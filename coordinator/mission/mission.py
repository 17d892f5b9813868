"""A fleet's epochs one after another: the fleet core, the site as it is known, the plans so far.

`solve` takes long and changes nothing, so that a shell may run it in a thread beside the fleet.

Decides: when a fleet gets a new plan, and which one.  Must not know: clocks, links, files.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from msgspec.structs import replace

from coordinator.fleet.core import Fleet
from coordinator.fleet.events import Incident, Outgoing
from coordinator.fleet.grants import NOBODY
from coordinator.fleet.log_records import CourseRequest, Request
from coordinator.fleet.orders import OrderBook
from coordinator.fleet.rest_places import Standing
from coordinator.mission.dispatch import Dispatcher
from coordinator.mission.fleet_from_plan import grants_of, muster, parts_of
from coordinator.mission.recovery import Planner, Recovery, recover
from coordinator.mission.replanning_input import Site
from coordinator.plan.document import PlanDocument
from coordinator.plan.wire import Driven, PackedPlan, address
from coordinator.planning.course_search import Answer
from coordinator.planning.wish import Site as Floor
from coordinator.scenario.model import Scenario, Workspace
from coordinator.scenario.plain import pose_of

MOST_EPOCHS: Final = 200
"""A fleet that has not arrived after this many epochs is given up."""

_NEAR: Final = 0.05
"""How far [m] ahead of its plan a robot's estimate of its own place may be."""


class Mission:
    """One scenario from its first plan to the end of the fleet; `planner` plans later epochs.

    `document` is the newest plan, `rides` the courses so far by robot, epoch and revision.
    """

    def __init__(
        self,
        site: Site,
        fleet: Fleet,
        document: PlanDocument,
        rides: dict[tuple[str, int, int], Driven],
        planner: Planner,
    ) -> None:
        self.site, self.fleet, self.rides = site, fleet, rides
        self.documents = {document.epoch: document}
        self.dispatcher = Dispatcher(fleet, site.scenario.robots)
        fleet.check_places(self.dispatcher.obstructions.why_not_at)
        self._planner = planner
        self._wanted: Request | None = None

    @classmethod
    def of_plan(
        cls,
        scenario: Scenario,
        plan: PackedPlan,
        boot: int,
        planner: Planner,
        *,
        stays: bool = False,
    ) -> Mission:
        """Return the mission that begins with a scenario's first plan.

        `stays`: whether the fleet waits for orders until it is told to end.  Raises PlanError if
        the plan is not proven.
        """
        fleet = muster(plan, boot, book_of(scenario, stays=stays))
        made = cls(Site(scenario), fleet, plan.document, rides_of(plan), planner)
        made.begin(plan.document)
        return made

    def begin(self, document: PlanDocument | None) -> None:
        """Begin an epoch with a plan, or with none if nobody can drive."""
        self.dispatcher.begin(None if document is None else lambda: _floor_of(self.site, document))

    @property
    def document(self) -> PlanDocument:
        """The newest plan."""
        return self.documents[max(self.documents)]

    def request(self, now_ns: int) -> Request | None:
        """Return a request for a plan if one is needed and was not requested yet."""
        if not self.fleet.is_settled(now_ns):
            return None
        wanted = self._asked_now()
        if self.fleet.is_resumed and (robot := self._outran(wanted.told)):
            self.fleet.outrun(f"{robot} rests farther along its path than it could be", now_ns)
        if wanted == self._wanted or self.fleet.superseded:
            return None
        self._wanted = wanted
        self.site = self.site.among(set(self.fleet.members))
        return wanted

    def _asked_now(self) -> Request:
        fleet = self.fleet
        told = tuple(fleet.standings())
        homes = tuple(sorted(fleet.orders.homes().items()))
        return Request(fleet.next_epoch, told, fleet.orders.is_open_or_stays, homes)

    def solve(self, request: Request) -> Recovery:
        """Plan a requested epoch; pure, may take seconds."""
        if request.epoch > MOST_EPOCHS:
            return Recovery(self.site, None, (f"given up after {MOST_EPOCHS} epochs",))
        return recover(
            self.site,
            self.rides,
            request.told,
            request.epoch,
            self._planner,
            has_orders=request.has_orders,
            homes={robot: pose_of(home) for robot, home in request.homes},
        )

    def _outran(self, told: Iterable[Standing]) -> str:
        """Return the id of a robot that rests farther ahead than it can be after the freeze, or "".

        Such a robot drove on after the log's end, so the places where a lost robot may stand are
        not known either.
        """
        times = self.fleet.times
        if not times.has_gone or times.epoch not in self.documents:
            return ""
        for one in told:
            ride = self.rides.get((one.robot, one.epoch, one.revision))
            if one.s is None or one.epoch != times.epoch or ride is None:
                continue
            until_ms = [s.until_ms for s in self.fleet.spans(one.robot) if s[0] == one.revision]
            reached = ride.timeline.s_at(max([0, *until_ms]) / 1000.0)
            if min(one.s, ride.timeline.length) > reached + self.site.scenario.margin + _NEAR:
                return one.robot
        return ""

    def commit(self, request: CourseRequest, answer: Answer, now_ns: int) -> None:
        """Put the answer to a request for a course into effect."""
        robot = self.dispatcher.commit(request, answer, now_ns)
        if robot is not None and answer.proposal is not None:
            ride = answer.proposal.course.driven
            self.rides[robot.id, self.fleet.epoch, request.revision] = ride
            mine = self.fleet.grants.of(robot.id)
            for old in range(request.revision if mine is None else mine.now.revision):
                self.rides.pop((robot.id, self.fleet.epoch, old), None)
            self.site = self.site.sent(robot)
            known = set(self.fleet.members)
            self.site = self.site.among(known)

    def take_over(self, boot: int, last_ns: int, now_ns: int) -> None:
        """Resume with another boot id for a coordinator that was last known alive at `last_ns`."""
        self._wanted = None
        self.dispatcher.searches.give_up()
        for member in self.fleet.members.planned:
            member.plan = address(member.plan, boot)
        self.fleet.take_over(boot, last_ns, now_ns)

    def change_floor(self, floor: Workspace, now_ns: int) -> None:
        """Freeze the fleet, and plan it anew on another floor when all rest.

        Robots keep their goals, and orders wait or go on.
        """
        self.site = Site(replace(self.site.scenario, workspace=floor), self.site.aside)
        self._wanted = None
        self.fleet.leave_floor(now_ns)

    def adopt(self, request: Request, recovery: Recovery, now_ns: int) -> list[Outgoing] | None:
        """Begin the next epoch; return None if the fleet has changed since the request.

        The fleet may return to the state of the request, so the plan may then be requested again.
        """
        wanted, self._wanted = self._wanted, None
        asked = self._asked_now()
        if request != wanted or asked != request or not self.fleet.is_settled(now_ns):
            return None
        for sentence in recovery.said:
            self.fleet.incidents.append(Incident(now_ns, "stays", "", sentence))
        for member in self.fleet.members.values():
            member.stays = recovery.stays.get(member.id, "")
            if member.id in recovery.doubted:
                member.rest = None
        self.site = recovery.site.among(set(self.fleet.members))
        self.dispatcher.robots.update((robot.id, robot) for robot in self.site.scenario.robots)
        for one in self.site.aside:
            self.fleet.members[one.robot.id].finished |= one.why == "arrived"
        drives = set() if recovery.plan is None else set(recovery.plan.messages)
        self.fleet.orders.begin_epoch(drives, recovery.stays)
        if recovery.plan is None:
            self.begin(None)
            return self.fleet.adopt(request.epoch, {}, now_ns, NOBODY)
        document = recovery.plan.document
        self.documents[document.epoch] = document
        have_parts = {robot.id for robot in document.robots}
        old = {key: ride for key, ride in self.rides.items() if key[0] not in have_parts}
        self.rides = old | rides_of(recovery.plan)
        self.begin(document)
        parts = parts_of(recovery.plan, self.fleet.boot)
        return self.fleet.adopt(document.epoch, parts, now_ns, grants_of(recovery.plan))


def rides_of(plan: PackedPlan) -> dict[tuple[str, int, int], Driven]:
    """Return the courses of a plan by robot, epoch and revision."""
    return {(one.id, plan.document.epoch, 0): one for one in plan.driven}


def _floor_of(site: Site, document: PlanDocument) -> Floor:
    """Return the floor on which a plan was made: robots that stood aside then are solid."""
    floor = document.workspace
    assert floor is not None
    solid = tuple(tuple(corners) for corners in floor.obstacles)
    workspace = replace(site.scenario.workspace, boundary=tuple(floor.boundary), obstacles=solid)
    return Floor(replace(site.scenario, workspace=workspace), document)


def book_of(scenario: Scenario, *, stays: bool) -> OrderBook:
    """Return the book of a fleet that has not begun; `stays` as in `Mission.of_plan`."""
    names = [robot.id for robot in scenario.robots]
    return OrderBook(scenario.orders, scenario.demand, names, stays=stays)
