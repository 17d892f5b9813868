"""A new plan for a fleet that rests: from where its robots stand, around those that are lost.

The same inputs give the same plan; replay relies on it.

Decides: which robots drive on and which stay.  Must not know: messages, clocks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from dataclasses import replace as changed
from typing import Final

from msgspec.structs import replace

from coordinator.base.errors import PlanError
from coordinator.fleet.rest_places import Standing
from coordinator.mission.disbelieved_places import doubtful
from coordinator.mission.replanning_input import Rides, Site, next_site, passable
from coordinator.paths.path_planner import Pathfinder, closed_in
from coordinator.plan.document import PlanDocument
from coordinator.plan.wire import PackedPlan
from coordinator.scenario.model import Point, Pose, Robot, Scenario

_GENTLE: Final = 0.05
"""The least turning radius that is tried first [m].

A robot that has stopped may face in any direction, and via points may force hairpins.  With a
smaller radius, these would be so tight that even a robot which can turn on the spot could not drive
them in practice."""

Planner = Callable[[Scenario, int], PackedPlan]
"""Plans a scenario for an epoch; raises PlanError."""


@dataclass(frozen=True, eq=False)
class Recovery:
    """The site as it is now, and the plan for the robots that can drive on.

    `plan`: None if no robot can drive on.  `said`: what was decided, in sentences.  `stays`: the
    robots that stay where they are, and why.  `doubted`: those of these robots that have come back
    and have stated a place where they cannot stand.
    """

    site: Site
    plan: PackedPlan | None
    said: tuple[str, ...]
    stays: Mapping[str, str] = field(default_factory=dict)
    doubted: tuple[str, ...] = ()

    @property
    def document(self) -> PlanDocument | None:
        """The plan's document."""
        return None if self.plan is None else self.plan.document


def recover(
    site: Site,
    rides: Rides,
    told: Sequence[Standing],
    epoch: int,
    plan: Planner,
    *,
    has_orders: bool = False,
    homes: Mapping[str, Pose] | None = None,
) -> Recovery:
    """Replan a fleet from where its robots stand; `rides` has the courses so far.

    With `has_orders`, robots at their goals get a part as well, because orders may reach them,
    unless they are silent.  `homes`: where robots that have made room go back to.

    A robot that has no way to its goal, or for which no order of the robots works, stays where it
    is, and the others are planned around it.  A robot on a given path may leave that path and find
    another way before it stays.  Via points that are blocked are left out only when no robot can
    drive on, because the robot that blocks them may move.  A robot that has come back and cannot
    stand where it says is treated as if it were where it was before.
    """
    homes = homes or {}
    now = next_site(site, rides, told, homes)
    doubts = doubtful(now, told)
    if doubts:
        believed = [_unbelieved(s) if s.robot in doubts else s for s in told]
        now = next_site(site, rides, believed, homes)
    if has_orders:
        now = now.idling({standing.robot for standing in told if standing.is_silent})
    now, dropped = passable(now)
    said = [*(f"{name} stays where it is: {why}" for name, why in doubts.items()), *dropped]
    found = _with_those_that_can(now, said, epoch, plan, every_via=True)
    if found.document is None and any(robot.via for robot in now.scenario.robots):
        fewer = _with_those_that_can(now, said, epoch, plan, every_via=False)
        found = found if fewer.document is None else fewer
    return changed(found, stays={**doubts, **found.stays}, doubted=tuple(doubts))


def _unbelieved(standing: Standing) -> Standing:
    """Return the standing of a robot whose stated place is not believed: lost, without a place."""
    return Standing(robot=standing.robot, state="lost", epoch=0)


