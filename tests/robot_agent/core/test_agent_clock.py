"""What a robot does whose own clock stops or is set."""

from __future__ import annotations

import pytest

from protocol.phases import (
    ARMED,
    BRAKING,
    CLOCK_UNSURE,
    FREEZE,
    FROZEN,
    GO,
    IDLE,
    LEASE_OUT,
    MOVING,
    NO_FAULT,
)
from sim.world.body import SimulatedBody
from tests.robot_agent.core.phases import BODY_ACCEL, LENGTH, MOTION, PATH, run_in
from tests.robot_agent.core.rides import MS, SECOND, armed_run, driven_run, motion_along

WAITING = motion_along(LENGTH, 0.475, 0.5, stops=[(0.0, 5.0)])


def pause(run, nanoseconds):
    """Stop the robot's computer, its clock included."""
    run.now = run.due = run.due + nanoseconds
    run.offset_ns -= nanoseconds


@pytest.mark.parametrize("seconds", [0.45, 2.0, 6.0])
def test_a_robot_whose_computer_was_stopped_while_it_waited_does_not_set_out(seconds):
    run = driven_run(PATH, WAITING, 1.0)
    pause(run, round(seconds * SECOND))
    run.until(run.start_ns + 20 * SECOND)
    assert (run.agent.phase, run.agent.fault) == (FROZEN, CLOCK_UNSURE)
    assert run.agent.ride.follower.s == pytest.approx(0.0, abs=0.03)


def test_a_robot_whose_computer_was_stopped_under_way_brakes():
    run = run_in(MOVING)
    pause(run, 400 * MS)
    run.until(run.now + 120 * MS)
    assert (run.agent.phase, run.agent.fault) == (BRAKING, CLOCK_UNSURE)
    run.until(run.now + 2 * SECOND)
    assert run.agent.phase == FROZEN


@pytest.mark.parametrize("seconds", [-6.0, 0.45, 6.0])
def test_an_armed_robot_whose_clock_is_wrong_is_not_armed_before_it_is_right(seconds):
    run = armed_run(PATH, WAITING)
    if seconds > 0.0:
        pause(run, round(seconds * SECOND))
        run.start_ns += round(seconds * SECOND)
    else:
        run.offset_ns -= round(seconds * SECOND)
    before = len(run.phases)
    run.until(run.now + 600 * MS)
    assert set(run.phases[before:]) == {ARMED, IDLE}
    assert run.agent.phase == ARMED
    run.command(GO)
    run.until(run.start_ns + 8 * SECOND)
    assert (run.agent.phase, run.agent.fault) == (MOVING, NO_FAULT)
    run.until(run.start_ns + 20 * SECOND)
    late = abs(run.agent.clock.offset_ns + run.offset_ns)
    assert late <= 3 * MS


@pytest.mark.parametrize(("seconds", "fault"), [(0.4, CLOCK_UNSURE), (2.0, LEASE_OUT)])
def test_a_robot_whose_clock_was_set_forwards_stands_and_then_gives_up(seconds, fault):
    run = run_in(MOVING)
    run.offset_ns += round(seconds * SECOND)
    before = run.agent.ride.follower.s
    run.until(run.now + 500 * MS)
    assert (run.agent.phase, run.agent.fault) == (FROZEN, fault)
    assert run.agent.ride.follower.s - before <= 0.475 * 0.05 + 1e-3  # until the watchdog stops it


def test_a_robot_that_hung_and_cannot_ask_the_time_gives_up_when_it_may_be_late():
    run = driven_run(PATH, WAITING, 1.0)
    run.now = run.due = run.due + 100 * MS
    run.until(run.now + 240 * MS, talking=False)
    assert (run.agent.phase, run.agent.drive_speed) == (MOVING, 0.0)
    run.until(run.now + 40 * MS, talking=False)
    assert (run.agent.phase, run.agent.fault) == (BRAKING, CLOCK_UNSURE)


def test_new_times_are_not_taken_while_the_time_is_not_known():
    run = driven_run(PATH, WAITING, 1.0)
    run.now = run.due = run.due + 100 * MS
    run.until(run.now + 11 * MS, talking=False)
    later = (*WAITING[:3], [6.0])
    run.agent.hear_times(77, 1, 1, later, run.own(run.now))
    assert run.agent.revision == 0
    run.until(run.now + 100 * MS)
    run.agent.hear_times(77, 1, 1, later, run.own(run.now))
    assert run.agent.revision == 1


def test_a_robot_that_brakes_rests_no_later_because_its_clock_was_set():
    run = driven_run(PATH, MOTION, 1.5, body=SimulatedBody(BODY_ACCEL))
    began = run.now
    run.command(FREEZE)
    run.until(run.now + 200 * MS)
    run.offset_ns += 2 * SECOND
    while run.agent.phase != FROZEN:
        run.until(run.now + 11 * MS)
    assert run.now - began <= SECOND * 0.475 / BODY_ACCEL + 200 * MS
