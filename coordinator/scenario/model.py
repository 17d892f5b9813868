"""What a user asks for: a floor, robots with starts and goals, and how safe the plan must be.

Decides: the fields, their units and defaults.  Must not know: files
(scenario_files/scenario_reader.py reads and checks them) or plans.
"""

from __future__ import annotations

import math
from typing import Final, Literal

import msgspec

Point = tuple[float, float]
Pose = tuple[float, float] | tuple[float, float, float]
Policy = Literal["safe", "paper"]

MOST_ROBOTS: Final = 10_000
"""The most robots of a scenario."""
TURN_RATE: Final = 2.0
"""How fast robots turn [rad/s] if a scenario does not say it and they take time to speed up."""


def usual_turn_rate(accel: float) -> float:
    """Return the turn rate [rad/s] of a robot with this acceleration [m/s^2] if none is given.

    A robot that starts and stops at once turns at once, too.
    """
    return TURN_RATE if math.isfinite(accel) else math.inf


class GivenPath(msgspec.Struct, frozen=True, kw_only=True):
    """A NURBS curve [m] that a robot is to drive unchanged, as made by another program.

    knots: clamped, len(control_points) + degree + 1 of them, in any unit; () means uniform knots.
    weights: positive; () means 1 everywhere.  rounding [m]: by how much corners, where the curve
    turns on the spot, may be cut; with 0 they stay, and few robots can drive them.
    """

    degree: int
    control_points: tuple[Point, ...]
    knots: tuple[float, ...] = ()
    weights: tuple[float, ...] = ()
    rounding: float = 0.0


HERE: Final = 1e-6
"""Places nearer to each other than this [m] are one: no path leads from one to the other."""


class Robot(msgspec.Struct, frozen=True, kw_only=True):
    """One robot: lengths [m], speeds [m/s], accelerations [m/s^2], headings [rad].

    A robot with a path has no via points; it starts at the first control point of the path, and its
    goal is the last one.
    """

    id: str
    start: Pose
    goal: Pose
    radius: float
    max_speed: float
    via: tuple[Point, ...] = ()
    max_accel: float
    """Default: reaches max_speed within 1 s; with inf the robot starts and stops instantly."""
    max_lateral_accel: float
    """Default: max_accel."""
    min_turn_radius: float = 0.0
    max_turn_rate: float = TURN_RATE
    """How fast it turns [rad/s], on the spot and in bends.  Default: inf if max_accel is."""
    priority: int = 0
    home: Pose | None = None
    """Where it goes when it is in the way and has nothing to do."""
    path: GivenPath | None = None

    @property
    def is_idle(self) -> bool:
        """Whether the robot stays at its start until it gets an order."""
        places = (*self.via, self.goal)
        return self.path is None and all(
            math.dist(one[:2], self.start[:2]) < HERE for one in places
        )

    @property
    def end_fields(self) -> tuple[str, str]:
        """Return the fields of a scenario file that say where the robot starts and ends."""
        if self.path is None:
            return "start", "start" if self.is_idle else "goal"
        return "path.control_points[0]", f"path.control_points[{len(self.path.control_points) - 1}]"


class Order(msgspec.Struct, frozen=True, kw_only=True):
    """Where a robot is wanted while the fleet drives; lengths [m], headings [rad], times [s].

    robot: "" leaves the choice to the coordinator.  release: when it becomes known, counted from
    the first GO; after: or when the order with this id is done.  dwell: how long the robot stands
    at the goal before the order is done.  Of several that wait, a higher priority goes first.
    """

    id: str
    goal: Pose
    robot: str = ""
    release: float = 0.0
    after: str = ""
    via: tuple[Point, ...] = ()
    dwell: float = 0.0
    priority: int = 0


class Demand(msgspec.Struct, frozen=True, kw_only=True):
    """Orders that go on by themselves: each robot goes from one of these places to another.

    places [m]: a robot's next order goes to one that no robot holds or is bound for.  per_robot:
    how many orders each robot gets; the next becomes known when the last is done, the first at a
    random time within first_within [s].  dwell [s]: as in an Order.
    """

    places: tuple[Pose, ...]
    per_robot: int = 1
    first_within: float = 0.0
    dwell: float = 0.0
    seed: int = 0


class MapPart(msgspec.Struct, frozen=True, kw_only=True):
    """The obstacles that come from a map: all from index `first` on; `file` is the map's name."""

    file: str
    first: int


class Workspace(msgspec.Struct, frozen=True, kw_only=True):
    """The floor: its outline (counter-clockwise corners [m]) and its obstacles."""

    boundary: tuple[Point, ...]
    obstacles: tuple[tuple[Point, ...], ...] = ()
    notes: tuple[str, ...] = ()
    """Sentences for the report about the map that the polygons come from."""
    from_map: MapPart | None = None
    names: tuple[str, ...] = ()
    """What the last obstacles are called in messages; the others are known by their numbers."""


class Link(msgspec.Struct, frozen=True, kw_only=True):
    """The worst link between robots and coordinator: one-way `delay` [s] and share of `loss`."""

    delay: float = 0.0
    loss: float = 0.0


class Scenario(msgspec.Struct, frozen=True, kw_only=True):
    """A checked scenario; `tau` is in seconds or "auto" for the fault budget."""

    name: str
    workspace: Workspace
    robots: tuple[Robot, ...]
    tau: float | Literal["auto"] = "auto"
    margin: float = 0.05
    policy: Policy = "safe"
    stop_time: float = 2.0
    speed_reserve: float = 0.05
    link: Link = Link()
    orders: tuple[Order, ...] = ()
    demand: Demand | None = None

    def need(self, a: Robot, b: Robot) -> float:
        """Return the least distance [m] between the centres of two robots."""
        return a.radius + b.radius + self.margin

    def planned_speed(self, robot: Robot) -> float:
        """Return the speed [m/s] that plans may use: the limit less the reserve."""
        return robot.max_speed * (1.0 - self.speed_reserve)
