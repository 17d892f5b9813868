"""When an agent goes, brakes and rests."""

from __future__ import annotations

import math

import pytest

from protocol.curve import Curve
from protocol.phases import (
    ARMED,
    BRAKING,
    DONE,
    DRIVER_ERROR,
    FREEZE,
    FROZEN,
    GO,
    HOLD,
    IDLE,
    MOVING,
    NO_FAULT,
    OFF_PATH,
    STOP,
)
from protocol.timing import LATE_STEP_MS
from sim.world.body import SimulatedBody
from tests.robot_agent.core.phases import LENGTH, MOTION, PATH, run_in
from tests.robot_agent.core.rides import (
    AT_ONCE,
    MS,
    RULES,
    SECOND,
    armed_run,
    driven_run,
    give_plan,
    motion_along,
    winding_path,
)


def place(run) -> float:
    return run.agent.ride.follower.s


def test_a_robot_that_hears_no_command_drives_on_as_granted():
    run = run_in(MOVING)
    run.until(run.start_ns + 20 * SECOND, talking=False)
    assert (run.agent.phase, run.agent.fault) == (DONE, NO_FAULT)


@pytest.mark.parametrize(("rules", "accel"), [(RULES, 0.5), (AT_ONCE, math.inf)])
def test_a_robot_that_hears_no_command_stands_at_its_authority_and_goes_on_when_it_hears_one(
    rules, accel
):
    motion = motion_along(LENGTH, 0.475, accel)
    run = armed_run(PATH, motion, rules, body=SimulatedBody(accel))
    run.authority = 1_700
    run.command(GO)
    run.until(run.start_ns + 60 * SECOND, talking=False)
    assert (run.agent.phase, run.agent.fault) == (MOVING, NO_FAULT)
    assert run.body.speed == pytest.approx(0.0, abs=1e-3)
    assert place(run) < LENGTH - 0.2
    run.authority = 20_000
    run.until(run.now + 20 * SECOND)
    assert (run.agent.phase, run.agent.fault) == (DONE, NO_FAULT)


def test_a_robot_that_is_granted_nothing_does_not_set_out_and_bears_it():
    run = armed_run(PATH, MOTION)
    run.authority = 0
    run.command(GO)
    run.until(run.start_ns + 20 * SECOND)
    assert (run.agent.phase, run.agent.fault) == (MOVING, NO_FAULT)
    assert place(run) == 0.0


def test_a_plan_of_a_later_epoch_begins_with_no_authority():
    run = run_in(FROZEN)
    run.epoch, run.start_ns = 2, run.now + SECOND
    run.command(HOLD)
    run.body.place(1.0, 2.0, 0.3)
    give_plan(run.agent, PATH, MOTION, epoch=2)
    run.until(run.now + 500 * MS)
    run.authority = -(2**31)
    run.command(GO)
    run.until(run.start_ns + 3 * SECOND)
    assert (run.agent.phase, place(run)) == (MOVING, 0.0)


@pytest.mark.parametrize("milliseconds", [100, 400, 700, 6_000])
def test_a_robot_that_hung_goes_on(milliseconds):
    run = driven_run(PATH, motion_along(LENGTH, 0.475, 0.5, stops=[(0.0, 5.0)]), 1.0)
    run.now = run.due = run.due + milliseconds * MS
    assert run.agent.phase == MOVING
    run.command(GO)
    run.until(run.start_ns + 20 * SECOND)
    assert (run.agent.phase, run.agent.fault) == (DONE, NO_FAULT)


