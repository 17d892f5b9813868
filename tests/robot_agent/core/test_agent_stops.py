"""When an agent goes, brakes and rests."""

from __future__ import annotations

import math

import pytest

from protocol.phases import (
    ARMED,
    BRAKING,
    CLOCK_UNSURE,
    DONE,
    DRIVER_ERROR,
    FREEZE,
    FROZEN,
    GO,
    LATE,
    LEASE_OUT,
    MOVING,
    NO_FAULT,
    OFF_PATH,
)
from sim.world.body import SimulatedBody
from tests.robot_agent.core.phases import LENGTH, MOTION, PATH, run_in
from tests.robot_agent.core.rides import MS, RULES, SECOND, armed_run, driven_run, motion_along


def test_a_robot_bears_silence_for_its_lease_and_then_brakes():
    run = run_in(MOVING)
    run.command(GO)
    heard = run.now
    run.until(heard + 595 * MS, talking=False)
    assert (run.agent.phase, run.agent.fault) == (MOVING, NO_FAULT)
    run.until(heard + 625 * MS, talking=False)
    assert (run.agent.phase, run.agent.fault) == (BRAKING, LEASE_OUT)


def hung(run, milliseconds):
    """Let the time pass without a tick."""
    run.now = run.due = run.due + milliseconds * MS


def test_a_word_that_waited_while_the_robot_hung_renews_no_lease_that_has_run_out():
    run = driven_run(PATH, motion_along(LENGTH, 0.475, 0.5, stops=[(0.0, 5.0)]), 1.0)
    hung(run, 700)
    assert run.agent.phase == MOVING
    run.command(GO)
    assert (run.agent.phase, run.agent.fault) == (BRAKING, LEASE_OUT)
    run.until(run.start_ns + 8 * SECOND)
    assert (run.agent.phase, run.agent.fault) == (FROZEN, LEASE_OUT)
    assert run.agent.ride.follower.s == pytest.approx(0.0, abs=1e-3)


def test_old_words_at_a_steady_rate_renew_no_lease():
    """What a slow link holds back comes late, but as often as ever."""
    run = run_in(MOVING)
    run.until(run.now + SECOND, age=400 * MS)
    assert run.agent.phase == MOVING
    run.until(run.now + SECOND, age=5 * SECOND)
    assert (run.agent.phase, run.agent.fault) == (BRAKING, LEASE_OUT)


def test_a_word_is_as_old_as_the_coordinators_clock_says_whatever_the_robots_own_shows():
    for offset in (-(10**6) * SECOND, 10**6 * SECOND):
        for age, phase in ((400 * MS, MOVING), (900 * MS, BRAKING)):
            run = driven_run(PATH, motion_along(LENGTH, 0.475, 0.5), 2.0, offset_ns=offset)
            run.until(run.now + SECOND, age=age)
            assert run.agent.phase == phase


def test_an_old_go_sets_no_robot_going_though_its_plan_waits_at_the_start():
    run = armed_run(PATH, motion_along(LENGTH, 0.475, 0.5, stops=[(0.0, 30.0)]))
    run.until(run.start_ns + 10 * SECOND)
    run.command(GO, age=10 * SECOND)
    assert run.agent.phase == ARMED
    run.until(run.now + 200 * MS, talking=False)
    run.command(GO)
    assert run.agent.phase == MOVING


def test_a_robot_that_hung_for_less_than_its_lease_goes_on():
    run = driven_run(PATH, motion_along(LENGTH, 0.475, 0.5, stops=[(0.0, 5.0)]), 1.0)
    hung(run, 400)
    run.command(GO)
    run.until(run.start_ns + 8 * SECOND)
    assert (run.agent.phase, run.agent.fault) == (MOVING, NO_FAULT)
    assert run.agent.ride.follower.s > 0.5


def test_a_freeze_brakes_along_the_path_as_the_plan_says():
    run = run_in(MOVING)
    run.until(run.now + 500 * MS)
    before, began = run.agent.ride.follower.s, run.now
    run.command(FREEZE)
    while run.agent.phase != FROZEN:
        run.until(run.now + 11 * MS)
    way = run.agent.ride.follower.s - before
    assert way == pytest.approx(0.475**2 / (2 * 0.5), rel=0.05)
    assert (run.now - began) / SECOND == pytest.approx(0.475 / 0.5 + 0.1, abs=0.04)
    assert run.agent.fault == NO_FAULT


