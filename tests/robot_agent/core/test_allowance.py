"""All that a robot may be off its plan without a fault is within the track tolerance."""

from __future__ import annotations

import math

import numpy as np
import pytest

from coordinator.plan.wire import drive
from coordinator.planning.planner import plan_scenario
from coordinator.proof.motion_pieces import Flights
from coordinator.proof.separation import Separation
from coordinator.proof.verify import prove_document
from protocol.curve import Curve
from protocol.phases import DONE, GO, MOVING, NO_FAULT
from protocol.plan_parts import unpack_plan
from protocol.timeline import Timeline
from sim.world.body import SimulatedBody
from tests.coordinator.proof.test_tau_safety import changed
from tests.robot_agent.core.rides import COORDINATOR, MS, SECOND, armed_run
from tests.scenarios import a_robot, a_scenario

TAU = 0.6
PERIOD = 50 * MS
LATEST = 0.2
"""How late [s] the robots are that have to be late."""


class Pushed(SimulatedBody):
    """A body that is wherever its plan had it `lag` [s] ago, and more and more beside that.

    `push` (2,) [m] is how far in the end, at plan time `until` [s] less the lag.
    """

    def __init__(self, driven, lag, push, until):
        super().__init__()
        parts = unpack_plan(driven.plan)
        self.curve, self.line = Curve(*parts.path), Timeline(*parts.motion)
        self.lag, self.push, self.until, self.time = lag, push, until, 0.0

    def step(self, _now_ns):
        time = self.time - self.lag
        self.curve.place(self.line.s_at(time))
        share = min(max(1.0 + time - (self.until - 0.3), 0.0), 1.0)
        self.x = self.curve.x + share * self.push[0]
        self.y = self.curve.y + share * self.push[1]
        self.heading = math.atan2(self.curve.dy, self.curve.dx)


def bears(driven, time, lag, push):
    """Tell whether a robot has nothing to say against such a push at a plan time."""
    parts = unpack_plan(driven.plan)
    body = Pushed(driven, lag, push, time)
    run = armed_run(parts.path, parts.motion, parts.rules, max_speed=2.0, body=body)
    end = run.start_ns + round((time + lag) * SECOND)
    while run.now < end:
        run.now = min(run.now + PERIOD, end)
        body.time = (run.now - run.start_ns) / SECOND
        run.command(GO)
        body.step(run.now)
        run.agent.tick(run.own(run.now), *body.pose())
        told = run.now + 2 * MS
        if run.agent.clock_due(run.own(run.now)):
            asked, heard = run.own(run.now), run.own(run.now + 4 * MS)
            run.agent.hear_clock(COORDINATOR, asked, told, told, heard)
    return run.agent.phase in (MOVING, DONE) and run.agent.fault == NO_FAULT


def last(accepted, low, high, step):
    """Return the largest number, to `step`, that is accepted; `low` is."""
    assert accepted(low)
    while high - low > step:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if accepted(middle) else (low, middle)
    return low


def onwards(driven, s, way):
    """Return a direction (2,) without its part along the path: that makes a robot early or late."""
    curve = Curve(*unpack_plan(driven.plan).path)
    curve.place(s)
    ahead = np.array([curve.dx, curve.dy]) / math.hypot(curve.dx, curve.dy)
    way = way - float(way @ ahead) * ahead
    return way / max(math.hypot(*way), 1e-9)


def pushed(driven, time, lag, way):
    """Return the place to which a robot can come without a fault, pushed along `way` (2,)."""
    s = driven.timeline.s_at(time)
    place, way = driven.curve.at_arc([s])[0], onwards(driven, s, way)
    return place + way * last(lambda push: bears(driven, time, lag, push * way), 0.0, 0.3, 1e-5)


CROSSING = ((1, 4), (7, 4)), ((4, 1), (4, 7))
BESIDE_A_GOAL = ((1, 4), (4, 4)), ((7, 4.6), (1, 4.6))
BEHIND_A_GOAL = ((1, 4), (4, 4)), ((3.4, 1), (3.4, 7))
BEFORE_A_GOAL = ((1, 4), (4, 4)), ((1, 1), (7, 5.5))


@pytest.mark.parametrize("ways", [CROSSING, BESIDE_A_GOAL, BEHIND_A_GOAL, BEFORE_A_GOAL])
@pytest.mark.parametrize("accel", [0.8, math.inf])
@pytest.mark.parametrize("margin", [0.006, 0.02, 0.05])
def test_robots_that_use_all_they_may_do_not_touch_by_a_plan_that_is_just_accepted(
    ways, accel, margin
):
    robots = [
        a_robot(name, *way, max_accel=accel, max_lateral_accel=0.8)
        for name, way in zip("AB", ways, strict=True)
    ]
    document = plan_scenario(a_scenario(robots, tau=TAU, margin=margin))
    larger = last(
        lambda more: prove_document(changed(document, 1, radius=0.2 + more)).holds, 0.0, 4.0, 1e-6
    )
    tight = changed(document, 1, radius=0.2 + larger)
    assert -1.3e-3 < prove_document(tight).least_slack < -0.7e-3
    driven = drive(tight)
    keep = np.array([one.radius + 0.5 * margin for one in driven])
    near = Separation(Flights(driven), TAU).least(keep)
    times = (near.t_a, near.t_b)
    a, b = (
        one.curve.at_arc([one.timeline.s_at(t)])[0] for one, t in zip(driven, times, strict=True)
    )
    way = (b - a) / math.dist(a, b)
    lags = [LATEST if time < max(times) else 0.0 for time in times]
    ends = pushed(driven[0], times[0], lags[0], way), pushed(driven[1], times[1], lags[1], -way)
    assert math.dist(*ends) >= sum(one.radius for one in driven)
