"""A robot brought into any phase, and what it may hear there."""

from __future__ import annotations

import math

from protocol.curve import Curve
from protocol.phases import ARMED, BRAKING, DONE, FREEZE, FROZEN, HOLD, IDLE
from robot_agent.core.agent import Agent
from sim.world.body import SimulatedBody
from tests.robot_agent.core.rides import (
    MS,
    SECOND,
    Run,
    armed_run,
    driven_run,
    give_plan,
    motion_along,
    winding_path,
)

PATH = winding_path("ffffffl")
LENGTH = Curve(*PATH).length
MOTION = motion_along(LENGTH, 0.475, 0.5)
BODY_ACCEL = 0.5


def run_in(phase: int) -> Run:
    """Bring a robot into a phase by nothing but what it hears and where it stands."""
    if phase == IDLE:
        run = Run(Agent(0.5), SimulatedBody(), start_ns=5 * SECOND)
        run.body.place(1.0, 2.0, 0.3)
        run.command(HOLD)
        run.until(SECOND)
    elif phase == ARMED:
        run = armed_run(PATH, MOTION, body=SimulatedBody(BODY_ACCEL))
    elif phase == DONE:
        run = driven_run(PATH, MOTION, 10.0, body=SimulatedBody(BODY_ACCEL))
    else:
        run = driven_run(PATH, MOTION, 1.5, body=SimulatedBody(BODY_ACCEL))
        if phase in (BRAKING, FROZEN):
            run.command(FREEZE)
            run.until(run.now + (100 if phase == BRAKING else 2000) * MS)
    assert run.agent.phase == phase
    return run


def hear_plan(run: Run) -> None:
    give_plan(run.agent, PATH, MOTION, epoch=run.epoch)
    run.agent.tick(run.own(run.now), *run.body.pose())


def course_from_goal(begin: float, turns: str = "ffrffff"):
    """Return the path and motion of a course that begins where PATH ends, at a plan time [s]."""
    curve = Curve(*PATH)
    curve.place(LENGTH)
    heading = math.atan2(curve.dy, curve.dx)
    path = winding_path(turns, begin=(curve.x, curve.y), heading=heading)
    profile_s, profile_v, *_ = motion_along(Curve(*path).length, 0.475, 0.5)
    return path, (profile_s, profile_v, [0.0], [begin], begin)


def hear_course_from_goal(run: Run, revision: int = 1, after: float = 0.2) -> float:
    """Let a robot hear of a course from its goal; return when the course begins [s]."""
    begin = round((run.now - run.start_ns) / SECOND + after, 3)
    path, motion = course_from_goal(begin)
    give_plan(run.agent, path, motion, epoch=run.epoch, revision=revision)
    return begin


def hear_next_epoch(run: Run) -> None:
    run.epoch += 1
    run.command(HOLD)
