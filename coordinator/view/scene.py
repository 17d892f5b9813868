"""What the page shows: floor, robots, epochs with their motions, zones and marks, as plain data.

Decides: the fields of the page's data.  Must not know: where they come from (scene_plan.py,
scene_log.py, true_tracks.py), HTML (page.py).

Times are seconds since the first GO, those inside a ride seconds of its plan; lengths are metres.
Robots are told by their index in `robots`.
"""

from __future__ import annotations

import msgspec

from coordinator.scenario.model import Point

Leg = tuple[float, float, float, float, float, float]
"""Constant acceleration: from and until [s], from and to [m], speed before and after [m/s]."""

Halt = tuple[float, float, float, float]
"""The plan is left at a plan time [s] and an arc length [m]: from t0 until t1, from s0 to s1."""


class Body(msgspec.Struct, frozen=True, kw_only=True):
    """A robot: id and radius [m]."""

    id: str
    radius: float


class Wait(msgspec.Struct, frozen=True, kw_only=True):
    """A planned rest at arc length s, between two plan times, for a robot (-1: nobody's sake)."""

    s: float
    since: float
    until: float
    lets: int = -1


class Ride(msgspec.Struct, frozen=True, kw_only=True):
    """One robot's part in an epoch.

    path: arc lengths, x and y of a polyline.  legs: the motion; between two of them and
    outside of them the robot rests.  halt: where it left its plan, braking evenly; null if it
    never did.  brake [m/s^2]: how it brakes; 0: at once.
    """

    robot: int
    path: tuple[list[float], list[float], list[float]]
    legs: list[Leg]
    waits: list[Wait] = []
    halt: Halt | None = None
    brake: float = 0.0


class Zone(msgspec.Struct, frozen=True, kw_only=True):
    """Stretches of two paths on which the two robots might touch.

    `forces`: whether one of them waits because of it.
    """

    a: int
    b: int
    on_a: tuple[float, float]
    on_b: tuple[float, float]
    forces: bool


class Aside(msgspec.Struct, frozen=True, kw_only=True):
    """A robot without a part in an epoch, and why; it stays where the one before has left it."""

    robot: int
    why: str


class Epoch(msgspec.Struct, frozen=True, kw_only=True):
    """A plan: shown from `begin` on, its time zero is `start`, `frozen` when all were told to stop.

    started: whether there was a GO; without one nobody moves.
    arrived: whether all its robots had arrived when they were told to stop.
    keep_out: the polygons around robots that stand aside.
    """

    epoch: int
    begin: float
    start: float
    started: bool = True
    frozen: float | None = None
    arrived: bool = False
    rides: list[Ride]
    aside: list[Aside] = []
    keep_out: list[list[Point]] = []
    zones: list[Zone] = []


class Mark(msgspec.Struct, frozen=True, kw_only=True):
    """Something that happened; kind: "go", "freeze", "over", "fault" or "late"."""

    t: float
    kind: str
    text: str


class Ghost(msgspec.Struct, frozen=True, kw_only=True):
    """Where a robot truly was: times and places, straight in between."""

    robot: int
    t: list[float]
    x: list[float]
    y: list[float]


class Scene(msgspec.Struct, frozen=True, kw_only=True):
    """Everything on the page; `notes`: what could not be known of a log.

    proven: whether the proof of the newest epoch's plan holds; None when it is not known.
    """

    name: str
    policy: str
    tau: float
    margin: float
    proven: bool | None
    source: str
    end: float
    boundary: list[Point]
    obstacles: list[list[Point]]
    robots: list[Body]
    epochs: list[Epoch]
    marks: list[Mark] = []
    ghosts: list[Ghost] = []
    notes: list[str] = []
