"""Explaining why there is no way: what closes a robot in, and how small it must be to get out.

Decides: the wording.  Must not know: how ways are found.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Final

import numpy as np
import shapely

from coordinator.base.errors import PlanError
from coordinator.curves.nurbs import Array
from coordinator.ground.free_space import NO_DISCS, Space
from coordinator.ground.grown_floor import GrownFloor
from coordinator.ground.growth import TURN_STEP
from coordinator.scenario.model import MapPart, Robot

_NAMED: Final = 4
_LEAST: Final = 1e-3
"""A smaller radius [m] is not recommended, as scenarios refuse it."""


class NoWayError(PlanError):
    """There is no way from start to goal (2,) [m] in a space; `explain` finds the reason later."""

    def __init__(self, space: Space, start: Array, goal: Array) -> None:
        super().__init__("no way")
        self.space, self.start, self.goal = space, start, goal


class EnclosedError(PlanError):
    """A robot has no way to a `place`; a robot of `radius` [m] would pass.

    The radius is 0 if no robot would pass, None if only other starts or goals could help.
    `closed`: what the robot has at the place that is closed in, its goal for instance.
    """

    def __init__(
        self, reason: str, place: tuple[float, float], radius: float | None, closed: str
    ) -> None:
        helps = f"another {closed} or fewer obstacles"
        helps = "other starts or goals" if radius is None else helps
        super().__init__(reason, place=place, helps="" if radius else helps)
        self.radius = radius

    @property
    def sentence(self) -> str:
        """The error in words, without the name of the robot concerned."""
        passes = f"; a radius of {self.radius:.3f} m would pass" if self.radius else ""
        return super().sentence + passes


def explain(
    error: NoWayError, floor: GrownFloor, robot: Robot, margin: float, part: MapPart | None = None
) -> PlanError:
    """Return an error that says what closes the robot in, and what would help.

    `part`: which of the floor's obstacles come from a map.
    """
    space, start, goal = error.space, error.start, error.goal
    reach = space.ground.reach
    pieces = floor.free(reach)
    rooms = [_around(pieces, place) for place in (start, goal)]
    shut, closed = [room for room in rooms if room is not None], goal
    if len(shut) == 2 and shut[0] is not shut[1]:
        smaller = min(shut, key=shapely.area)
        closed = start if smaller is shut[0] else goal
        closing = _names_near(floor, smaller, reach, part)
        more = f" and {len(closing) - _NAMED} more" if len(closing) > _NAMED else ""
        by = " and ".join(closing[:_NAMED]) + more + " close it in"
    elif len(shut) == 2 and len(space.discs):
        by = "other robots' places close it in"
    else:
        by = "it does not fit between what stands there"
        for x, y in (start, goal):
            if not shapely.intersects_xy(floor.outline, x, y):
                by = f"({x:.2f}, {y:.2f}) is off the floor"
    return EnclosedError(
        f"has no way from ({start[0]:.2f}, {start[1]:.2f}) to ({goal[0]:.2f}, {goal[1]:.2f}) for "
        f"radius {robot.radius:.6g} m + margin {margin:.6g} m: {by}",
        (float(goal[0]), float(goal[1])),
        _largest_radius(error, floor, robot, margin),
        _what_is_at(robot, closed),
    )


def _what_is_at(robot: Robot, place: Array) -> str:
    """Return what a robot has at a place that it has to pass."""
    ends = {"start": robot.start[:2], "goal": robot.goal[:2]}
    return next((what for what, end in ends.items() if np.array_equal(end, place)), "via point")


def _around(pieces: list[shapely.Geometry], place: Array) -> shapely.Geometry | None:
    """Return the piece of free ground that contains a place or has it on its edge."""
    if not pieces:
        return None
    apart = shapely.distance(pieces, shapely.Point(place))
    nearest = int(np.argmin(apart))
    return pieces[nearest] if apart[nearest] < 1e-2 else None


def _names_near(
    floor: GrownFloor, area: shapely.Geometry, reach: float, part: MapPart | None
) -> list[str]:
    """Name the obstacles (and the floor's edge) that bound a piece of free ground."""
    most = reach * 1.1 + 0.01
    shapely.prepare(area)
    near = np.flatnonzero(shapely.dwithin(area, floor.obstacles, most)).tolist()
    names = [floor.name(index, area, part) for index in near]
    if shapely.dwithin(area, floor.outline.exterior, most):
        names.append("the floor's edge")
    return names


def _largest_radius(
    error: NoWayError, floor: GrownFloor, robot: Robot, margin: float
) -> float | None:
    """Return the largest radius [m] with which a robot has a way, in whole millimetres.

    0 if there is none; None if only other starts or goals could help.
    """
    ground, radius = error.space.ground, robot.radius
    places = np.array([robot.start[:2], *robot.via, robot.goal[:2]])
    # Graphs are seldom needed, and importing them takes as long as planning a small fleet.
    from coordinator.ground.widest_passage import widest_reach

    widest = math.inf
    for ends in pairwise(places):
        reach = widest_reach(ground.rings, *ends, ground.reach)
        if reach is not None:
            widest = min(widest, reach)
        elif np.array_equal(ends, (error.start, error.goal)):
            return None
    for share in (1.0, math.cos(0.5 * TURN_STEP)):
        fits = math.floor(1e3 * (min(share * widest - margin, radius - _LEAST) + 1e-9)) / 1e3
        if fits < _LEAST:
            break
        fresh = floor.fresh_ground(fits + margin)
        if all(fresh.shortest_way(*ends, NO_DISCS) is not None for ends in pairwise(places)):
            return fits
    return 0.0
