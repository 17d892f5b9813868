"""Agent, steering and simulated body together, in virtual time, judged by SciPy's curve."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from protocol.phases import DONE, FROZEN, MOVING, NO_FAULT, OFF_PATH
from sim.world.body import SimulatedBody
from sim.world.failing_body import FailingBody
from tests.robot_agent.core.rides import (
    AT_ONCE,
    RULES,
    SECOND,
    armed_run,
    dense_line,
    driven_run,
    motion_along,
    winding_path,
)

PATH = winding_path()
LINE, ARC = dense_line(PATH)
LENGTH = float(ARC[-1])
STOP, DEPART, START = 2.0, 9.0, 0.5
SPEED = 0.475
TREE = cKDTree(LINE)


def finish_of(accel: float) -> float:
    """Return the arrival time [s] after the wait, by hand."""
    ramps = 0.0 if math.isinf(accel) else SPEED / accel
    return DEPART + (LENGTH - STOP) / SPEED + ramps


@pytest.mark.parametrize("accel", [math.inf, 0.5])
@pytest.mark.parametrize("gain", [0.97, 1.0, 1.03])
@pytest.mark.parametrize("seed", [None, 1])
def test_a_robot_with_a_jittering_loop_keeps_to_its_path_its_stops_and_its_time(accel, gain, seed):
    motion = motion_along(LENGTH, SPEED, accel, [(0.0, START), (STOP, DEPART)])
    run = driven_run(
        PATH,
        motion,
        finish_of(accel) + 0.5,
        seed=seed,
        body=SimulatedBody(accel, wheel_gain=gain),
        offset_ns=-123_456_789_012,
        drift_ppm=40,
    )
    times, places = np.array(run.times), np.array(run.places)
    off, nearest = TREE.query(places)
    assert off.max() < 0.002
    assert ARC[nearest][times <= START - 0.01].max() == 0.0
    assert ARC[nearest][times <= DEPART - 0.01].max() <= STOP + 0.001
    arrived = times[np.array(run.phases) == DONE]
    assert arrived[0] == pytest.approx(finish_of(accel), abs=0.05)
    assert run.agent.fault == NO_FAULT
    assert math.dist(places[-1], LINE[-1]) < 0.002


def test_a_robot_with_a_noisy_pose_stays_within_the_track_tolerance():
    motion = motion_along(LENGTH, SPEED, 0.5)
    run = driven_run(PATH, motion, 9.0, seed=5, body=SimulatedBody(0.5, noise=0.001, seed=9))
    assert run.agent.phase == DONE
    assert TREE.query(np.array(run.places))[0].max() < 0.005


@pytest.mark.parametrize("seed", range(4))
def test_a_robot_that_waits_long_with_a_noisy_pose_does_not_take_itself_for_late(seed):
    motion = motion_along(LENGTH, SPEED, 0.5, [(1.0, 60.0)])
    body = SimulatedBody(0.5, noise=0.001, seed=seed)
    run = driven_run(PATH, motion, 59.0, seed=5, body=body)
    assert (run.agent.phase, run.agent.fault) == (MOVING, NO_FAULT)


def test_a_robot_that_finds_itself_beside_its_path_comes_back_to_it():
    run = armed_run(winding_path("f" * 8), motion_along(1.808, SPEED, math.inf))
    run.body.x -= 0.006 * math.sin(0.3)
    run.body.y += 0.006 * math.cos(0.3)
    run.command(1)
    run.until(run.start_ns + 2_000_000_000)
    assert run.agent.phase == MOVING
    assert abs(run.agent.ride.follower.lateral) < 1e-4


@pytest.mark.parametrize("speed", [0.3, 1.0])
@pytest.mark.parametrize("held", [0.04, 0.08, 0.15])
@pytest.mark.parametrize(("place", "before"), [(STOP, 0.0), (STOP, 0.05), (LENGTH, 0.0)])
def test_a_robot_held_up_just_before_a_stop_or_its_goal_is_no_later_for_it(
    speed, held, place, before
):
    arrival = STOP / speed if place == STOP else DEPART + (LENGTH - STOP) / speed
    run = driven_run(
        PATH,
        motion_along(LENGTH, speed, math.inf, [(STOP, DEPART)]),
        arrival - held - before,
        max_speed=1.05 * speed,
        rules=AT_ONCE,
        body=FailingBody(),
    )
    run.body.stall(True)
    run.until(run.now + round(held * SECOND))
    run.body.stall(False)
    run.until(run.start_ns + round((DEPART + LENGTH / speed) * SECOND))
    assert (run.agent.phase, run.agent.fault) == (DONE, NO_FAULT)
    assert max(TREE.query(np.array(run.places))[0]) < 0.002


def test_a_fast_robot_settles_too():
    path = winding_path("ffffffllffffff", step=2.0)
    length = float(dense_line(path)[1][-1])
    motion = motion_along(length, 3.0, 2.0)
    run = driven_run(path, motion, 12.5, max_speed=3.3, seed=2, body=SimulatedBody(2.0))
    assert run.agent.phase == DONE
    assert cKDTree(dense_line(path)[0]).query(np.array(run.places))[0].max() < 0.01


@pytest.mark.parametrize("before", [0.03, 0.04, 0.1])
def test_a_robot_that_slips_as_it_arrives_has_not_arrived(before):
    motion = motion_along(LENGTH, SPEED, 0.5)
    finish = LENGTH / SPEED + SPEED / 0.5
    run = driven_run(PATH, motion, finish - before, body=FailingBody(0.5))
    run.body.skid(0.05)
    run.until(run.now + 1_000_000_000)
    assert (run.agent.phase, run.agent.fault) == (FROZEN, OFF_PATH)
    assert DONE not in run.phases


@pytest.mark.parametrize("beside", [0.0005, 0.007, 0.0085, 0.0095, 0.0105])
def test_a_robot_that_ends_its_plan_beside_its_goal_has_arrived_or_is_off_its_path(beside):
    finish = LENGTH / SPEED + SPEED / 0.5
    run = driven_run(PATH, motion_along(LENGTH, SPEED, 0.5), finish - 0.02)
    run.body.x -= beside * math.sin(run.body.heading)
    run.body.y += beside * math.cos(run.body.heading)
    run.until(run.now + SECOND)
    is_there = beside <= 0.001 * RULES[0]
    assert run.agent.phase == (DONE if is_there else FROZEN)
    assert run.agent.fault == (NO_FAULT if is_there else OFF_PATH)
