"""A robot that stands because it is late, and what new times make of it."""

from __future__ import annotations

import numpy as np
import pytest

from protocol.phases import (
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
from protocol.timeline import Timeline
from tests.robot_agent.core.phases import LENGTH, MOTION, run_in
from tests.robot_agent.core.rides import COORDINATOR, MS, SECOND, motion_along

PLANNED = Timeline(*MOTION)


def held_up(seconds=1.0):
    """Return a robot on its way whose wheels stood still for a while, and where."""
    run = run_in(MOVING)
    pose = run.body.pose()
    end = run.now + round(seconds * SECOND)
    while run.now < end:
        run.now += 10 * MS
        run.command(GO)
        run.agent.tick(run.own(run.now), *pose)
    run.due = run.now
    run.body.step(run.own(run.now))
    run.body.place(*pose)
    return run


def new_times(run, s, depart, revision=1, boot=COORDINATOR, epoch=1):
    motion = motion_along(LENGTH, 0.475, 0.5, [(s, depart)])
    run.agent.hear_times(boot, epoch, revision, motion, run.own(run.now))


def seconds(run):
    return (run.now - run.start_ns) / SECOND


def test_a_robot_that_is_late_says_which_plan_time_has_it_where_it_stands_and_no_place():
    run = held_up()
    assert (run.agent.phase, run.agent.fault, run.agent.awaits_times()) == (FROZEN, LATE, True)
    assert run.agent.report_due(run.own(run.now) + 200 * MS)
    assert run.agent.report_s is None
    s = PLANNED.s_at(run.agent.rest.stood_us / 1e6)
    assert s == pytest.approx(run.agent.ride.follower.s, abs=1e-5)


def test_a_robot_held_up_is_ordered_to_stand_at_once_and_rests_soon():
    run = held_up(0.45)
    assert run.agent.phase == FROZEN


def test_told_to_freeze_it_says_its_place_when_asked():
    run = held_up()
    run.command(FREEZE, wanted=True)
    assert not run.agent.awaits_times()
    assert run.agent.report_due(run.own(run.now) + 200 * MS)
    assert run.agent.report_s == run.agent.rest.s


def test_with_new_times_it_stands_until_they_let_it_go_and_arrives_by_them():
    run = held_up()
    s, depart = run.agent.ride.follower.s, seconds(run) + 1.0
    new_times(run, s, depart)
    assert (run.agent.phase, run.agent.fault, run.agent.revision) == (MOVING, NO_FAULT, 1)
    timeline = Timeline(*motion_along(LENGTH, 0.475, 0.5, [(s, depart)]))
    while seconds(run) < depart - 0.05:
        run.until(run.now + 11 * MS)
        assert run.agent.ride.follower.s == pytest.approx(s, abs=2e-3)
    for time in np.arange(depart, timeline.finish, 0.2):
        run.until(run.start_ns + round(time * SECOND))
        assert run.agent.phase == MOVING
        assert run.agent.ride.follower.s == pytest.approx(timeline.s_at(seconds(run)), abs=0.03)
    run.until(run.now + SECOND)
    assert run.agent.ride.at_goal()


@pytest.mark.parametrize("wrong", [{"boot": COORDINATOR + 1}, {"epoch": 2}, {"revision": 0}])
def test_new_times_of_another_plan_change_nothing(wrong):
    run = held_up()
    new_times(run, run.agent.ride.follower.s, seconds(run) + 1.0, **wrong)
    assert (run.agent.phase, run.agent.revision) == (FROZEN, 0)


def test_new_times_that_would_have_it_behind_where_it_is_change_nothing():
    run = held_up()
    new_times(run, 0.5 * run.agent.ride.follower.s, seconds(run) + 1.0)
    assert (run.agent.phase, run.agent.revision) == (FROZEN, 0)


def test_new_times_of_another_length_or_that_make_no_sense_change_nothing():
    run = run_in(MOVING)
    now = run.own(run.now)
    run.agent.hear_times(COORDINATOR, 1, 1, motion_along(LENGTH + 0.1, 0.475, 0.5), now)
    run.agent.hear_times(COORDINATOR, 1, 1, ([0.0, 1.0], [0.0, 0.0], [], []), now)
    assert (run.agent.phase, run.agent.revision) == (MOVING, 0)


def test_new_times_that_come_after_freeze_let_nobody_go():
    run = held_up()
    run.command(FREEZE)
    new_times(run, run.agent.ride.follower.s, seconds(run) + 1.0)
    assert (run.agent.phase, run.agent.revision) == (FROZEN, 0)


def test_a_moving_robot_with_an_additional_stop_ahead_goes_on_without_a_jerk():
    run = run_in(MOVING)
    before = run.agent.drive_speed
    new_times(run, 0.6 * LENGTH, 30.0)
    run.until(run.now + 11 * MS)
    assert run.agent.drive_speed == pytest.approx(before, abs=0.02)
    run.until(run.start_ns + 20 * SECOND)
    assert run.agent.ride.follower.s == pytest.approx(0.6 * LENGTH, abs=5e-3)
    assert (run.agent.phase, run.agent.revision) == (MOVING, 1)


def test_a_robot_that_stands_late_and_hears_nothing_for_a_lease_goes_on_with_no_new_times():
    run = held_up()
    pose = run.body.pose()
    run.now += 700 * MS
    run.agent.tick(run.own(run.now), *pose)
    assert (run.agent.phase, run.agent.fault) == (FROZEN, LEASE_OUT)
    run.command(GO)
    new_times(run, run.agent.ride.follower.s, seconds(run) + 1.0)
    assert (run.agent.phase, run.agent.revision) == (FROZEN, 0)


def test_new_times_that_come_before_a_robot_has_noticed_the_silence_change_nothing():
    run = held_up()
    run.now += 700 * MS
    new_times(run, run.agent.ride.follower.s, seconds(run) + 1.0)
    assert (run.agent.phase, run.agent.revision) == (FROZEN, 0)


def test_a_robot_that_is_pushed_off_its_path_while_it_stands_late_says_so_and_where():
    run = held_up()
    x, y, heading = run.body.pose()
    run.agent.tick(run.own(run.now), x, y + 0.3, heading)
    assert (run.agent.phase, run.agent.fault, run.agent.awaits_times()) == (
        FROZEN,
        OFF_PATH,
        False,
    )
    assert run.agent.report_due(run.own(run.now) + 200 * MS)
    assert run.agent.report_s == run.agent.rest.s
    assert abs(run.agent.rest.off) > 200


def test_a_robot_that_leaves_its_path_while_it_brakes_for_being_late_does_not_ask_for_new_times():
    run = run_in(MOVING)
    x, y, heading = run.body.pose()
    while run.agent.phase == MOVING:
        run.now += 10 * MS
        run.command(GO)
        run.agent.tick(run.own(run.now), x, y, heading)
    run.agent.tick(run.own(run.now), x, y + 0.3, heading)
    assert run.agent.fault == OFF_PATH


def test_a_driver_error_while_a_robot_stands_late_is_what_it_reports():
    run = held_up()
    run.agent.hear_driver_error(run.own(run.now))
    assert (run.agent.phase, run.agent.fault, run.agent.awaits_times()) == (
        FROZEN,
        DRIVER_ERROR,
        False,
    )
