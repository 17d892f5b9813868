"""What the robot's core takes up, and that its loop takes no more."""

from __future__ import annotations

import math
import tracemalloc

import pytest

from protocol.curve import Curve
from protocol.phases import ARMED, BRAKING, FREEZE, FROZEN, GO, HOLD, MOVING
from protocol.timeline import Timeline
from robot_agent.core.agent import Agent
from tests.robot_agent.core.rides import (
    COORDINATOR,
    MS,
    PERIOD,
    TERM,
    give_plan,
    motion_along,
    winding_path,
)

PATH = winding_path("fffrfflffffllfffrff", step=2.5)
CURVE = Curve(*PATH)
MOTION = motion_along(CURVE.length, 0.475, 0.5, [(0.0, 0.5), (12.0, 30.0)])
START = 10**15
KIB = 1024
LOOPS = 10_000
FREEZE_AT, FROZEN_AT = 8_000, 8_200


@pytest.fixture
def traced():
    """Start to count memory when called; stop in the end."""
    yield tracemalloc.start
    tracemalloc.stop()


def learn_the_time(agent: Agent, now: int) -> None:
    """Ask for the time, and hear it at once."""
    agent.clock.ask(now)
    agent.hear_clock(COORDINATOR, now, now, now, now)


def armed_agent() -> Agent:
    """Return an agent that stands at the path's beginning and has been told the time."""
    agent = Agent(0.5)
    said = START - 10 * MS
    agent.hear_command(COORDINATOR, TERM, 1, 1, HOLD, 0, said, 0, False, said)
    give_plan(agent, PATH, MOTION)
    learn_the_time(agent, START - 9 * MS)
    agent.tick(START - 8 * MS, *agent.ride.follower.start_pose())
    assert agent.phase == ARMED
    return agent


def poses() -> list[tuple[int, float, float, float]]:
    """Return what a robot on its plan sees tick by tick, its time first; it stands after 82 s."""
    line, seen = Timeline(*MOTION), []
    for tick in range(LOOPS):
        CURVE.place(line.s_at(min(tick, FREEZE_AT) * PERIOD / 1e9))
        heading = math.atan2(CURVE.dy, CURVE.dx)
        seen.append((START + tick * PERIOD, CURVE.x, CURVE.y, heading))
    return seen


def tell(agent: Agent, tick: int, now: int) -> None:
    """Say what the coordinator does: a Command each 100 ms, the time each 2 s."""
    phase = FREEZE if tick >= FREEZE_AT else GO
    granted = (now - START) // MS + 2_000
    agent.hear_command(COORDINATOR, TERM, 2 + tick, 1, phase, START, now, granted, False, now)
    if tick % 200 == 0:
        learn_the_time(agent, now)


def test_ten_thousand_ticks_of_moving_braking_and_standing_leave_nothing_behind(traced):
    agent, rows = armed_agent(), poses()
    phases = bytearray(LOOPS)
    sizes = [0] * 4
    traced()
    for tick, row in enumerate(rows):
        if tick % 10 == 0:
            tell(agent, tick, row[0])
        agent.tick(*row)
        phases[tick] = agent.phase
        if tick == 100:
            tracemalloc.reset_peak()
            sizes[0] = tracemalloc.get_traced_memory()[0]
        elif tick == LOOPS // 2:
            sizes[1] = tracemalloc.get_traced_memory()[0]
    sizes[2:] = tracemalloc.get_traced_memory()
    assert set(phases[:FREEZE_AT]) == {MOVING}
    assert set(phases[FREEZE_AT:FROZEN_AT]) == {BRAKING, FROZEN}
    assert set(phases[FROZEN_AT:]) == {FROZEN}
    assert sizes[1] - sizes[0] < KIB
    assert sizes[2] - sizes[0] < KIB
    assert sizes[3] - sizes[0] < 4 * KIB


@pytest.mark.parametrize("bends", [4, 16, 26])
def test_an_agent_takes_up_less_than_64_kib_its_plan_included(traced, bends):
    """The largest has 313 control points: no Plan message has room for more."""
    path = winding_path("fffrffllffff" * bends)
    motion = motion_along(Curve(*path).length, 0.475, 0.5, [(0.5 * i, 10.0 * i) for i in range(8)])
    traced()
    agent = Agent(0.5)
    give_plan(agent, path, motion)
    assert agent.ride is not None
    assert tracemalloc.get_traced_memory()[0] < 64 * KIB
