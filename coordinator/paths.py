"""One path per robot: around obstacles, off the places of other robots, smooth.

Decides: the way each robot takes, alone.  Must not know: times and who goes first.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise, product
from typing import Final

import numpy as np
import shapely
from msgspec.structs import replace

from coordinator.errors import PlanError, TurnError
from coordinator.floor import Disc, Floor, Ground, as_array
from coordinator.nurbs import Array, Nurbs
from coordinator.route import shortest_way
from coordinator.scenario import Point, Robot, Scenario
from coordinator.smoothing import Flags, smooth

_ROOMS: Final = (0.02, 0.003)
"""Room for rounding corners [m]: the first that leaves a way is taken."""

_TOUCH: Final = 0.0005
"""Curves keep this much more [m] than needed: float32 and the samples between which they bend."""

_FLUSH: Final = 2e-6
"""What float32 takes [m] from a robot that stands exactly as near as it may."""

_LEAD_PER_RADIUS: Final = 6.0
_ROOM_PER_RADIUS: Final = 2.2
"""What turning takes, per metre of min_turn_radius: a straight lead, and the reach around corners
whose 45 degree steps leave about 0.46 of it as radius."""

_PLACE_ROOM: Final = 0.015
"""Other robots' places are passed this much farther off [m] than needed: a conflict zone may be a
little larger than the conflict, and must not reach from a place to a path that keeps off it."""

_NEAR: Final = 1.015
"""A place as near to this robot's own as this share beyond the disc is seen as a finer polygon."""

_LEADS: Final = (0.6, 0.3, 0.15, 0.08)


