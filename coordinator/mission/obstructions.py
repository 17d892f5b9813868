"""What is in robots' way for long: lost robots that hold others, and places that are closed.

Both are solid for the courses that are looked for from then on.  Robots whose courses lead there
are sent around.

Decides: what counts as solid for which robot, and who is sent around it.  Must not know: how
courses are found, which order comes next.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final

import msgspec
import numpy as np
import shapely

from coordinator.curves.nurbs import Array
from coordinator.fleet.core import Fleet
from coordinator.fleet.events import Incident
from coordinator.fleet.member import Member
from coordinator.fleet.phases import SILENT_PATIENCE
from coordinator.fleet.rest_places import Standing
from coordinator.mission.replanning_input import (
    SAME,
    TURNING,
    Aside,
    on_path,
    resting_pose,
    stretch,
    via_ahead,
)
from coordinator.plan.wire import Driven
from coordinator.planning.wish import Site
from coordinator.scenario.model import Point, Pose, Robot
from coordinator.scenario.obstacle_names import closed_place, too_near
from coordinator.schedule.authority import EVER
from protocol.messages import REFUSED, UNDER_WAY
from protocol.phases import GO, MOVING, STOP

Ring = tuple[Point, ...]

_STEP: Final = 0.05
"""Distance [m] between places of a course that are compared with a closed place."""

_ROOM: Final = 0.006
"""So much more room [m] than the margin robots that stand get from others that are sent past them.