def test_a_stop_brakes_at_once_and_a_go_lets_the_robot_go_on():
    run = run_in(MOVING)
    run.until(run.now + 500 * MS)
    before, began = place(run), run.now
    run.command(STOP)
    run.until(began + round(0.475 / 0.5 * SECOND) + 50 * MS)
    assert (run.agent.phase, run.agent.fault) == (MOVING, NO_FAULT)
    assert run.agent.drive_speed == 0.0
    stood = place(run)
    assert stood - before == pytest.approx(0.475**2 / (2 * 0.5), rel=0.05)
    run.until(run.now + 30 * SECOND)
    assert (run.agent.phase, place(run)) == (MOVING, pytest.approx(stood, abs=1e-9))
    run.command(GO)
    run.until(run.now + 20 * SECOND)
    assert (run.agent.phase, run.agent.fault) == (DONE, NO_FAULT)


@pytest.mark.parametrize("early", [0.01, 0.012])
def test_a_robot_that_a_stop_holds_just_before_its_goal_drives_there_when_it_may(early):
    """It is not taken for one that has come as near to its goal as it can."""
    run = run_in(MOVING)
    while place(run) < LENGTH - early - 0.475**2 / (2 * 0.5):
        run.until(run.due + MS)
    run.command(STOP)
    run.until(run.now + 5 * SECOND)
    assert (run.agent.phase, run.agent.fault) == (MOVING, NO_FAULT)
    assert 1e-3 < LENGTH - place(run) < 0.01
    run.command(GO)
    run.until(run.now + 3 * SECOND)
    assert (run.agent.phase, run.agent.fault) == (DONE, NO_FAULT)
    assert place(run) == pytest.approx(LENGTH, abs=1e-3)


def test_a_robot_that_stops_at_once_does_so_at_a_stop():
    run = driven_run(PATH, motion_along(LENGTH, 0.475, math.inf), 1.0, rules=AT_ONCE)
    before = place(run)
    run.command(STOP)
    run.until(run.now + SECOND)
    assert place(run) - before <= 2 * 0.475 * 0.01 + 1e-6


def a_fast_run():
    path = winding_path("f" * 13, step=2.0)
    motion = motion_along(Curve(*path).length, 3.0, 2.0)
    rules = (RULES[0], 2_000, RULES[2])
    return driven_run(path, motion, 4.0, rules=rules, max_speed=3.3, body=SimulatedBody(2.0))


def test_a_fast_robot_that_is_stopped_is_not_off_its_path():
    run = a_fast_run()
    run.command(STOP)
    run.until(run.now + 3 * SECOND)
    assert (run.agent.phase, run.agent.fault) == (MOVING, NO_FAULT)


def test_a_fast_robot_whose_start_is_put_off_is_not_off_its_path():
    run = a_fast_run()
    run.start_ns += 2 * SECOND
    run.command(GO)
    run.until(run.now + 3 * SECOND)
    assert (run.agent.phase, run.agent.fault) == (MOVING, NO_FAULT)


def test_a_stop_grants_nothing():
    run = armed_run(PATH, MOTION)
    run.authority = 0
    run.command(GO)
    run.authority = 10_000
    run.command(STOP)
    run.authority = 0
    run.command(GO)
    run.until(run.start_ns + 5 * SECOND)
    assert (run.agent.phase, place(run)) == (MOVING, 0.0)


def test_a_stop_sets_no_armed_robot_going():
    run = run_in(ARMED)
    run.command(STOP)
    run.until(run.start_ns + SECOND)
    assert run.agent.phase == ARMED
    run.command(GO)
    run.until(run.now + SECOND)
    assert (run.agent.phase, run.agent.fault) == (MOVING, NO_FAULT)
    assert place(run) > 0.1


def test_the_pause_of_a_stop_is_made_up_for_by_a_later_start():
    """The plan's clock pauses too, so the robot is late by no more than it takes to speed up."""
    run = run_in(MOVING)
    run.command(STOP)
    run.until(run.now + 5 * SECOND)
    stopped = run.agent.ride.time
    run.start_ns = run.now - round(stopped * SECOND)
    run.command(GO)
    run.until(run.now + SECOND)
    assert run.agent.report_due(run.own(run.now))
    assert LATE_STEP_MS * run.agent.report_late <= 1000 * 0.475 / (2 * 0.5)
    assert (run.agent.phase, run.agent.fault) == (MOVING, NO_FAULT)


