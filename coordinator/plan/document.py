"""The plan document: everything that is known about one epoch's plan, as written to plan.json.

Decides: the document's fields.  All numbers of paths, profiles and stops are float32 values, as on
the wire.  Must not know: how a plan is found (planning/planner.py) or proven (proof/tau_safety.py);
wire.py turns it into messages.
"""

from __future__ import annotations

import math
from typing import Final

import msgspec

from coordinator.scenario.model import Link, Point, Policy, Robot

FORMAT: Final = "splinefleet.plan/1"


class Path(msgspec.Struct, frozen=True, kw_only=True):
    """A clamped NURBS curve: len(knots) = len(control_points) + degree + 1; points in metres."""

    degree: int
    knots: list[float]
    control_points: list[Point]
    weights: list[float]


class Stop(msgspec.Struct, frozen=True, kw_only=True):
    """A rest at arc length s [m] from `arrive` to `depart` [s], to let `yields_to` pass."""

    s: float
    arrive: float
    depart: float
    yields_to: str = ""


class Limits(msgspec.Struct, frozen=True, kw_only=True):
    """A robot's limits: speed [m/s], accelerations [m/s^2], turn radius [m], turn rate [rad/s].

    null: no limit.
    """

    max_speed: float
    max_accel: float | None = None
    max_lateral_accel: float | None = None
    min_turn_radius: float = 0.0
    max_turn_rate: float | None = None

    @classmethod
    def of(cls, robot: Robot) -> Limits:
        """Return a scenario robot's limits."""
        lateral, turning = robot.max_lateral_accel, robot.max_turn_rate
        return cls(
            max_speed=robot.max_speed,
            max_accel=None if math.isinf(robot.max_accel) else robot.max_accel,
            max_lateral_accel=None if math.isinf(lateral) else lateral,
            min_turn_radius=robot.min_turn_radius,
            max_turn_rate=None if math.isinf(turning) else turning,
        )


class RobotPlan(msgspec.Struct, frozen=True, kw_only=True):
    """One robot's part of the plan: path, speed knots [s, v], stops; times are plan times [s].

    `shortest`: the path that the robot would take alone; null if it takes that one.
    """

    id: str
    radius: float
    start_time: float
    finish_time: float
    length: float
    path: Path
    profile: list[tuple[float, float]]
    stops: list[Stop]
    wire_bytes: int
    start_yields_to: str = ""
    limits: Limits | None = None
    shortest: Path | None = None


class Crossing(msgspec.Struct, frozen=True, kw_only=True):
    """A point where two paths meet, when the robots pass it, and which of them waits (verdict)."""

    a: str
    b: str
    x: float
    y: float
    s_a: float
    s_b: float
    t_a: float
    t_b: float
    verdict: str


class Reason(msgspec.Struct, frozen=True, kw_only=True):
    """Why a robot waits for `wait` seconds at arc length s [m]: `yields_to` passes a zone first.

    zone, their_zone [m]: where the zone begins and ends on the robot's own path and on the other's.
    `otherwise` [s]: how much later the two would arrive in total if this robot passed the zone
    first.  It is null if the robot cannot, or if that was not `tried`: in large fleets only the
    longest waits are tried.
    """

    robot: str
    s: float
    wait: float
    yields_to: str
    zone: tuple[float, float]
    their_zone: tuple[float, float]
    otherwise: float | None = None
    tried: bool = False


class Proof(msgspec.Struct, frozen=True, kw_only=True):
    """What the proof found; distances between centres [m], clearance beyond the radius [m].

    `least_separation` is the least distance between any two centres.  `least_slack` is the least
    distance beyond a pair's need, r_i + r_j + margin; it is negative when a pair comes too near.
    `tightest` is a sentence on which pair has the least slack, when and where.

    `unproven` names what could not be checked: "clearance" if the floor is not known, "limits" if
    the limits of a robot are not known.
    """

    holds: bool
    pairs: int
    least_separation: float | None
    least_clearance: float | None
    survives: list[str]
    tightest: str = ""
    failures: list[str] = []
    unproven: list[str] = []
    least_slack: float | None = None


class Floor(msgspec.Struct, frozen=True, kw_only=True):
    """The floor on which the clearance was proven; with it a plan file can be proven by itself."""

    boundary: list[Point]
    obstacles: list[list[Point]]


class PlanDocument(msgspec.Struct, frozen=True, kw_only=True):
    """The whole plan of one epoch; `tau` [s], `margin` [m]."""

    format: str = FORMAT
    scenario: str
    epoch: int
    policy: Policy
    tau: float
    margin: float
    link: Link = Link()
    robots: list[RobotPlan]
    crossings: list[Crossing] = []
    waits: list[Reason] = []
    proof: Proof | None = None
    timing: dict[str, float] = {}
    workspace: Floor | None = None
    notes: list[str] = []

    def robot(self, robot_id: str) -> RobotPlan:
        """Return one robot's plan; raises KeyError when no robot has this id."""
        for robot in self.robots:
            if robot.id == robot_id:
                return robot
        raise KeyError(robot_id)
