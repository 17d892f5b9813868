"""Finding one smooth path per robot, around obstacles and other robots' starts and goals.

Decides: the way each robot takes, alone.  Must not know: times and who goes first.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager, suppress
from functools import partial
from itertools import pairwise
from typing import Final

import numpy as np
from msgspec.structs import replace

from coordinator.base.errors import CoarseError, PlanError, TurnError
from coordinator.curves.bounds import flatten
from coordinator.curves.nurbs import Array, Nurbs
from coordinator.ground.distance_kernels import entered, nearest_of
from coordinator.ground.enclosure import NoWayError, explain
from coordinator.ground.free_space import DISC_TOLERANCE, NO_DISCS, Space
from coordinator.ground.grown_floor import GrownFloor
from coordinator.motion.cornering import Handling
from coordinator.paths.dubins import turning_ways
from coordinator.paths.end_heading_choice import COMFORTABLE, Leads, choices
from coordinator.paths.end_headings import check_headings
from coordinator.paths.given_path import given_curve
from coordinator.paths.smoothing import least_radius, smooth
from coordinator.paths.spline_fit import Fit
from coordinator.paths.spline_fit_kernels import Flags, lengths_along
from coordinator.paths.stub import stub
from coordinator.scenario.model import Point, Robot, Scenario

_TOUCH: Final = 0.0005
"""Ways stay clear by this much more [m] than needed; float32 and chords may use half of it."""

_FLUSH: Final = 2e-6
"""Allowance [m] for float32 rounding where a robot stands exactly as near to something solid as is
allowed."""

_ROOM_PER_RADIUS: Final = 2.2
"""Distance that ways keep from the corners at which they turn, per metre of min_turn_radius."""

_ENOUGH: Final = 2
"""Number of paths of which the quickest is taken, if one of them has turns wide enough."""

_MOST_TIGHT: Final = 8
"""Number of paths of which the one with the widest turns is taken, if none is wide enough."""

_MOST_TRIED: Final = 24
"""How many pairs of leads are tried: if none of these fits, there is no room."""

_TURNS: Final = (1.0, 1.1, 1.3)
"""Radii of turns that are tried, per metre of min_turn_radius: short arcs need some in reserve."""

_PLACE_ROOM: Final = 0.015
"""Paths pass other robots' starts and goals this much farther off [m] than needed.  A conflict zone
may be a little larger than the conflict; without this room it could include such a place although
the path avoids it."""

_PARKED_ROOM: Final = 0.001
"""Paths pass parked robots at least this much farther off [m] than needed."""

_NEAR: Final = 1.015
"""The centre of a disc to avoid is at least this many of its radii from the robot's own places."""

_FAILED: Final = 5
"""After this many searches without a way, a coarse grid is asked first whether there is none."""

_PART: Final = 50
"""The least number of robots in a task for an executor: each task computes its own ground."""

_MOST_PARTS: Final = 4