def test_a_freeze_after_a_stop_freezes_where_the_robot_stands():
    run = run_in(MOVING)
    run.command(STOP)
    run.until(run.now + 2 * SECOND)
    stood = place(run)
    run.command(FREEZE)
    run.until(run.now + SECOND)
    assert (run.agent.phase, run.agent.fault) == (FROZEN, NO_FAULT)
    assert place(run) == pytest.approx(stood, abs=1e-6)


@pytest.mark.parametrize("later", [0.3, 2.0, 10.0])
@pytest.mark.parametrize("accel", [0.5, math.inf])
def test_a_robot_whose_start_is_put_off_brakes_waits_and_is_not_off_its_path(accel, later):
    rules = RULES if accel == 0.5 else AT_ONCE
    motion = motion_along(LENGTH, 0.475, accel)
    run = driven_run(PATH, motion, 2.0, rules=rules, body=SimulatedBody(accel))
    before = place(run)
    run.start_ns += round(later * SECOND)
    run.command(GO)
    seen = len(run.phases)
    run.until(run.now + round(0.9 * later * SECOND))
    braked = 0.0 if accel == math.inf else 0.475**2 / (2 * accel)
    assert place(run) - before <= braked + 0.02
    run.until(run.start_ns + 2500 * MS)
    assert set(run.phases[seen:]) == {MOVING}
    assert run.agent.fault == NO_FAULT
    run.until(run.start_ns + 20 * SECOND)
    assert run.agent.phase == DONE
    speeding_up = 0.0 if accel == math.inf else 0.475 / accel
    finish = LENGTH / 0.475 + speeding_up
    arrived = run.times[run.phases.index(DONE)]
    assert finish - 0.02 <= arrived <= finish + speeding_up + 0.1


def test_a_freeze_brakes_along_the_path_as_the_plan_says():
    run = run_in(MOVING)
    run.until(run.now + 500 * MS)
    before, began = place(run), run.now
    run.command(FREEZE)
    while run.agent.phase != FROZEN:
        run.until(run.now + 11 * MS)
    way = place(run) - before
    assert way == pytest.approx(0.475**2 / (2 * 0.5), rel=0.05)
    assert (run.now - began) / SECOND == pytest.approx(0.475 / 0.5 + 0.1, abs=0.04)
    assert run.agent.fault == NO_FAULT


def test_a_robot_that_stops_at_once_does_so_at_a_freeze():
    motion = motion_along(LENGTH, 0.475, math.inf)
    run = driven_run(PATH, motion, 1.0, rules=AT_ONCE)
    s = place(run)
    run.command(FREEZE)
    run.until(run.now + 150 * MS)
    assert run.agent.phase == FROZEN
    assert place(run) - s <= 0.475 * 0.01 + 1e-6


def test_a_braking_robot_does_not_pass_a_stop_of_its_plan():
    motion = motion_along(LENGTH, 0.475, 0.5, [(0.8, 60.0)])
    run = driven_run(PATH, motion, 1.5, rules=(RULES[0], 100, RULES[2]), body=SimulatedBody(0.5))
    run.command(FREEZE)
    run.until(run.now + 8 * SECOND)
    assert run.agent.phase == FROZEN
    assert place(run) <= 0.8 + 1e-6


@pytest.mark.parametrize("speed", [0.5, 0.7])
@pytest.mark.parametrize("late", [0.2, 1.0, 30.0])
def test_a_go_heard_late_is_obeyed_and_caught_up_by_the_speed_reserve(late, speed):
    long = motion_along(LENGTH, 0.475, 0.5, [(0.4 * LENGTH, 2.5)])
    run = armed_run(PATH, long, max_speed=speed, body=SimulatedBody(0.5))
    run.until(run.start_ns + round(late * SECOND))
    run.command(GO)
    began = run.now
    run.until(began + 20 * SECOND)
    assert (run.agent.phase, run.agent.fault) == (DONE, NO_FAULT)
    took = run.times[run.phases.index(DONE)] - late
    alone = LENGTH / 0.475 + 2 * 0.475 / 0.5
    if late == 30.0:
        assert LENGTH / speed <= took <= alone + 0.3


