"""The data that the page shows: floor, robots, epochs with their motions, zones and marks.

Decides: the fields of the page's data.  Must not know: where the data comes from (scene_plan.py,
scene_log.py, true_tracks.py), HTML (page.py).

Times are seconds since the first GO; those in a ride are plan times.  Lengths are metres.  Robots
are identified by their index in `robots`.
"""

from __future__ import annotations

import msgspec

from coordinator.scenario.model import Point

Leg = tuple[float, float, float, float, float, float]
"""A leg of constant acceleration: t0, t1 [s], s0, s1 [m], and the speeds at its ends [m/s]."""

Halt = tuple[float, float, float, float]
"""How a robot left its plan: braking from plan time t0 to t1 [s], arc length s0 to s1 [m]."""

Knot = tuple[float, float]
"""A time of the plan, and the plan time that a robot has passed then [s]."""


class Body(msgspec.Struct, frozen=True, kw_only=True):
    """A robot: id and radius [m]."""

    id: str
    radius: float


class Wait(msgspec.Struct, frozen=True, kw_only=True):
    """A planned rest at arc length s, between two plan times, that lets a robot pass (-1: none)."""

    s: float
    since: float
    until: float
    lets: int = -1


class Yielding(msgspec.Struct, frozen=True, kw_only=True):
    """How a robot gives way to another one without a rest, between two plan times.

    how: "slows for", "passes behind" and so on (findings/giving_way.py).  lost [s]: what driving
    slowly costs it.
    """

    how: str
    other: int
    since: float
    until: float
    lost: float = 0.0


class Ride(msgspec.Struct, frozen=True, kw_only=True):
    """One course of a robot in an epoch.

    A robot drives the last of its rides in an epoch that has begun.

    path: arc lengths, x and y of a polyline.  shortest: the same of the path that the robot would
    take alone; null if it takes that one.  legs: the motion; between legs, before the first and
    after the last the robot rests.  passed: the plan time that the robot has passed over the time
    of the plan, linear between the knots; before the first one the robot is on time, after the last
    one it goes on as between the last two, but no faster than the clock.  halt: where it left its
    plan, braking at a constant rate, in passed plan time; null if it never did.  unheard: whether
    that is only assumed, because it has not been heard since.  brake [m/s^2]: its deceleration; 0
    means that it stops at once.

    revision: which of the robot's courses in the epoch it is.  told, since: the times of the plan
    at which a further course was sent and since when the robot drives it; `since` is null while it
    does not.  Both are null for a robot's first course of an epoch, on which it is from the
    beginning.  ends: the passed plan time at which the robot changes to its next course; null
    before it has.
    """

    robot: int
    path: tuple[list[float], list[float], list[float]]
    legs: list[Leg]
    waits: list[Wait] = []
    yields: list[Yielding] = []
    shortest: tuple[list[float], list[float], list[float]] | None = None
    passed: list[Knot] = []
    halt: Halt | None = None
    unheard: bool = False
    brake: float = 0.0
    revision: int = 0
    told: float | None = None
    since: float | None = None
    ends: float | None = None


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
    """A robot without a part in an epoch, and why; it stays where the last epoch left it."""

    robot: int
    why: str


class Held(msgspec.Struct, frozen=True, kw_only=True):
    """A robot that had to slow down or stand because another one was late or lost.

    by: the other one.  since, until [s]: when; `until` is null while it lasts.
    """

    robot: int
    by: int
    since: float
    until: float | None = None


class Stop(msgspec.Struct, frozen=True, kw_only=True):
    """A time in which the plan of an epoch stood: an operator's stop, or a coordinator that died.

    since, until [s]: when; `until` is null while it lasts.  late: how much later [s] than planned
    robots that are on time are after it, by this and earlier stops together.
    """

    since: float
    until: float | None = None
    late: float = 0.0


class Epoch(msgspec.Struct, frozen=True, kw_only=True):
    """A plan, which is shown from `begin` on; its time zero is `start`.

    frozen: when the fleet was commanded to stop.
    started: whether there was a GO; without one no robot moves.
    arrived: whether all its robots had arrived when the fleet was commanded to stop.
    rides: the first course of each robot, and then the further ones by revision.  stops: when the
    plan stood.
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
    stops: list[Stop] = []


class Mark(msgspec.Struct, frozen=True, kw_only=True):
    """Something that happened; kind: "go", "freeze", "over", "fault" or "late".

    robot: the one that it happened to; -1 if it happened to the fleet.
    """

    t: float
    kind: str
    text: str
    robot: int = -1


Step = tuple[float, int, int, float | None, str]
"""What became of an order, and when [s]: its state as in protocol's ORDER_STATES, who does it (-1:
nobody yet), when the robot is planned to arrive [s], and the reason."""


class Order(msgspec.Struct, frozen=True, kw_only=True):
    """An order, step by step; arrived [s]: when its robot was at the goal."""

    id: str
    steps: list[Step]
    arrived: float | None = None


class Ghost(msgspec.Struct, frozen=True, kw_only=True):
    """Where a robot truly was: times and places, with straight lines in between."""

    robot: int
    t: list[float]
    x: list[float]
    y: list[float]


class Scene(msgspec.Struct, frozen=True, kw_only=True):
    """Everything on the page; `notes` say what the log does not contain.

    proven: whether the proof of the newest epoch's plan holds; None when it is not known.
    begin: nothing before is shown, because it was too long ago.
    day: the time of the day at time 0 [ms since 1970]; null if it is not known.  speed: how many of
    the scene's seconds pass in one of the day.
    """

    name: str
    policy: str
    tau: float
    margin: float
    proven: bool | None
    source: str
    end: float
    begin: float = 0.0
    day: float | None = None
    speed: float = 1.0
    boundary: list[Point]
    obstacles: list[list[Point]]
    robots: list[Body]
    epochs: list[Epoch]
    marks: list[Mark] = []
    ghosts: list[Ghost] = []
    held: list[Held] = []
    orders: list[Order] = []
    notes: list[str] = []
