"""What a user asks for: a floor, robots with starts and goals, and how safe the plan must be.

Decides: the fields, their units and defaults.  Must not know: files
(scenario_files/scenario_reader.py reads and checks them) or plans.
"""

from __future__ import annotations

from typing import Literal

import msgspec

Point = tuple[float, float]
Pose = tuple[float, float] | tuple[float, float, float]
Policy = Literal["safe", "paper"]


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
    priority: int = 0
    path: GivenPath | None = None

    @property
    def end_fields(self) -> tuple[str, str]:
        """Return the fields of a scenario file that say where the robot starts and ends."""
        if self.path is None:
            return "start", "goal"
        return "path.control_points[0]", f"path.control_points[{len(self.path.control_points) - 1}]"


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

    def need(self, a: Robot, b: Robot) -> float:
        """Return the least distance [m] between the centres of two robots."""
        return a.radius + b.radius + self.margin

    def planned_speed(self, robot: Robot) -> float:
        """Return the speed [m/s] that plans may use: the limit less the reserve."""
        return robot.max_speed * (1.0 - self.speed_reserve)
