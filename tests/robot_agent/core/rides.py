"""Hand-made plans, and a robot driven along them in virtual time."""

from __future__ import annotations

import itertools
import math
import random
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import BSpline

from protocol.curve import Curve
from protocol.phases import ARMED, GO, HOLD
from robot_agent.core.agent import Agent
from sim.world.body import SimulatedBody

MS = 1_000_000
SECOND = 1_000_000_000
PERIOD = 10 * MS
COORDINATOR, TERM = 77, 3
ME, NUMBER = "R1", 4

RULES = (10, 500, 10 * MS)
"""track [mm], brake [mm/s^2], clock error [ns]"""

AT_ONCE = (10, 0, 10 * MS)
"""Rules for a robot that stops at once."""

ENOUGH = 10**9
"""A plan time [ms] beyond the end of every plan here."""

CORNER = 0.226
"""Control points this far apart [m] bend a cubic with radius 0.08 m where they turn by 90 deg."""


def uniform_knots(count: int, degree: int = 3) -> list[float]:
    """Return a clamped uniform knot vector."""
    return (
        [0.0] * degree
        + [float(i) for i in range(count - degree + 1)]
        + [float(count - degree)] * degree
    )


def winding_path(
    turns: str = "fffflffrfflffff",
    step: float = CORNER,
    begin: tuple[float, float] = (1.0, 2.0),
    heading: float = 0.3,
):
    """Return the arguments of Curve for a cubic that goes forward, left and right by 90 degrees."""
    points = [begin]
    for turn in turns:
        heading += {"f": 0.0, "l": math.pi / 2, "r": -math.pi / 2}[turn]
        x, y = points[-1]
        points.append((x + step * math.cos(heading), y + step * math.sin(heading)))
    xs, ys = [x for x, _ in points], [y for _, y in points]
    return 3, uniform_knots(len(points)), xs, ys, [1.0] * len(points)


def place_at(path, s: float) -> tuple[float, float]:
    """Return the place at an arc length on a path."""
    curve = Curve(*path)
    curve.place(s)
    return curve.x, curve.y


def dense_line(path) -> tuple[np.ndarray, np.ndarray]:
    """Return places (m, 2) and arc lengths (m,) along a path with unit weights, by SciPy."""
    degree, knots, xs, ys, _ = path
    spline = BSpline(knots, np.column_stack((xs, ys)), degree)
    places = spline(np.linspace(0.0, knots[-1], 40_001))
    return places, np.append(0.0, np.cumsum(np.hypot(*np.diff(places, axis=0).T)))


def motion_along(length: float, speed: float, accel: float, stops=()):
    """Return the arguments of Timeline: full speed but for the ends and stops (s, depart)."""
    if math.isinf(accel):
        return [0.0, length], [speed, speed], [s for s, _ in stops], [t for _, t in stops], 0.0
    ramp = speed * speed / (2.0 * accel)
    rests = [0.0, *(s for s, _ in stops if s > 0.0), length]
    knots = []
    for a, b in itertools.pairwise(rests):
        knots += [(a, 0.0), (a + ramp, speed), (b - ramp, speed)]
    knots.append((length, 0.0))
    return (
        [s for s, _ in knots],
        [v for _, v in knots],
        [s for s, _ in stops],
        [t for _, t in stops],
        0.0,
    )


def give_plan(
    agent: Agent, path, motion, rules=RULES, *, boot=COORDINATOR, epoch=1, number=NUMBER, revision=0
) -> None:
    """Let an agent hear a plan."""
    agent.hear_plan(boot, epoch, number, revision, rules, path, motion)


@dataclass
class Run:
    """A robot in virtual time, and what it truly did; plan times [s]."""

    agent: Agent
    body: SimulatedBody
    start_ns: int
    offset_ns: int = 0
    drift_ppm: int = 0
    jitter: random.Random | None = None
    times: list[float] = field(default_factory=list)
    places: list[tuple[float, float]] = field(default_factory=list)
    phases: list[int] = field(default_factory=list)
    due: int = 0
    now: int = 0
    sequence: int = 1
    phase: int = HOLD
    epoch: int = 1
    authority: int = ENOUGH
    next_authority: int | None = None
    """What Commands grant, plan time [ms]."""

    def own(self, truth_ns: int) -> int:
        """Return what the robot's clock shows at a time of the coordinator's."""
        return truth_ns + self.offset_ns + truth_ns * self.drift_ppm // 1_000_000

    def until(self, truth_ns: int, talking: bool = True, age: int = 2 * MS) -> None:
        """Tick until a time, a Command each 100 ms, the time told whenever it is asked for."""
        while True:
            late = self.jitter.randrange(20 * MS) if self.jitter else 0
            now = max(self.now, self.due + late)
            if now >= truth_ns:
                return
            self.due += PERIOD
            self.now = now
            own = self.own(now)
            if talking and now // (100 * MS) != (now - PERIOD) // (100 * MS):
                self.command(self.phase, age=age)
            self.body.step(own)
            self.agent.tick(own, *self.body.pose())
            agent = self.agent
            if agent.drive_turn:
                self.body.turn(agent.drive_turn)
            else:
                self.body.drive(agent.drive_speed, agent.drive_curvature, agent.drive_distance)
            if self.agent.clock_due(own) and talking:
                told = now + 2 * MS
                self.agent.hear_clock(COORDINATOR, own, told, told, self.own(now + 4 * MS))
            self.times.append((now - self.start_ns) / SECOND)
            self.places.append((self.body.x, self.body.y))
            self.phases.append(self.agent.phase)

    def command(self, phase: int, wanted: bool = False, age: int = 2 * MS) -> None:
        """Let the robot hear the coordinator's next Command, said so long ago [ns]."""
        self.phase = phase
        self.sequence += 1
        self.hear(phase, wanted=wanted, age=age)

    def hear(
        self,
        phase: int,
        *,
        boot: int = COORDINATOR,
        term: int = TERM,
        sequence: int | None = None,
        epoch: int | None = None,
        wanted: bool = False,
        age: int = 2 * MS,
        run: int = 0,
    ) -> bool:
        """Let the robot hear a Command of anybody, and return whether it was accepted."""
        return self.agent.hear_command(
            boot,
            term,
            self.sequence if sequence is None else sequence,
            self.epoch if epoch is None else epoch,
            phase,
            self.start_ns,
            self.now - age,
            self.authority,
            wanted,
            self.own(self.now),
            run,
            self.authority if self.next_authority is None else self.next_authority,
        )


def armed_run(
    path, motion, rules=RULES, *, max_speed=0.5, body=None, seed=None, hears=True, **clock
) -> Run:
    """Return a run whose robot stands armed at the path's start; GO has not been heard.

    `hears`: whether it has heard Commands.  If not, it is armed without the time.
    """
    body = body or SimulatedBody()
    agent = Agent(max_speed)
    run = Run(
        agent,
        body,
        start_ns=5 * SECOND,
        jitter=None if seed is None else random.Random(seed),
        **clock,
    )
    curve = Curve(*path)
    curve.place(0.0)
    body.place(curve.x, curve.y, math.atan2(curve.dy, curve.dx))
    if hears:
        run.command(HOLD)
    give_plan(agent, path, motion, rules)
    run.until(SECOND if hears else 4 * SECOND, talking=hears)
    assert agent.phase == ARMED
    return run


def driven_run(path, motion, seconds: float, **options) -> Run:
    """Return a run that heard GO in time and went on for so many seconds of plan time."""
    run = armed_run(path, motion, **options)
    run.command(GO)
    run.until(run.start_ns + round(seconds * SECOND))
    return run
