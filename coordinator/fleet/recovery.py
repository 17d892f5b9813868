"""A new plan for a fleet that rests: around the lost, from where the others stand.

Decides: who drives on and who stays.  Must not know: messages, clocks.  The same inputs give the
same plan: replay relies on it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from dataclasses import replace as changed
from typing import Final

from msgspec.structs import replace

from coordinator.base.errors import PlanError
from coordinator.fleet.disbelieved_places import doubtful
from coordinator.fleet.replanning_input import Site, next_site, passable
from coordinator.fleet.rest_places import Standing
from coordinator.paths.path_planner import Pathfinder
from coordinator.plan.document import PlanDocument
from coordinator.plan.wire import PackedPlan
from coordinator.scenario.model import Point, Robot, Scenario

_GENTLE: Final = 0.05
"""Least radius of turns [m]: robots that stop anywhere face anywhere, and via points may ask for
needles that a robot which turns on the spot could drive in theory."""

Planner = Callable[[Scenario, int], PackedPlan]
"""Plans a scenario for an epoch; raises PlanError."""


@dataclass(frozen=True, eq=False)
class Recovery:
    """The site as it is now, the plan for those that can drive on (None: nobody can), in words.

    `stays`: the robots that stay where they are, and why.  `doubted`: those of them that have come
    back and say a place which is not believed.
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
    documents: Mapping[int, PlanDocument],
    told: Sequence[Standing],
    epoch: int,
    plan: Planner,
) -> Recovery:
    """Plan a fleet anew from where its robots stand, `documents` being the plans by epoch so far.

    A robot that has no way, or that no order of robots lets through, stays where it is; the others
    are planned around it.  One on a given path looks for a way of its own before that.  Only when
    nobody can drive on are via points left out that are closed off: whoever closes them may move.
    A robot that has come back and cannot stand where it says is taken to be where it was.
    """
    now = next_site(site, documents, told)
    doubts = doubtful(now, told)
    if doubts:
        now = next_site(site, documents, [_unbelieved(s) if s.robot in doubts else s for s in told])
    now, dropped = passable(now)
    said = [*(f"{name} stays where it is: {why}" for name, why in doubts.items()), *dropped]
    found = _with_those_that_can(now, said, epoch, plan, every_via=True)
    if found.document is None and any(robot.via for robot in now.scenario.robots):
        fewer = _with_those_that_can(now, said, epoch, plan, every_via=False)
        found = found if fewer.document is None else fewer
    return changed(found, stays={**doubts, **found.stays}, doubted=tuple(doubts))


def _unbelieved(standing: Standing) -> Standing:
    """Return what is known of a robot whose place is not believed: nothing new."""
    return Standing(robot=standing.robot, state="lost", epoch=0)


def _with_those_that_can(
    site: Site, known: Sequence[str], epoch: int, plan: Planner, *, every_via: bool
) -> Recovery:
    """Plan for as many robots as can drive on; what is `known` is said before who stays.

    every_via: or leave out those that are closed off.
    """
    said = list(known)
    stays: dict[str, str] = {}
    while site.scenario.robots:
        scenario = site.planned()
        try:
            return Recovery(site, _plan(scenario, epoch, plan), tuple(said), stays)
        except PlanError as error:
            stay = _closed_in(turned(scenario)) or {_blamed(scenario, error): error}
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
    """Plan with turns that are easy to drive, after turning on the spot if need be, or with any."""
    for asked in (_gentle(scenario), _gentle(turned(scenario)), scenario):
        with suppress(PlanError):
            return plan(asked, epoch)
    return plan(turned(scenario), epoch)


def _gentle(scenario: Scenario) -> Scenario:
    """Return the scenario with robots that take their turns wide."""
    robots = tuple(
        replace(robot, min_turn_radius=max(robot.min_turn_radius, _GENTLE))
        for robot in scenario.robots
    )
    return replace(scenario, robots=robots)


def turned(scenario: Scenario) -> Scenario:
    """Return the scenario with robots that turn on the spot facing anywhere at their starts."""
    robots = tuple(
        robot if robot.min_turn_radius > 0.0 else replace(robot, start=robot.start[:2])
        for robot in scenario.robots
    )
    return replace(scenario, robots=robots)


def _closed_in(scenario: Scenario) -> dict[str, PlanError]:
    """Return the robots that have no way to their goals even alone, and why."""
    finder = Pathfinder(scenario)
    closed = {}
    for index, robot in enumerate(scenario.robots):
        try:
            finder.path(index)
        except PlanError as error:
            closed[robot.id] = error
    return closed


def _closed_via(scenario: Scenario, name: str) -> tuple[Point, ...]:
    """Return the via points by which a robot has no way, though it has one to its goal.

    Those that it cannot get to, else as few of the last as will do.
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
    """Tell whether a robot has a way to its goal if there were no other."""
    try:
        Pathfinder(replace(scenario, robots=(robot,))).path(0)
    except PlanError:
        return False
    return True


def _blamed(scenario: Scenario, error: PlanError) -> str:
    """Return the robot that an error blames, or the last one: the others were there before it."""
    names = [robot.id for robot in scenario.robots]
    return error.blames if error.blames in names else names[-1]
