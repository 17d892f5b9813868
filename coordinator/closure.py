"""Why there is no way: what closes a robot in, and how small it would have to be to get out.

Decides: the words.  Must not know: how ways are found.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import shapely

from coordinator.errors import PlanError
from coordinator.floor import Floor
from coordinator.nurbs import Array
from coordinator.scenario import Robot
from coordinator.space import NO_DISCS, Space

_HALVINGS: Final = 8
_NAMED: Final = 4


class NoWayError(PlanError):
    """There is no way from start to goal (2,) [m] in a space; words are found when it is told."""

    def __init__(self, space: Space, start: Array, goal: Array) -> None:
        super().__init__("no way")
        self.space, self.start, self.goal = space, start, goal


def explain(error: NoWayError, floor: Floor, robot: Robot, margin: float) -> PlanError:
    """Return the error with what closes the robot in, and what would help."""
    space, start, goal = error.space, error.start, error.goal
    reach = space.ground.reach
    pieces = floor.free(reach)
    rooms = [_around(pieces, place) for place in (start, goal)]
    shut = [room for room in rooms if room is not None]
    if len(shut) == 2 and shut[0] is not shut[1]:
        closing = floor.names_near(min(shut, key=shapely.area), reach)
        more = f" and {len(closing) - _NAMED} more" if len(closing) > _NAMED else ""
        by = " and ".join(closing[:_NAMED]) + more + " close it in"
    elif len(shut) == 2 and len(space.discs):
        by = "other robots' places close it in"
    else:
        by = "it does not fit between what stands there"
    return PlanError(
        f"no way from ({start[0]:.2f}, {start[1]:.2f}) to ({goal[0]:.2f}, {goal[1]:.2f}) for "
        f"radius {robot.radius} m + margin {margin} m: {by}"
        f"{_what_helps(floor, robot.radius, margin, start, goal)}"
    )


def _around(pieces: list[shapely.Geometry], place: Array) -> shapely.Geometry | None:
    """Return the piece of free ground that a place lies in, or at."""
    if not pieces:
        return None
    apart = shapely.distance(pieces, shapely.Point(place))
    nearest = int(np.argmin(apart))
    return pieces[nearest] if apart[nearest] < 1e-2 else None


def _what_helps(floor: Floor, radius: float, margin: float, start: Array, goal: Array) -> str:
    """Return the largest radius for which there is a way, found by halving."""
    low, high = 0.0, radius
    for _ in range(_HALVINGS):
        trial = 0.5 * (low + high)
        if floor.fresh_ground(trial + margin).shortest_way(start, goal, NO_DISCS) is None:
            high = trial
        else:
            low = trial
    if low <= 0.0:
        return "; another goal or fewer obstacles would help"
    return f"; a radius of {low:.3f} m would pass"
