from __future__ import annotations

import math
import statistics

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.phases import MOVING
from sim.world.body import TURN_RATE, SimulatedBody
from tests.robot_agent.core.phases import run_in

MS = 1_000_000


def placed(*args, **options) -> SimulatedBody:
    body = SimulatedBody(*args, **options)
    body.place(0.0, 0.0, 0.0)
    body.step(0)
    return body


def test_a_body_that_nobody_has_placed_does_not_know_where_it_is():
    body = SimulatedBody()
    body.step(0)
    body.drive(1.0, 0.0, 1.0)
    body.step(10 * MS)
    assert body.pose() is None
    assert body.true_pose() is None


@pytest.mark.parametrize("steps", [1, 7, 40])
def test_an_arc_ends_on_its_circle_however_it_is_cut(steps):
    body = placed()
    for i in range(1, steps + 1):
        body.drive(20.0, 2.0, math.inf)
        body.step(40 * MS * i // steps)
    angle = 20.0 * 0.04 * 2.0
    assert body.pose() == pytest.approx((math.sin(angle) / 2, (1 - math.cos(angle)) / 2, angle))


def test_speed_slews_a_quarter_harder_than_plans_ask():
    body = placed(0.5)
    for i in range(1, 101):
        body.drive(0.5, 0.0, 1.0)
        body.step(i * 10 * MS)
    assert body.x == pytest.approx(0.5 * 1.0 - 0.5 * 0.5**2 / 0.625)
    assert body.speed == 0.5


def test_no_time_changes_no_speed_but_that_of_a_body_without_inertia():
    for accel, speed in ((0.5, 0.0), (math.inf, 0.5)):
        body = placed(accel)
        body.drive(0.5, 0.0, 1.0)
        body.step(0)
        assert body.speed == speed


def test_a_body_that_is_not_fed_stops_after_fifty_milliseconds():
    body = placed()
    body.drive(1.0, 0.0, math.inf)
    body.step(10 * MS)
    body.step(3_000 * MS)
    assert body.x == pytest.approx(0.05)
    assert body.speed == 0.0


@pytest.mark.parametrize("cut", [1, 7, 1000])
def test_a_body_whose_loop_hangs_stands_still_within_the_distance_ordered(cut):
    run = run_in(MOVING)
    agent, body, hung = run.agent, run.body, run.own(run.now)
    body.step(hung)
    body.drive(agent.drive_speed, agent.drive_curvature, agent.drive_distance)
    began, ordered = body.pose(), agent.drive_distance
    assert 0.0 < body.speed <= agent.drive_speed * 1.001
    places = []
    for now in range(hung + cut * MS, hung + 3_001 * MS, cut * MS):
        body.step(now)
        places.append((now - hung, body.pose()))
    moved = math.dist(began[:2], body.pose()[:2])
    assert 0.0 < moved <= min(ordered, agent.drive_speed * 0.05) + 1e-12
    assert {pose for passed, pose in places if passed >= 50 * MS} == {body.pose()}
    assert body.speed == 0.0
    body.drive(agent.drive_speed, agent.drive_curvature, agent.drive_distance)
    assert body.pose()[:2] == places[-1][1][:2]


@settings(derandomize=True, max_examples=60)
@given(
    st.lists(
        st.tuples(
            st.floats(0.0, 2.0), st.floats(-20.0, 20.0), st.floats(0.0, 0.05), st.integers(0, 80)
        ),
        max_size=30,
    ),
    st.sampled_from([math.inf, 0.5, 3.0]),
)
def test_no_order_is_ever_exceeded_in_speed_or_distance(orders, accel):
    body = placed(accel)
    now, fastest = 0, 0.0
    for speed, curvature, distance, wait in orders:
        before = body.pose()
        fastest = max(fastest, speed)
        body.drive(speed, curvature, distance)
        now += wait * MS
        body.step(now)
        moved = math.dist(before[:2], body.pose()[:2])
        assert moved <= distance + 1e-12
        assert moved <= fastest * min(wait, 50) / 1000 + 1e-12
        assert body.speed <= fastest


def test_wheels_with_a_wrong_gain_go_too_far():
    body = placed(wheel_gain=1.03)
    body.drive(1.0, 0.0, 0.02)
    body.step(50 * MS)
    assert body.x == pytest.approx(0.0206)


def test_noise_is_in_the_measured_pose_alone_and_comes_from_the_seed():
    bodies = [placed(noise=0.002, seed=3) for _ in range(2)]
    measured = [[body.pose()[0] for _ in range(400)] for body in bodies]
    assert measured[0] == measured[1]
    assert statistics.pstdev(measured[0]) == pytest.approx(0.002, rel=0.1)
    assert bodies[0].true_pose() == (0.0, 0.0, 0.0)


def test_stop_stops_and_place_moves_the_body():
    body = placed(0.1)
    body.drive(0.1, 0.0, 1.0)
    body.step(40 * MS)
    body.stop()
    assert body.speed == 0.0
    body.place(3.0, 4.0, 1.0)
    body.step(10_000 * MS)
    assert body.pose() == (3.0, 4.0, 1.0)


def test_a_body_turns_on_the_spot_at_its_rate_and_no_longer_than_its_watchdog():
    body = placed(0.1)
    body.turn(0.5)
    body.step(40 * MS)
    assert body.true_pose() == pytest.approx((0.0, 0.0, 0.04 * TURN_RATE))
    body.step(10_000 * MS)
    assert body.heading == pytest.approx(0.05 * TURN_RATE)
    body.turn(-0.02)
    body.step(10_050 * MS)
    assert body.heading == pytest.approx(0.05 * TURN_RATE - 0.02)
