"""Why robots block each other: the error with its facts, and its sentence.

Decides: which robot is blamed, the sentence, and what would help.  Must not know: how orders and
detours are searched.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, Literal, NamedTuple

import numpy as np

from coordinator.base.errors import PlanError
from coordinator.scenario.model import Scenario
from coordinator.schedule.junctions import Junctions

How = Literal["either order", "no order", "among others", "ring"]
"""Two robots block each other in either order; no order was found for two robots, alone or only
among the others; or robots block each other in a ring."""

_FEWER: Final = "A wider passage, a smaller margin or fewer robots"
_PASS: Final = "A wider passage or a place to pass each other"
_OTHER_PATH: Final = "Another path for one of them"

_NAMED: Final = 3
"""How many of the robots are named that have to drive as they are told; others are counted."""


class PlaceOnWay(NamedTuple):
    """A robot's start or goal, or its place if it is idle, at (x, y) [m] on another robot's way."""

    robot: str
    end: Literal["start", "goal", "place"]
    x: float
    y: float
    on_way_of: str


class BlockedError(PlanError):
    """Robots block each other because `places` lie on their ways, and no detour was found.

    The robot on whose way the last of the places lies is blamed; without places, the last robot.
    is_given: all of these robots drive given paths, which are never changed.
    """

    def __init__(
        self, robots: Sequence[str], how: How, places: Sequence[PlaceOnWay], is_given: bool
    ) -> None:
        blames = places[-1].on_way_of if places else robots[-1]
        where = (places[-1].x, places[-1].y) if places else None
        helps = _OTHER_PATH if is_given else _helps(how, places)
        said = _said(robots, how, places)
        if how in ("either order", "ring") and not is_given:
            said = f"on the ways that were found, {said}"
        super().__init__(said, blames=blames, place=where, helps=helps)
        self.robots = tuple(robots)
        self.how = how
        self.places = tuple(places)
        self.is_given = is_given
        self.kept: tuple[str, ...] = ()
        """Robots of the fleet that keep to one way each, and do not make room for others."""

    def kept_by(self, kept: Sequence[str]) -> BlockedError:
        """Return the error with the robots of the fleet that keep to one way each."""
        self.kept = tuple(kept)
        return self

    @property
    def sentence(self) -> str:
        """The error in words."""
        why = ""
        if self.kept and not self.is_given:
            more = f" and {len(self.kept) - _NAMED} more" if len(self.kept) > _NAMED else ""
            who, does, have = ", ".join(self.kept[:_NAMED]), "does", "has"
            if len(self.kept) > 1:
                does, have = "do", "have"
            why = (
                f", and {who}{more} {does} not step aside for others, because of the via points, "
                f"min_turn_radius or path that {'they' if have == 'have' else 'it'} {have}"
            )
        return f"{self.reason}; no way around was found{why}. {self.helps} would help"


def pair_error(
    scenario: Scenario, junctions: Junctions, pair: tuple[int, int], *, among_others: bool = False
) -> BlockedError:
    """Return the error for two robots that cannot both arrive, in whatever order.

    `among_others`: the two could pass each other if the other robots were not there.
    """
    a, b = pair
    first = _places_on(scenario, junctions, a, b, "start")
    first += _places_on(scenario, junctions, b, a, "goal")
    last = _places_on(scenario, junctions, b, a, "start")
    last += _places_on(scenario, junctions, a, b, "goal")
    how: How = "among others" if among_others else "no order"
    if first and last and not among_others:
        how = "either order"
    return _error(scenario, pair, how, list(dict.fromkeys([*first, *last])))


def ring_error(scenario: Scenario, junctions: Junctions, ring: Sequence[int]) -> BlockedError:
    """Return the error for robots of which each has to go before the next, in a ring."""
    places: list[PlaceOnWay] = []
    for me, other in zip(ring, [*ring[1:], ring[0]], strict=True):
        starts = _places_on(scenario, junctions, me, other, "start")
        goals = _places_on(scenario, junctions, other, me, "goal")
        places += (starts or goals)[:1]
    return _error(scenario, ring, "ring", places)


def _error(
    scenario: Scenario, indices: Sequence[int], how: How, places: Sequence[PlaceOnWay]
) -> BlockedError:
    robots = [scenario.robots[index] for index in indices]
    is_given = all(robot.path is not None for robot in robots)
    return BlockedError([robot.id for robot in robots], how, places, is_given)


def _helps(how: How, places: Sequence[PlaceOnWay]) -> str:
    """Return what would help: to free the way of the robot that is blamed, or an idle one's place.

    A robot without a goal can stand elsewhere; where no place is on a way, all is too narrow.  Two
    that block each other in either order have to pass each other, wherever their goals are.
    """
    if not places:
        return _FEWER
    idle = next((one.robot for one in places if one.end == "place"), None)
    if idle is not None:
        return f"Another place for {idle}, which has no goal, or a wider passage"
    if how == "either order":
        return _PASS
    last = places[-1]
    other = f"another {last.end} for {last.robot}"
    return f"A wider passage, {other} or a via point for {last.on_way_of}"


def _said(robots: Sequence[str], how: How, places: Sequence[PlaceOnWay]) -> str:
    """Return who blocks whom, and where."""
    listed = ", ".join(
        f"{one.robot}'s {one.end} ({one.x:.2f}, {one.y:.2f}) lies on {one.on_way_of}'s way"
        for one in places
    )
    if how == "ring":
        return f"{', '.join(robots)} block each other in a ring: {listed}"
    both = f"{robots[0]} and {robots[1]}"
    if how == "among others":
        said = f"no order of the whole fleet was found in which {both} both arrive"
        return f"{said}: {listed}" if places else said
    if how == "either order":
        return f"{both} block each other whoever goes first: {listed}"
    near = f"{both} come near each other on their ways"
    return f"no order was found in which {both} both arrive: {listed or near}"


def _places_on(
    scenario: Scenario, junctions: Junctions, me: int, other: int, end: Literal["start", "goal"]
) -> list[PlaceOnWay]:
    """Return my start (or my goal) if a zone shared with the other robot contains it."""
    zones = junctions.zones
    low = np.where(zones.a == me, zones.extent[:, 0], zones.extent[:, 2])
    high = np.where(zones.a == me, zones.extent[:, 1], zones.extent[:, 3])
    both = ((zones.a == me) & (zones.b == other)) | ((zones.a == other) & (zones.b == me))
    holds = low <= 0.0 if end == "start" else high >= junctions.lengths()[me]
    if not (both & holds).any():
        return []
    robot, theirs = scenario.robots[me], scenario.robots[other].id
    x, y = (robot.start if end == "start" else robot.goal)[:2]
    return [PlaceOnWay(robot.id, "place" if robot.is_idle else end, x, y, theirs)]