def test_a_robot_told_to_stop_at_once_does():
    rules = (*RULES[:3], 0, RULES[4])
    motion = motion_along(LENGTH, 0.475, math.inf)
    run = driven_run(PATH, motion, 1.0, rules=rules)
    s = run.agent.ride.follower.s
    run.command(FREEZE)
    run.until(run.now + 150 * MS)
    assert run.agent.phase == FROZEN
    assert run.agent.ride.follower.s - s <= 0.475 * 0.01 + 1e-6


def test_a_braking_robot_does_not_pass_a_stop_of_its_plan():
    motion = motion_along(LENGTH, 0.475, 0.5, [(0.8, 60.0)])
    run = driven_run(PATH, motion, 1.5, rules=(*RULES[:3], 100, RULES[4]), body=SimulatedBody(0.5))
    run.command(FREEZE)
    run.until(run.now + 8 * SECOND)
    assert run.agent.phase == FROZEN
    assert run.agent.ride.follower.s <= 0.8 + 1e-6


def test_a_go_heard_beyond_the_share_of_tau_is_not_obeyed():
    run = run_in(ARMED)
    run.start_ns = run.now - 250 * MS - 100 * MS
    run.command(GO)
    assert (run.agent.phase, run.agent.fault) == (FROZEN, LATE)
    run.until(run.now + SECOND)
    assert run.places[0] == run.places[-1]


def test_a_go_heard_late_within_the_share_is_caught_up_by_the_speed_reserve():
    run = run_in(ARMED)
    run.start_ns = run.now - 200 * MS
    run.command(GO)
    run.until(run.now + 10 * SECOND)
    assert (run.agent.phase, run.agent.fault) == (DONE, NO_FAULT)


def test_a_late_start_in_the_plan_makes_a_late_go_harmless():
    run = armed_run(PATH, motion_along(LENGTH, 0.475, 0.5, [(0.0, 4.0)]))
    run.start_ns = run.now - 2 * SECOND
    run.command(GO)
    assert run.agent.phase == MOVING


@pytest.mark.parametrize("pose", [(0.0, 0.02), (0.0, -0.02), (math.nan, 0.0)])
def test_a_robot_off_its_path_brakes(pose):
    run = run_in(MOVING)
    x, y, heading = run.body.pose()
    turned = heading + math.pi / 2
    place = (x + pose[0] + pose[1] * math.cos(turned), y + pose[1] * math.sin(turned), heading)
    run.agent.tick(run.own(run.now), *place)
    assert (run.agent.phase, run.agent.fault) == (BRAKING, OFF_PATH)
    assert math.isfinite(run.agent.drive_curvature)


def test_a_robot_that_is_held_back_reports_it_when_its_share_of_tau_is_used_up():
    run = run_in(MOVING)
    pose, held = run.body.pose(), run.now
    while run.agent.phase == MOVING:
        run.now += 10 * MS
        run.command(GO)
        run.agent.tick(run.own(run.now), *pose)
    assert run.agent.fault == LATE
    assert 240 * MS <= run.now - held <= 280 * MS


def test_a_driver_error_is_kept_as_the_fault_of_the_robot():
    run = run_in(MOVING)
    run.agent.hear_driver_error(run.own(run.now))
    run.until(run.now + 2 * SECOND)
    assert (run.agent.phase, run.agent.fault) == (FROZEN, DRIVER_ERROR)


def test_a_robot_whose_clock_became_uncertain_brakes():
    run = run_in(MOVING)
    run.agent.clock.start_over(run.own(run.now))
    run.until(run.now + 200 * MS, talking=False)
    assert (run.agent.phase, run.agent.drive_speed) == (MOVING, 0.0)
    run.until(run.now + 100 * MS, talking=False)
    assert (run.agent.phase, run.agent.fault) == (BRAKING, CLOCK_UNSURE)


def test_a_robot_that_is_slower_than_it_was_ordered_does_not_speed_up_to_brake():
    run = driven_run(PATH, MOTION, 2.5, body=SimulatedBody(0.5))
    run.body.speed = 0.0  # its wheels were blocked for a moment
    for _ in range(12):
        run.until(run.now + 11 * MS)
        if run.agent.phase != MOVING:
            break
    assert run.body.speed < 0.1
    run.command(FREEZE)
    run.body._wanted = 0.0
    fastest = run.body.speed
    while run.agent.phase != FROZEN:
        run.until(run.now + 11 * MS)
        assert run.body.speed <= fastest + 0.11