class Pathfinder:
    """Finds the robots' paths on one floor."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        workspace = scenario.workspace
        self.floor = Floor(workspace.boundary, workspace.obstacles)

    def path(self, index: int, detours: Sequence[Disc] = (), refuge: Point | None = None) -> Nurbs:
        """Return robot `index`'s path; it keeps off other robots' starts and goals if it can.

        `detours`: further places to keep off; `refuge`: a place to pass before all via points.
        Raises PlanError when there is no way.
        """
        robot = self.scenario.robots[index]
        if refuge is not None:
            robot = replace(robot, via=(refuge, *robot.via))
        starts, goals = self._places(index)
        worst: PlanError | None = None
        trials = product(([*starts, *goals], goals, starts, []), _rooms(robot), _lead_shares(robot))
        for places, room, share in trials:
            try:
                return self._path_among(robot, [*places, *detours], room, share)
            except TurnError as error:
                if not isinstance(worst, TurnError) or error.radius > worst.radius:
                    worst = error
            except PlanError as error:
                worst = worst if isinstance(worst, TurnError) else error
        raise PlanError(f"{robot.id}: {worst}")

    def _places(self, index: int) -> tuple[list[Disc], list[Disc]]:
        """Return the discs of the other robots' starts and goals that this one can keep off."""
        me, robots = self.scenario.robots[index], self.scenario.robots
        anchors = np.array([me.start[:2], *me.via, me.goal[:2]])
        found: tuple[list[Disc], list[Disc]] = ([], [])
        for other in robots[:index] + robots[index + 1 :]:
            need = self.scenario.need(me, other)
            for discs, (x, y, *_) in zip(found, (other.start, other.goal), strict=True):
                nearest = float(np.hypot(*(anchors - (x, y)).T).min())
                reach = min(need + _PLACE_ROOM, nearest / _NEAR)
                if nearest > 1.15 * reach:
                    discs.append(Disc(x, y, reach))
                elif reach > need + 2.0 * _TOUCH:
                    discs.append(Disc(x, y, reach, sides=24))
        return found

    def _path_among(
        self, robot: Robot, discs: Sequence[Disc], room: float, lead_share: float
    ) -> Nurbs:
        reach = robot.radius + self.scenario.margin
        anchors = as_array([robot.start[:2], *robot.via, robot.goal[:2]])
        spare = float(self.floor.distance(anchors).min()) - reach - _FLUSH
        touch = min(max(spare, 0.0), _TOUCH)
        ground = self.floor.ground(reach + touch, room, discs)

        def clear(points: Array) -> Flags:
            free = self.floor.distance(points) >= reach + 0.5 * touch - _FLUSH
            for disc in discs:
                free &= np.hypot(points[:, 0] - disc.x, points[:, 1] - disc.y) >= disc.radius
            return free

        polygon, exact = self._polygon(robot, ground, lead_share)
        headed = (len(robot.start) == 3, len(robot.goal) == 3)
        return smooth(polygon, exact, clear, robot.min_turn_radius, headed)

    def _polygon(self, robot: Robot, ground: Ground, lead_share: float) -> tuple[Array, Flags]:
        """Return the control polygon (n, 2) and which vertices are passed exactly."""
        begin, *via, end = as_array([robot.start[:2], *robot.via, robot.goal[:2]])
        wide = max(_LEAD_PER_RADIUS * robot.min_turn_radius, _LEADS[0])
        first, last = (via[0], via[-1]) if via else (end, begin)
        anchors = [begin]
        for pose, sign, towards in ((robot.start, 1.0, first), (robot.goal, -1.0, last)):
            longest = lead_share * min(wide, 0.45 * float(np.hypot(*(towards - pose[:2]))))
            anchors += _lead(pose, sign, ground, longest)
            anchors += via if sign > 0.0 else [end]
        vertices, exact = [anchors[0]], [True]
        for start, goal in pairwise(anchors):
            way = shortest_way(ground, start, goal)
            if way is None:
                raise self._no_way(robot, ground, start, goal)
            vertices += list(way[1:])
            exact += [False] * (len(way) - 2) + [any(goal is point for point in via)]
        exact[-1] = True
        return np.array(vertices), np.array(exact)

    def _no_way(self, robot: Robot, ground: Ground, start: Array, goal: Array) -> PlanError:
        """Say what closes the robot in, and how small it would have to be to pass."""
        free = shapely.difference(self.floor.outline, ground.blocked)
        here = shapely.Point(start)
        pieces = shapely.get_parts(free)
        rooms = pieces[shapely.distance(pieces, here) < 1e-6]
        closing = (
            self.floor.names_near(rooms[0], robot.radius + self.scenario.margin)
            if len(rooms)
            else []
        )
        by = " and ".join(closing[:4]) or "other robots' places"
        return PlanError(
            f"no way from ({start[0]:.2f}, {start[1]:.2f}) to ({goal[0]:.2f}, {goal[1]:.2f}) for "
            f"radius {robot.radius} m + margin {self.scenario.margin} m: {by} close it in"
            f"{self._what_helps(robot, start, goal)}"
        )

    def _what_helps(self, robot: Robot, start: Array, goal: Array) -> str:
        """Return the largest radius for which there is a way, found by halving."""
        low, high = 0.0, robot.radius
        for _ in range(8):
            radius = 0.5 * (low + high)
            ground = self.floor.ground(radius + self.scenario.margin + _TOUCH, _ROOMS[-1])
            if shortest_way(ground, start, goal) is None:
                high = radius
            else:
                low = radius
        if low <= 0.0:
            return "; another goal or fewer obstacles would help"
        return f"; a radius of {low:.3f} m would pass"


def _rooms(robot: Robot) -> list[float]:
    """Return the rooms [m] to try for rounding corners; robots that turn wide want more first."""
    wide = _ROOM_PER_RADIUS * robot.min_turn_radius - robot.radius
    return [wide, *_ROOMS] if wide > _ROOMS[0] else list(_ROOMS)


def _lead_shares(robot: Robot) -> tuple[float, ...]:
    """Return which shares of the longest lead to try: a shorter one may turn wider."""
    headed = len(robot.start) == 3 or len(robot.goal) == 3
    return (1.0, 0.5, 0.25) if headed and robot.min_turn_radius > 0.0 else (1.0,)


def _lead(pose: Sequence[float], sign: float, ground: Ground, longest: float) -> list[Array]:
    """Return the point that makes the path leave (or reach) a place with its heading."""
    if len(pose) < 3:
        return []
    place = np.array(pose[:2], dtype=np.float64)
    along = sign * np.array([math.cos(pose[2]), math.sin(pose[2])])
    for size in (longest, *(lead for lead in _LEADS if lead < longest)):
        point = place + size * along
        if bool(ground.clear(place, point[None, :])[0]):
            return [point]
    raise PlanError(
        f"no room to move along heading {pose[2]:.2f} rad at ({pose[0]:.2f}, {pose[1]:.2f})"
    )