def find_paths(
    finder: Pathfinder, executor: Executor | None = None, indices: Sequence[int] | None = None
) -> list[Nurbs]:
    """Return the paths of all robots (or of some, by index); the same whatever the executor.

    Raises PlanError for the first robot that has no way.
    """
    chosen = range(len(finder.scenario.robots)) if indices is None else indices
    parts = min(-(-len(chosen) // _PART), _MOST_PARTS)
    if executor is None or parts < 2:
        return [finder.path(index) for index in chosen]
    shares = [array.tolist() for array in np.array_split(np.array(chosen), parts)]
    waiting = [executor.submit(_paths_of, finder.scenario, share) for share in shares]
    return [path for share in waiting for path in share.result()]


def _paths_of(scenario: Scenario, indices: Sequence[int]) -> list[Nurbs]:
    return find_paths(Pathfinder(scenario), None, indices)


def closed_in(scenario: Scenario) -> dict[str, PlanError]:
    """Return the robots that would have no way to their goals even if they were alone, and why."""
    finder = Pathfinder(scenario)
    closed = {}
    for index, robot in enumerate(scenario.robots):
        try:
            finder.path(index)
        except PlanError as error:
            closed[robot.id] = error
    return closed


class Pathfinder:
    """A search for the robots' paths on one floor; `floor`: that of the scenario, if it is made.

    `parked`: indices of robots that stay at their starts for ever; no path leads through these.
    """

    def __init__(
        self,
        scenario: Scenario,
        floor: GrownFloor | None = None,
        parked: Sequence[int] = (),
    ) -> None:
        self.scenario = scenario
        workspace = scenario.workspace
        self.floor = floor or GrownFloor(workspace.boundary, workspace.obstacles, workspace.names)
        self._starts = np.array([robot.start[:2] for robot in scenario.robots])
        self._goals = np.array([robot.goal[:2] for robot in scenario.robots])
        self._radii = np.array([robot.radius for robot in scenario.robots])
        self._parked = np.zeros(len(scenario.robots), bool)
        self._parked[list(parked)] = True
        self._failed = 0

    def path(self, index: int, detours: Array = NO_DISCS, refuge: Point | None = None) -> Nurbs:
        """Return robot `index`'s path; it avoids other robots' starts and goals if possible.

        `detours` (k, 3) [m]: further discs to avoid, x, y, radius; `refuge`: a place to pass before
        all via points.  Raises PlanError if there is no way, or if a given path cannot be driven or
        would have to change, or if an idle robot would have to move.
        """
        robot, fixed = self.scenario.robots[index], not len(detours) and refuge is None
        if robot.is_idle:
            if not fixed:
                raise PlanError("stays at its start, it has no goal", robot.id)
            return stub(robot, partial(self._spare, index))
        if robot.path is not None:
            if not fixed:
                raise PlanError("keeps the path that it was given", robot.id)
            with _named(robot):
                return given_curve(robot, robot.path, self.scenario.margin, self.floor)
        return self.fit(index, detours, refuge).curve

    def fit(
        self,
        index: int,
        detours: Array = NO_DISCS,
        refuge: Point | None = None,
        lead: Point | None = None,
    ) -> Fit:
        """Return robot `index`'s path as `path` does, with the polygon it was made from.

        `lead`: a place [m] towards which a path without a heading at its start begins, and turns
        there.  Only without detours the error says what closes the robot in.
        """
        robot = self.scenario.robots[index]
        if refuge is not None:
            robot = replace(robot, via=(refuge, *robot.via))
        worst: PlanError | None = None
        tried = 0
        for places in self._places(robot, index):
            tried += 1
            discs = np.concatenate((places, detours))
            for room, touch in _rooms(robot):
                try:
                    return self._fit_among(robot, self._space(robot, discs, room, touch), lead)
                except TurnError as error:
                    if not isinstance(worst, TurnError) or error.radius > worst.radius:
                        worst = error
                except PlanError as error:
                    worst = worst if isinstance(worst, (TurnError, CoarseError)) else error
        if tried > 1 and self._parked.any() and isinstance(worst, NoWayError):
            # Only a robot that has a way among obstacles alone is offered several sets.
            worst = PlanError("has no way past robots that are parked")
        elif isinstance(worst, NoWayError) and not len(detours):
            part = self.scenario.workspace.from_map
            worst = explain(worst, self.floor, robot, self.scenario.margin, part)
        assert worst is not None  # There is always some set of places to try.
        raise worst.about(robot.id)

    def crossed_places(self, index: int, curve: Nurbs) -> list[str]:
        """Return sentences on other robots' starts and goals that a path crosses.

        Such a place fixes which robot goes first.  The stub of an idle robot crosses none.
        """
        robot = self.scenario.robots[index]
        if robot.is_idle:
            return []
        need = self._radii + robot.radius + self.scenario.margin
        line = flatten(curve, _TOUCH).points
        said = []
        for name, places in (("start", self._starts), ("goal", self._goals)):
            hit = entered(line, np.column_stack((places, need)))
            hit[index] = False
            said += [
                f"{robot.id}'s path crosses {self.scenario.robots[other].id}'s {name}"
                for other in np.flatnonzero(hit).tolist()
            ]
        return said

    def handling(self, robot: Robot) -> Handling:
        """Return how a robot takes corners on its plan."""
        return Handling(
            speed=self.scenario.planned_speed(robot),
            accel=robot.max_accel,
            lateral=robot.max_lateral_accel,
            turning=robot.max_turn_rate,
            min_turn_radius=robot.min_turn_radius,
        )

    def space(self, robot: Robot) -> Space:
        """Return the space of a robot that is alone on the floor."""
        return self._space(robot, NO_DISCS)

    def space_among_places(self, index: int) -> Space:
        """Return the space of a robot that keeps off all other robots' starts and goals."""
        robot = self.scenario.robots[index]
        return self._space(robot, next(self._places(robot, index)))

    def _spare(self, index: int, place: Array) -> float:
        """Return by how much [m] a place is farther than needed from solids and others' places."""
        reach = float(self._radii[index]) + self.scenario.margin
        apart = np.hypot(*(np.concatenate((self._starts, self._goals)) - place).T)
        gaps = apart - np.tile(self._radii, 2)
        gaps[[index, index + len(self._radii)]] = math.inf
        return min(float(gaps.min()), float(self.floor.distance(place[None])[0])) - reach

    def _fit_among(self, robot: Robot, space: Space, lead: Point | None) -> Fit:
        """Return the quickest of the first paths whose turns are wide enough.

        If no path has such turns, returns the one with the widest turns.  If there is no path,
        raises the error of the attempt that got farthest.
        """
        handling = self.handling(robot)
        worst: PlanError | None = None
        made: list[tuple[float, float, Fit]] = []
        if lead is None and robot.min_turn_radius > 0.0 and all(_headed(robot)) and not robot.via:
            made += _turning(robot, space, handling)
        for ends in choices(robot, space, handling)[:_MOST_TRIED]:
            if lead is not None:
                ends = [np.array(lead)], ends[1]
            try:
                polygon, exact = self._polygon(robot, space, ends)
                found = smooth(polygon, exact, space, handling, (len(ends[0]), len(ends[1])))
                check_headings(robot, found.curve)
            except TurnError as error:
                if not isinstance(worst, TurnError) or error.radius > worst.radius:
                    worst = error
                continue
            except PlanError as error:
                worst = worst or error
                continue
            if not any(_headed(robot)):
                return found
            made.append(_judged(robot, found, handling))
            if len(made) >= (_ENOUGH if any(one[0] == 0.0 for one in made) else _MOST_TIGHT):
                break
        if made:
            return min(made, key=lambda one: one[:2])[2]
        raise worst or PlanError("there is no room to turn")

    def _space(self, robot: Robot, discs: Array, room: float = 0.0, most: float = _TOUCH) -> Space:
        reach = robot.radius + self.scenario.margin
        spares = self.floor.distance(_anchors(robot)) - reach
        if spares.min() < -_FLUSH:
            which = int(np.argmin(spares))
            x, y = _anchors(robot)[which].tolist()
            what = self.floor.what_is_at((x, y), reach, self.scenario.workspace.from_map)
            does = "cannot be" if which else "stands"
            raise PlanError(f"{does} at ({x:.2f}, {y:.2f}), which {what}", place=(x, y))
        spare = float(spares.min()) - _FLUSH
        touch = min(max(spare, 0.0), most)
        ground = self.floor.ground(reach + touch, room)
        return Space(ground, reach + 0.5 * touch - _FLUSH, 0.4 * touch, discs)

    def _places(self, robot: Robot, index: int) -> Iterator[Array]:
        """Yield sets of other robots' places (k, 3) to avoid, the largest set first.

        Later sets omit places that the way among obstacles alone crosses: first starts, then goals,
        then both; at last all.  None omits those of parked robots; the last one keeps no farther
        off these than needed.
        """
        need = self._radii + robot.radius + self.scenario.margin
        anchors = _anchors(robot)
        possible, parked = [], []
        for places in (self._starts, self._goals):
            reach = np.minimum(need + _PLACE_ROOM, nearest_of(places, anchors) / _NEAR)
            chosen = reach > need + 2.0 * _TOUCH
            chosen[index] = False
            possible.append(np.column_stack((places[chosen], reach[chosen])))
            parked.append(self._parked[chosen])
        stay = np.flatnonzero(self._parked & chosen)
        least = np.minimum(reach[stay], need[stay] + DISC_TOLERANCE + _PARKED_ROOM)
        yield np.concatenate(possible)
        way = self._way_alone(robot)
        if way is None:
            return
        crossed = [entered(way, discs - (0.0, 0.0, DISC_TOLERANCE)) for discs in possible]
        over_start, over_goal = (over & ~stay for over, stay in zip(crossed, parked, strict=True))
        starts, goals = possible
        if over_start.any():
            yield np.concatenate((starts[~over_start], goals))
        if over_goal.any():
            yield np.concatenate((starts, goals[~over_goal]))
        if over_start.any() and over_goal.any():
            yield np.concatenate((starts[~over_start], goals[~over_goal]))
        yield np.column_stack((self._goals[stay], least))

    def _way_alone(self, robot: Robot) -> Array | None:
        """Return the way (n, 2) among obstacles alone; None when there is none."""
        for touch in (_TOUCH, 0.0):
            with suppress(PlanError):
                return self._polygon(robot, self._space(robot, NO_DISCS, most=touch), ([], []))[0]
        return None

    def _polygon(self, robot: Robot, space: Space, ends: Leads) -> tuple[Array, Flags]:
        """Return the control polygon (n, 2) and which vertices are passed exactly."""
        begin, *via, end = _anchors(robot)
        anchors = [begin, *ends[0], *via, *ends[1], end]
        led = len(ends[0]), len(anchors) - 1 - len(ends[1])
        vertices, exact = [anchors[0]], [True]
        for i, (start, goal) in enumerate(pairwise(anchors)):
            led_here = i < led[0] or i >= led[1]
            way = np.stack((start, goal)) if led_here else self._way(space, start, goal)
            if way is None:
                raise NoWayError(space, start, goal)
            vertices += list(way[1:])
            exact += [False] * (len(way) - 2) + [any(goal is point for point in via)]
        exact[-1] = True
        return np.array(vertices), np.array(exact)

    def _way(self, space: Space, start: Array, goal: Array) -> Array | None:
        """Return the shortest way (n, 2) in a space; None when there is none."""
        if self._failed >= _FAILED:
            grid = self.floor.rough_grid(space.ground)
            if grid.parts(start, goal, space.discs):
                return None
        way = space.shortest_way(start, goal)
        self._failed += way is None
        return way


@contextmanager
def _named(robot: Robot) -> Iterator[None]:
    """Name the robot in every PlanError that the block raises."""
    try:
        yield
    except PlanError as error:
        raise error.about(robot.id) from None


def _turning(robot: Robot, space: Space, handling: Handling) -> list[tuple[float, float, Fit]]:
    """Return the shortest clear path from heading to heading around nothing, if there is one."""
    radii = [share * robot.min_turn_radius for share in _TURNS]
    ways = [way for radius in radii for way in turning_ways(robot.start, robot.goal, radius)]
    for polygon in sorted(ways, key=lambda way: float(lengths_along(way)[-1])):
        if space.keeping(polygon[:-1], polygon[1:]).all():
            exact = np.zeros(len(polygon), np.bool_)
            exact[[0, -1]] = True
            with suppress(PlanError):
                found = smooth(polygon, exact, space, handling, (len(polygon) - 2, 0))
                check_headings(robot, found.curve)
                return [_judged(robot, found, handling)]
    return []


def _judged(robot: Robot, found: Fit, handling: Handling) -> tuple[float, float, Fit]:
    """Return how much too tight [m] a path's turns are, how long [s] it takes, and the path."""
    tight = max(COMFORTABLE * robot.radius - least_radius(found), 0.0)
    return tight, handling.least_time(found.curve), found


def _anchors(robot: Robot) -> Array:
    """Return the places (n, 2) [m] that a robot has to pass: start, via points, goal."""
    return np.array([robot.start[:2], *robot.via, robot.goal[:2]])


def _headed(robot: Robot) -> tuple[bool, bool]:
    """Return whether a robot's start and goal have headings."""
    return len(robot.start) == 3, len(robot.goal) == 3


def _rooms(robot: Robot) -> list[tuple[float, float]]:
    """Return what to try: room [m] for rounding corners, and how much more than needed to keep [m].

    For robots with a wide turning circle, more room is tried first.  The last attempt keeps no more
    than the robot needs, as a passage may be just wide enough.
    """
    wide = _ROOM_PER_RADIUS * robot.min_turn_radius - robot.radius
    rooms = (wide, 0.5 * wide, 0.0) if wide > 0.02 else (0.0,)
    return [*((room, _TOUCH) for room in rooms), (0.0, 0.0)]