def test_a_late_robot_does_not_wait_at_a_stop_whose_departure_has_passed():
    motion = motion_along(LENGTH, 0.475, 0.5, [(0.5 * LENGTH, 8.0)])
    run = armed_run(PATH, motion, body=SimulatedBody(0.5))
    run.until(run.start_ns + 9 * SECOND)
    run.command(GO)
    run.until(run.now + 6 * SECOND)
    assert (run.agent.phase, run.agent.fault) == (DONE, NO_FAULT)


@pytest.mark.parametrize("pose", [(0.0, 0.02), (0.0, -0.02), (math.nan, 0.0)])
def test_a_robot_off_its_path_brakes(pose):
    run = run_in(MOVING)
    x, y, heading = run.body.pose()
    turned = heading + math.pi / 2
    place = (x + pose[0] + pose[1] * math.cos(turned), y + pose[1] * math.sin(turned), heading)
    run.agent.tick(run.own(run.now), *place)
    assert (run.agent.phase, run.agent.fault) == (BRAKING, OFF_PATH)
    assert math.isfinite(run.agent.drive_curvature)


@pytest.mark.parametrize("held", [0.3, 2.0, 60.0])
def test_a_robot_that_is_held_back_says_how_late_it_is_and_then_goes_on(held):
    run = run_in(MOVING)
    pose, end = run.body.pose(), run.now + round(held * SECOND)
    while run.now < end:
        run.now += 10 * MS
        run.command(GO)
        run.agent.tick(run.own(run.now), *pose)
    run.due = run.now
    assert (run.agent.phase, run.agent.fault) == (MOVING, NO_FAULT)
    assert run.agent.report_due(run.own(run.now))
    assert LATE_STEP_MS * run.agent.report_late == pytest.approx(1000 * held, abs=51)
    run.until(run.now + 15 * SECOND)
    assert (run.agent.phase, run.agent.fault) == (DONE, NO_FAULT)


def test_a_driver_error_is_kept_as_the_fault_of_the_robot():
    run = run_in(MOVING)
    run.agent.hear_driver_error(run.own(run.now))
    run.until(run.now + 2 * SECOND)
    assert (run.agent.phase, run.agent.fault) == (FROZEN, DRIVER_ERROR)


def test_a_robot_whose_driver_fails_before_it_has_heard_a_command_arms_again_and_goes():
    """It holds its Plan, but does not know whose Commands it would obey once it had failed."""
    run = armed_run(PATH, MOTION, hears=False)
    run.agent.hear_driver_error(run.own(run.now))
    assert run.agent.phase == IDLE
    run.until(run.now + 100 * MS, talking=False)
    assert run.agent.phase == ARMED
    run.command(GO)
    run.until(run.start_ns + 2 * SECOND)
    assert (run.agent.phase, run.agent.fault) == (MOVING, NO_FAULT)


def test_a_robot_that_is_slower_than_it_was_ordered_does_not_speed_up_to_brake():
    run = driven_run(PATH, MOTION, 2.5, body=SimulatedBody(0.5))
    run.body.speed = 0.0  # its wheels were blocked for a moment
    for _ in range(20):
        run.until(run.now + 11 * MS)
    assert run.body.speed < 0.15
    run.command(FREEZE)
    run.body._wanted = 0.0
    fastest = run.body.speed
    while run.agent.phase != FROZEN:
        run.until(run.now + 11 * MS)
        assert run.body.speed <= fastest + 0.11