def _with_those_that_can(
    site: Site, known: Sequence[str], epoch: int, plan: Planner, *, every_via: bool
) -> Recovery:
    """Plan for as many robots as can drive on.

    The sentences in `known` come first in the result's `said`.  If `every_via` is false, via points
    that a robot cannot reach are left out.
    """
    said = list(known)
    stays: dict[str, str] = {}
    while site.scenario.robots:
        scenario = site.planned()
        try:
            return Recovery(site, _plan(scenario, epoch, plan), tuple(said), stays)
        except PlanError as error:
            stay = closed_in(turned(scenario)) or {_blamed(scenario, error): error}
        for name, why in stay.items():
            closed = () if every_via else _closed_via(turned(scenario), name)
            if closed:
                said += [
                    f"{name} does not pass ({x:.2f}, {y:.2f}): no way there" for x, y in closed
                ]
                site = site.not_passing(name, closed)
                continue
            if site.on_given_path(name):
                said.append(f"{name} leaves the path that it was given: {why}")
                site = site.off_given_path(name)
                continue
            stays[name] = why.sentence if why.robot == name else str(why)
            said.append(f"{name} stays where it is: {stays[name]}")
            site = site.without(name)
        site, dropped = passable(site)
        said += dropped
    return Recovery(site, None, tuple(said), stays)


def _plan(scenario: Scenario, epoch: int, plan: Planner) -> PackedPlan:
    """Plan with wide turns, or else with any turns; try given start headings before free ones."""
    for asked in (_gentle(scenario), _gentle(turned(scenario)), scenario):
        with suppress(PlanError):
            return _with_own_radii(plan(asked, epoch), scenario)
    return plan(turned(scenario), epoch)


def _with_own_radii(plan: PackedPlan, scenario: Scenario) -> PackedPlan:
    """Return the plan of robots that may turn as tightly as they can: further courses do."""
    least = {robot.id: robot.min_turn_radius for robot in scenario.robots}
    robots = [
        one
        if one.limits is None
        else replace(one, limits=replace(one.limits, min_turn_radius=least[one.id]))
        for one in plan.document.robots
    ]
    return changed(plan, document=replace(plan.document, robots=robots))


def _gentle(scenario: Scenario) -> Scenario:
    """Return the scenario with turning radii of at least _GENTLE."""
    robots = tuple(
        replace(robot, min_turn_radius=max(robot.min_turn_radius, _GENTLE))
        for robot in scenario.robots
    )
    return replace(scenario, robots=robots)


def turned(scenario: Scenario) -> Scenario:
    """Return the scenario with free start headings for the robots that can turn on the spot."""
    robots = tuple(
        robot if robot.min_turn_radius > 0.0 else replace(robot, start=robot.start[:2])
        for robot in scenario.robots
    )
    return replace(scenario, robots=robots)


def _closed_via(scenario: Scenario, name: str) -> tuple[Point, ...]:
    """Return the via points that keep a robot from its goal, if it has a way without them.

    These are the via points that the robot cannot reach.  If it can reach each of them alone, but
    not all of them one after another, they are the last ones on its list, as few as possible.
    """
    robot = next(robot for robot in scenario.robots if robot.id == name)
    if not robot.via or _has_way(scenario, robot):
        return ()
    straight = replace(robot, via=())
    if not _has_way(scenario, straight):
        return ()
    closed = [place for place in robot.via if not _has_way(scenario, replace(straight, goal=place))]
    if closed:
        return tuple(closed)
    few = range(len(robot.via) - 1, 0, -1)
    kept = next((n for n in few if _has_way(scenario, replace(robot, via=robot.via[:n]))), 0)
    return robot.via[kept:]


def _has_way(scenario: Scenario, robot: Robot) -> bool:
    """Return whether a robot would have a way to its goal if it were alone."""
    try:
        Pathfinder(replace(scenario, robots=(robot,))).path(0)
    except PlanError:
        return False
    return True


def _blamed(scenario: Scenario, error: PlanError) -> str:
    """Return the robot that an error blames; if it blames none, the last robot of the scenario."""
    names = [robot.id for robot in scenario.robots]
    return error.blames if error.blames in names else names[-1]
