"""Where one robot is wanted, and the floor and terms on which its course is looked for.

Decides: what a search for a course is given.  Must not know: how a course is found or proven.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import shapely
from msgspec.structs import replace as changed

from coordinator.bends.among_courses import Bends
from coordinator.ground.grown_floor import GrownFloor
from coordinator.plan.capacity import UNLIMITED, Capacity
from coordinator.plan.document import PlanDocument
from coordinator.planning.leading_off import UnderWay
from coordinator.scenario.floor import Floor
from coordinator.scenario.model import Point, Pose, Robot, Scenario


class Site:
    """A floor, prepared for many proposals, and the terms of the plan in force."""

    def __init__(self, scenario: Scenario, terms: PlanDocument) -> None:
        self.scenario, self.terms = scenario, terms
        workspace = scenario.workspace
        self.floor = GrownFloor(workspace.boundary, workspace.obstacles, workspace.names)
        solid = Floor(workspace.boundary, workspace.obstacles)
        self.gap, self.room = solid.gap, solid.distance
        self.bends = Bends()

    def with_obstacles(self, rings: Mapping[str, tuple[Point, ...]]) -> Site:
        """Return the floor with further obstacles, by their names in words; the terms stay."""
        floor = self.scenario.workspace
        solid, names = floor.obstacles + tuple(rings.values()), floor.names + tuple(rings)
        more = changed(floor, obstacles=solid, names=names)
        return Site(changed(self.scenario, workspace=more), self.terms)

    def is_on_floor(self, ring: tuple[Point, ...]) -> bool:
        """Return whether any of a polygon [m] lies on the floor."""
        return bool(shapely.intersects(self.floor.outline, shapely.Polygon(ring)))

    def what_is_at(self, place: Point, reach: float) -> str:
        """Return in words what is solid nearer than `reach` [m] to a place [m]; "" if nothing."""
        return self.floor.what_is_at(place, reach, self.scenario.workspace.from_map)


@dataclass(frozen=True)
class Wish:
    """Where a robot is wanted: `robot` has the place where it rests as start, and its goal.

    The course has this `number` and `revision`, and begins at plan time `begin_ms`.  The robot
    faces `heading` [rad], and it rests `delay` [s] later.  `late`: how late [s] others are: the
    robot goes ahead of them as they were planned, and behind them as late as they are.  `leaves`:
    the course that it leaves in motion, if it is not to rest.  `holds`: what it can hold of one.
    """

    robot: Robot
    heading: float
    number: int
    revision: int
    begin_ms: int
    delay: float = 0.0
    late: Mapping[str, float] = field(default_factory=dict)
    leaves: UnderWay | None = None
    holds: Capacity = UNLIMITED

    def in_motion(self) -> Wish:
        """Return the wish of a robot that leaves its course in motion.

        Raises PlanError if it cannot.
        """
        assert self.leaves is not None
        robot = changed(self.robot, start=self.leaves.start())
        return replace(self, robot=robot, begin_ms=self.leaves.begin_ms, delay=0.0)

    def to(self, goal: Pose) -> Wish:
        """Return the same wish with another goal."""
        return replace(self, robot=changed(self.robot, goal=goal, via=()))
