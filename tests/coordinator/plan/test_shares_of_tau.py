"""What "auto" for tau is made of, and what a tau by hand promises."""

import math

import numpy as np
import pytest

from coordinator.plan.document import Limits
from coordinator.plan.shares_of_tau import LEAST_TAU, SURVIVED, resolve_tau, shares_of, survived
from coordinator.planning.planner import plan_fleet
from coordinator.scenario.model import Link
from tests.scenarios import a_robot, a_scenario


def limits(speed, accel):
    return Limits(max_speed=speed, max_accel=accel)


GOOD = Link()


def auto(fleet, link=GOOD):
    return resolve_tau("auto", shares_of(fleet, link))


def test_auto_is_the_sum_of_all_shares_counted_by_hand():
    braking = 2.0 * (1.0 - math.sqrt(0.2)) / 0.8
    by_hand = 0.1 + 0.2 + 0.2 + braking + 0.05
    assert auto([limits(0.5, 0.5), limits(1.0, 0.5)]) == pytest.approx(by_hand, abs=1e-3)


def test_auto_is_at_most_1_3_s_for_a_robot_that_brakes_within_a_second():
    assert auto([limits(1.0, 1.0)]) <= 1.3


def test_a_link_that_loses_and_delays_messages_stretches_auto():
    good = auto([limits(1.0, 1.0)])
    assert auto([limits(1.0, 1.0)], Link(delay=0.1)) == pytest.approx(good + 0.2)
    assert auto([limits(1.0, 1.0)], Link(loss=0.1)) == pytest.approx(good + 2 * 0.2 + 0.1)


def test_every_proven_plan_survives_all_faults_down_to_the_least_tau():
    assert survived(LEAST_TAU) == survived(60.0) == list(SURVIVED)
    assert survived(LEAST_TAU - 0.001) == []


def test_a_tau_by_hand_stands():
    assert resolve_tau(0.31, shares_of([limits(1.0, 1.0)], Link())) == 0.31


def test_the_slowest_brake_counts_and_robots_that_stop_at_once_need_none():
    both = shares_of([limits(1.0, 4.0), limits(1.0, 0.5)], Link())
    assert both.braking == shares_of([limits(1.0, 0.5)], Link()).braking
    assert shares_of([limits(1.0, None)], Link()).braking == 0.0
    assert shares_of([], Link()).braking == 0.0


def test_within_the_share_for_braking_every_course_gets_on_by_its_braking_distance():
    robot = a_robot("R1", (1, 1), (9, 7), via=((7, 2),), max_speed=0.9, max_accel=0.6)
    plan = plan_fleet(a_scenario([robot], speed_reserve=0.0))
    (course,) = plan.driven
    share = shares_of([Limits.of(robot)], Link()).braking
    line = course.timeline
    for time in np.arange(0.0, line.finish - share, 0.01).tolist():
        room = line.s_at(time + share) - line.s_at(time)
        assert room >= line.v_at(time) ** 2 / (2.0 * robot.max_accel) - 1e-6


def test_auto_is_a_whole_number_of_milliseconds():
    tau = auto([limits(1.0, 0.7)])
    assert math.isclose(tau * 1000.0, round(tau * 1000.0), abs_tol=1e-9)
