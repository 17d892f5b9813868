"""Control ticks need no share of tau: what a robot does at them leaves room for them in the sum."""

import math

import pytest

from coordinator.plan.document import Limits
from coordinator.plan.fault_budget import budget_for
from coordinator.scenario.model import Link
from protocol.curve import Curve
from protocol.phases import BRAKING, MOVING
from sim.world.body import SimulatedBody
from tests.robot_agent.core import rides
from tests.robot_agent.core.rides import (
    MS,
    SECOND,
    armed_run,
    driven_run,
    motion_along,
    winding_path,
)

PATH = winding_path("ffffffl")
SPEED = 0.475
MOTION = motion_along(Curve(*PATH).length, SPEED, math.inf)
RULES = (250 * MS, 600 * MS, 10, 0, 10 * MS)
"""Of a robot that stops at once: its brakes have no share either."""


class Blocked(SimulatedBody):
    """A body that does not get on from a time on (its own clock, ns)."""

    def __init__(self, from_ns):
        super().__init__()
        self.from_ns = from_ns

    def step(self, now_ns):
        x, y = self.x, self.y
        super().step(now_ns)
        if now_ns > self.from_ns:
            self.x, self.y = x, y


def lag_when_last_heard(period, blocked_ns):
    """Return how far behind its plan [s] a robot was when it last said that all is well."""
    body = Blocked(6 * SECOND + blocked_ns)
    run = armed_run(PATH, MOTION, RULES, body=body)
    run.command(rides.GO)
    heard = None
    while run.agent.phase != BRAKING:
        run.until(run.now + period + 1)
        time = (run.now - run.start_ns) / SECOND
        if run.agent.report_due(run.own(run.now)) and run.agent.phase == MOVING and time > 0.0:
            heard = time - run.agent.ride.follower.s / SPEED
    return heard


def went_on_alone(period, said_ns):
    """Return for how long [s] a robot went on after its last Command was said."""
    run = driven_run(PATH, MOTION, 1.0 + said_ns / SECOND, rules=RULES)
    run.command(rides.GO, age=0)
    said = run.now
    while run.agent.drive_speed > 0.0:
        run.until(run.now + period + 1, talking=False)
    return (run.now - said) / SECOND


@pytest.mark.parametrize("period", [10 * MS, 20 * MS, 50 * MS])
def test_a_robot_that_is_alone_has_stopped_when_tau_has_passed_since_any_other_was_well(
    period, monkeypatch
):
    monkeypatch.setattr(rides, "PERIOD", period)
    shifts = range(0, 200 * MS, 7 * MS)
    lag = max(lag_when_last_heard(period, shift) for shift in shifts)
    alone = max(went_on_alone(period, shift) for shift in shifts)
    budget = budget_for([Limits(max_speed=0.5, max_accel=None)], Link())
    assert lag > 0.15
    assert alone > budget.lease - 0.01
    # The lease ends in the time in which the plan runs, so only the other's clock may err.
    assert lag + budget.notice + alone + budget.clocks / 2 <= budget.cut_off