They may set out from there: on their staircases others keep STANDOFF more than the margin away."""

_AGAIN_MS: Final = 20_000
"""A robot that found no way around what is in its way looks again after this, if anybody has got
on since."""

_MOST_SITES: Final = 8
"""How many floors with different obstructions are kept."""


class PlainObstructions(msgspec.Struct, frozen=True):
    """An Obstructions as plain data; courses are given by robot and revision."""

    around: dict[str, Ring]
    closed: dict[str, Ring]
    avoided: list[tuple[str, int, list[str]]]
    told: list[tuple[str, int, list[str]]]


class Obstructions:
    """What is in the way on one fleet's floor in one epoch.

    `robots`: the fleet's, each with the goal and the places to pass of its newest course for them.
    `may_leave`: whether a robot can be sent on another course, at a time [ns].
    """

    def __init__(
        self,
        fleet: Fleet,
        robots: Mapping[str, Robot],
        may_leave: Callable[[str, int], bool],
    ) -> None:
        self._fleet = fleet
        self._robots = robots
        self._may_leave = may_leave
        self._make_site: Callable[[], Site] | None = None
        self._made_site: Site | None = None
        self._around: dict[str, Ring] = {}
        """By lost robot that others go around: where it may stand."""

        self._closed: dict[str, Ring] = {}
        """The places that operators have closed."""

        self._avoided: dict[tuple[str, int], frozenset[str]] = {}
        """By robot and revision: the places, closed since, that the course was planned around."""

        self._tried: dict[str, tuple[object, int, int]] = {}
        """By robot: what was in the way when it was last sent around it, when [ms], and when any
        robot had last got on [ms]."""

        self._told: dict[tuple[str, int], set[str]] = {}
        """By robot and revision: the closed places for which the robot was dealt with."""

        self.has_closed = False
        """Whether operators have closed a place since the look before the last one."""

        self._sites: dict[tuple[tuple[str, Ring], ...], Site] = {}
        self._left_out: set[tuple[str, Point]] = set()
        """By robot: the places that people were told it does not pass."""

    def begin(self, make_site: Callable[[], Site] | None) -> None:
        """Begin an epoch; `make_site` prepares its floor when it is needed, None: nobody drives."""
        self._make_site, self._made_site = make_site, None
        self._around, self._sites, self._closed = {}, {}, {}
        self._avoided, self._told, self._tried = {}, {}, {}

    def plain(self) -> PlainObstructions:
        """Return what is in the way as plain data; who found no way around it looks again."""
        self._tried = {}
        avoided, told = (
            [(robot, revision, sorted(names)) for (robot, revision), names in table.items()]
            for table in (self._avoided, self._told)
        )
        return PlainObstructions(self._around, self._closed, avoided, told)

    def take_plain(self, told: PlainObstructions) -> None:
        """Take over what was in the way."""
        self._around, self._closed = told.around, told.closed
        self._avoided = {(robot, n): frozenset(names) for robot, n, names in told.avoided}
        self._told = {(robot, n): set(names) for robot, n, names in told.told}

    @property
    def site(self) -> Site | None:
        """The floor of the epoch, without obstructions."""
        if self._made_site is None and self._make_site is not None:
            self._made_site = self._make_site()
        return self._made_site

    @property
    def has_site(self) -> bool:
        """Whether robots drive in this epoch."""
        return self._make_site is not None

    @property
    def around(self) -> dict[str, Ring]:
        """By robot that others go around: where it may stand."""
        return dict(self._around)

    @property
    def closed(self) -> dict[str, Ring]:
        """The places that are closed."""
        return dict(self._closed)

    def site_for(self, robot: str, place: Point) -> Site:
        """Return the floor as it is for a robot at a place [m]: what is in the way is solid.

        A robot that is inside of a closed place may leave it, and one that is held by another
        starts as near to that as it stands.
        """
        whole = self.site
        assert whole is not None
        reach, here = self._robots[robot].radius + whole.terms.margin, shapely.Point(place)
        rings = {}
        for name, ring in self._around.items():
            if name != robot:
                wide = shapely.buffer(shapely.Polygon(ring), _ROOM, join_style="mitre")
                is_near = shapely.dwithin(wide, here, reach)
                rings[f"the place where {name} may stand"] = ring if is_near else _ring_of(wide)
        for name, ring in self._closed.items():
            if not shapely.dwithin(shapely.Polygon(ring), here, reach):
                rings[self._in_words(name)] = ring
        if not rings:
            return whole
        key = tuple(rings.items())
        if key not in self._sites:
            if len(self._sites) >= _MOST_SITES:
                del self._sites[next(iter(self._sites))]
            self._sites[key] = whole.with_obstacles(rings)
        return self._sites[key]

    def _in_words(self, closed: str) -> str:
        """Return the name of a closed place for people."""
        return closed_place(closed) if closed in self._fleet.blocks else f"the place {closed}"

    def closed_at(self, place: Point, radius: float) -> str:
        """Return in words which place an operator has closed for a disc [m] at a place [m].

        "" if none.
        """
        whole, here = self.site, shapely.Point(place)
        assert whole is not None
        reach = radius + whole.terms.margin
        for name, block in self._fleet.blocks.items():
            apart = float(shapely.distance(shapely.Polygon(block.polygon), here))
            if apart < reach:
                x, y = place
                return f"({x:.2f}, {y:.2f}) {too_near(apart, reach, closed_place(name))}"
        return ""

    def why_not_at(self, robot: str, pose: Pose) -> str:
        """Return in words why a robot that has come back cannot stand where it says; "" if it can.

        It must keep clear of what is solid by as much as its next course has to, and of robots of
        which it is known where they are.  One that stands on its course is clear of others.
        """
        fleet, whole, here = self._fleet, self.site, pose[:2]
        mine = fleet.grants.of(robot)
        if fleet.phase not in (GO, STOP) or whole is None or mine is None:
            return ""  # When a fleet is planned anew, that looks at the places.
        reach = self._robots[robot].radius + whole.terms.margin
        if what := whole.what_is_at(here, reach):
            return f"which {what}"
        if self._is_on_course(robot, here):
            return ""
        for member in fleet.members.values():
            places = self._possible_places(member.id) if member.id != robot else []
            apart = max((math.dist(place, here) for place in places), default=math.inf)
            if apart < reach + member.radius:
                touches = apart < self._robots[robot].radius + member.radius
                return f"where {member.id} stands" if touches else f"too near to {member.id}"
        return ""

    def _possible_places(self, robot: str) -> list[Point]:
        """Return the places [m] where a robot may be, on any course; none if nothing is known."""
        mine, rest = self._fleet.grants.of(robot), self.rest_of(robot)
        if mine is None or mine.now.course is None:
            return []
        if rest is not None:
            return [self.pose_of(robot, rest)[:2]]
        courses = {one.revision: one.course for one in mine}
        found: list[Point] = []
        for revision, since_ms, until_ms in self._fleet.spans(robot):
            if (course := courses[revision]) is not None:
                places = stretch(course.driven, since_ms / 1000.0, until_ms / 1000.0)
                found += [(float(x), float(y)) for x, y in places]
        return found

    def take_course(self, robot: str, revision: int, closed: Mapping[str, Ring]) -> bool:
        """Take in a course that was planned around closed places; False if others are closed now.

        The robot may begin it later.
        """
        if self._closed_now().items() - closed.items():
            return False
        known = closed.items() & self._closed.items()
        self._avoided[robot, revision] = frozenset(name for name, _ in known)
        self._avoided.pop((robot, revision - 2), None)
        self._told.pop((robot, revision - 2), None)
        return True

    def look(self, now_ns: int, now_ms: int) -> None:
        """Send robots around lost ones that hold them, and around places that are closed."""
        fleet = self._fleet
        self._give_up_lost(now_ns)
        self._give_up_refusing(now_ns)
        self._give_up_stopped(now_ns)
        given_up = fleet.grants.given_up
        if self._around.keys() - given_up:
            fleet.orders.offer_again()
        self._around = {name: ring for name, ring in self._around.items() if name in given_up}
        for name in sorted(given_up - self._around.keys()):
            self._around[name] = self.aside(name).disc()
        for robot, by in self.held_up().items():
            if fleet.members[by].lost and not fleet.grants.is_over(by):
                fleet.go_around(fleet.members[by], now_ns)  # Lost before it began its next course.
            elif self._may_leave(robot, now_ns):
                self._go_around(robot, by, now_ms)
        self._close(now_ns, now_ms)
        for name in sorted(given_up):
            if self._may_leave(name, now_ns) and self._has_come_to_rest(name):
                self._go_around(name, "where it stood", now_ms)

    def held_up(self) -> dict[str, str]:
        """Return the robots that wait for ones that others go around, and who holds each."""
        grants = self._fleet.grants
        behind = grants.standstills.behind(self._around) if self._around else set()
        return {robot: by for robot, by, _ in grants.standstills.held() if robot in behind}

    def passable(self, robot: str, via: Sequence[Point], now_ns: int) -> tuple[Point, ...]:
        """Return the places that a robot can pass: none on which others stand that go no farther.

        People are told which ones are left out.
        """
        whole = self.site
        assert whole is not None
        room, left = self._robots[robot].radius + whole.terms.margin + TURNING, []
        for place in via:
            here = shapely.Point(place)
            by = [
                name
                for name, ring in self._around.items()
                if name != robot
                and not self._may_go_on(name)
                and shapely.dwithin(shapely.Polygon(ring), here, room)
            ]
            if not by:
                left.append(place)
            elif (robot, place) not in self._left_out:
                self._left_out.add((robot, place))
                x, y = place
                text = f"{robot} does not pass ({x:.2f}, {y:.2f}): {by[0]} stands there"
                self._fleet.incidents.append(Incident(now_ns, "stays", "", text))
        return tuple(left)

    def _may_go_on(self, robot: str) -> bool:
        """Return whether a robot that was given up gets another course as soon as there is one."""
        member = self._fleet.members[robot]
        is_stuck = member.phase == MOVING and not self._fleet.grants.ends.is_at_end(robot)
        return member.is_fit and not (member.lost or is_stuck)

    def goes_around(self, robot: str) -> bool:
        """Return whether others that may go on again are solid for a robot."""
        return bool(self._around.keys() - {robot})

    def _give_up_lost(self, now_ns: int) -> None:
        """Let orders of robots that are lost for long wait; others may do those without a name."""
        fleet = self._fleet
        for task in fleet.orders.under_way():
            if task.state != UNDER_WAY:
                continue  # It was put back with an earlier one of its robot.
            member = fleet.members[task.robot]
            silent_ns = now_ns - max(member.heard_ns, member.excused_ns)
            if member.lost and task.arrived_ms is None and silent_ns > SILENT_PATIENCE:
                if task.joins is not None:
                    why = f"{task.robot} was not heard; it counts as lost until it is, or leaves"
                    fleet.orders.end(task, REFUSED, why)
                    continue
                if not (task.order.robot or task.robot in fleet.grants.given_up):
                    fleet.go_around(member, now_ns)
                fleet.orders.put_back(task.robot)

    def _give_up_refusing(self, now_ns: int) -> None:
        """Withdraw courses that their robots do not take; others go around those robots."""
        fleet = self._fleet
        for member in fleet.members.planned:
            if not member.refuses_course(fleet.epoch, now_ns):
                continue
            text = f"{member.id} does not take the course that it is sent"
            fleet.incidents.append(Incident(now_ns, "fault", member.id, text))
            fleet.go_around(member, now_ns)
            member.withdraw_course()
            for task in fleet.orders.all_of(member.id)[-1:]:
                fleet.orders.let_wait(task)
                task.cannot.add(member.id)
                if task.order.robot:
                    fleet.orders.end(task, REFUSED, text)

    def _give_up_stopped(self, now_ns: int) -> None:
        """Take in which robots have stopped on their courses: they go on on others, if they may."""
        fleet = self._fleet
        for member in fleet.members.planned:
            known = member.id in fleet.grants.given_up
            known &= not member.has_dropped_course(fleet.epoch)
            if known or self.rest_of(member.id) is None:
                continue
            fleet.go_around(member, now_ns)
            if member.lacks_course(fleet.epoch):
                member.withdraw_course()
            fleet.orders.put_back(member.id)

    def rest_of(self, robot: str) -> Standing | None:
        """Return where a robot has stopped on its course in force; None if it has not."""
        member, mine = self._fleet.members.get(robot), self._fleet.grants.of(robot)
        if member is None or mine is None:
            return None
        return member.rests_on(self._fleet.epoch, mine.now.revision)

    def pose_of(self, robot: str, rest: Standing) -> tuple[float, float, float]:
        """Return the pose [m, m, rad] of a robot that has stopped on its course in force."""
        if rest.place is not None:
            return rest.place
        mine, site = self._fleet.grants.of(robot), self.site
        assert mine is not None
        assert mine.now.course is not None
        assert site is not None
        return resting_pose(mine.now.course.driven, rest, site.terms.margin)

    def _has_come_to_rest(self, robot: str) -> bool:
        """Return whether a robot that was given up has stopped, or is where its authority ends."""
        return self.rest_of(robot) is not None or self._fleet.grants.ends.is_at_end(robot)

    def _go_around(self, robot: str, what: str, now_ms: int) -> None:
        """Send a robot around what is in its way, unless no way was found since that changed."""
        mine, book = self._fleet.grants.of(robot), self._fleet.orders
        waits = any(one.robot == robot and one.is_urgent for one in book.waiting())
        if mine is None or mine.now.course is None or waits:
            return
        state = (mine.newest.revision, frozenset(self._around), frozenset(self._closed))
        got_on_ms = self._fleet.grants.standstills.got_on_latest_ms
        tried, since_ms, then_ms = self._tried.get(robot, (None, 0, 0))
        if tried == state and (now_ms - since_ms < _AGAIN_MS or got_on_ms == then_ms):
            return
        self._tried[robot] = (state, now_ms, got_on_ms)
        (span, *_) = self._fleet.spans(robot)
        ride, one = mine.now.course.driven, self._robots[robot]
        goal: Pose = mine.now.course.goal
        via: tuple[Point, ...] = ()
        if math.dist(goal, one.goal[:2]) <= SAME:
            passed = ride.timeline.s_at(span.since_ms / 1000.0)
            goal, via = one.goal, via_ahead(ride, one.via, passed)
        book.go_around(robot, (mine.now.revision, goal, via), what, now_ms)

    def lost(self) -> list[str]:
        """Return the robots, not heard any more and not just let in, that others go around."""
        found = [self._fleet.members.get(name) for name in self._around]
        return [one.id for one in found if one and one.lost and not one.admission.is_awaited]

    def aside(self, robot: str) -> Aside:
        """Return where a robot may stand that is granted nothing more."""
        mine = self._fleet.grants.of(robot)
        assert mine is not None
        assert mine.now.course is not None
        rest = self.rest_of(robot)
        if rest is not None and rest.place is None:
            places = np.array([self.pose_of(robot, rest)[:2]])
        else:
            places = self._places(robot, mine.now.course.driven)
        return Aside(self._robots[robot], "lost", places, None)

    def _places(self, robot: str, ride: Driven) -> Array:
        """Return the places (n, 2) [m] of its course where a robot may be, as far as is known."""
        (span, *_) = self._fleet.spans(robot)
        return stretch(ride, span.since_ms / 1000.0, span.until_ms / 1000.0)

    def _close(self, now_ns: int, now_ms: int) -> None:
        """Deal with robots on courses that were planned before a place was closed."""
        fleet = self._fleet
        closed = self._closed_now()
        gone = {name for name, _ in self._closed.items() - closed.items()}
        if gone:  # One is open again, or another place has its name: limits are found anew.
            self._told = {}
            self._avoided = {course: names - gone for course, names in self._avoided.items()}
            fleet.orders.offer_again()
            for member in fleet.members.planned:
                fleet.grants.ends.limit(member.id, EVER)
        self.has_closed = bool({name for name, _ in closed.items() - self._closed.items()})
        for name in sorted((closed.keys() - self._closed.keys()) & fleet.blocks.keys()):
            if self.site is not None and not self.site.is_on_floor(closed[name]):
                text = f"{name} lies off the floor: nobody drives there anyway"
                fleet.incidents.append(Incident(now_ns, "block", "", text))
        self._closed = closed
        for member in fleet.members.planned if closed else ():
            mine = fleet.grants.of(member.id)
            if mine is None:
                continue
            course = (member.id, mine.now.revision)
            told = self._told.setdefault(course, set())
            for name in sorted(closed.keys() - told - self._avoided.get(course, frozenset())):
                told.add(name)
                self._keep_out(member, name, now_ns, now_ms)

    def _closed_now(self) -> dict[str, Ring]:
        """Return the places that operators have closed, and those of robots that came back.

        Those behind a robot that came back on its course are held by that anyway.
        """
        fleet = self._fleet
        closed = {name: block.polygon for name, block in fleet.blocks.items()}
        for name in sorted(fleet.grants.given_up):
            member = fleet.members.get(name)
            rest = None if member is None or member.came_back_to is None else member.rest
            stated = None if rest is None else rest.place
            if stated is not None and not self._is_on_course(name, stated[:2]):
                places = np.array([stated[:2]])
                ring = Aside(self._robots[name], "lost", places, None).disc()
                closed[f"where {name} stands"] = ring
        return closed

    def _is_on_course(self, robot: str, place: Point) -> bool:
        """Return whether a robot that has come back to a place stands where it was given up.

        Others go around what is solid for it, which may be less than it was granted: one that had
        said where it rests may have been pushed on since.
        """
        mine, site = self._fleet.grants.of(robot), self.site
        if mine is None or mine.now.course is None or site is None:
            return True
        beside, ring = on_path(site.terms.margin), self._around.get(robot)
        if ring is None:
            places = self._places(robot, mine.now.course.driven)
            return float(np.hypot(*(places - np.array(place)).T).min()) <= beside
        solid, disc = shapely.Polygon(ring), shapely.Point(place)
        inside = float(shapely.distance(solid.exterior, disc))
        return bool(solid.contains(disc)) and inside >= self._robots[robot].radius - beside

    def _keep_out(self, member: Member, name: str, now_ns: int, now_ms: int) -> None:
        """Let a robot drive no farther than a closed place, and go around it, or leave it."""
        fleet, site, mine = self._fleet, self.site, self._fleet.grants.of(member.id)
        if mine is None or mine.now.course is None or site is None:
            return
        ride, reach = mine.now.course.driven, member.radius + site.terms.margin
        (span, *_) = fleet.spans(member.id)
        end = ride.timeline.length
        begin = end if member.has_arrived else ride.timeline.s_at(span.since_ms / 1000.0)
        arcs = np.append(np.arange(begin, end, _STEP), end)
        polygon = shapely.Polygon(self._closed[name])
        inside = shapely.dwithin(shapely.points(ride.curve.at_arc(arcs)), polygon, reach)
        if not inside.any():
            return
        if member.has_arrived:
            if fleet.orders.of_robot(member.id) is None:
                fleet.orders.room_for(member.id, mine.now.course.goal, name, now_ms)
            return
        enters = float(arcs[max(int(inside.argmax()) - 1, 0)])
        before_ms = max(math.floor(1000.0 * ride.timeline.time_at(enters)), 0)
        fleet.grants.ends.limit(member.id, min(before_ms, fleet.grants.ends.limit_of(member.id)))
        if self._may_leave(member.id, now_ns):
            self._go_around(member.id, name, now_ms)


def _ring_of(polygon: shapely.Polygon) -> Ring:
    """Return the corners of a polygon's outline."""
    corners = shapely.get_coordinates(polygon.exterior)[:-1]
    return tuple((float(x), float(y)) for x, y in corners)
