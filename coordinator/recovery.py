"""A new plan for a fleet that rests: around the lost, from where the others stand.

Decides: who drives on and who stays.  Must not know: messages, clocks.  The same inputs give the
same plan: replay relies on it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from coordinator.errors import PlanError
from coordinator.paths import Pathfinder
from coordinator.plan import PlanDocument
from coordinator.scenario import Scenario
from coordinator.site import Site, next_site, passable
from coordinator.standing import Standing

Planner = Callable[[Scenario, int], PlanDocument]
"""Plans a scenario for an epoch; raises PlanError."""


@dataclass(frozen=True, eq=False)
class Recovery:
    """The site as it is now, the plan for those that can drive on (None: nobody can), in words."""

    site: Site
    document: PlanDocument | None
    said: tuple[str, ...]


def recover(
    site: Site,
    documents: Mapping[int, PlanDocument],
    told: Sequence[Standing],
    epoch: int,
    plan: Planner,
) -> Recovery:
    """Plan a fleet anew from where its robots stand, `documents` being the plans by epoch so far.

    A robot that has no way, or that no order of robots lets through, stays where it is; the others
    are planned around it.
    """
    site, said = passable(next_site(site, documents, told))
    while site.scenario.robots:
        scenario = site.planned()
        try:
            return Recovery(site, plan(scenario, epoch), tuple(said))
        except PlanError as error:
            stay = _closed_in(scenario) or _blamed(scenario, str(error))
        for name, why in stay.items():
            said.append(f"{name} stays where it is: {why}")
            site = site.without(name)
    return Recovery(site, None, tuple(said))


def _closed_in(scenario: Scenario) -> dict[str, str]:
    """Return the robots that have no way to their goals even alone, and why."""
    finder = Pathfinder(scenario)
    closed = {}
    for index, robot in enumerate(scenario.robots):
        try:
            finder.path(index)
        except PlanError as error:
            closed[robot.id] = str(error)
    return closed


def _blamed(scenario: Scenario, sentence: str) -> dict[str, str]:
    """Return the robot that a sentence names last: the others were there before it."""
    names = {robot.id for robot in scenario.robots}
    named = [word for word in re.findall(r"[A-Za-z0-9_.-]+", sentence) if word in names]
    return {named[-1] if named else scenario.robots[-1].id: sentence}
