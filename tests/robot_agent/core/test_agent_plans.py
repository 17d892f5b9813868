"""Which plans an agent holds, and when it arms."""

from __future__ import annotations

import math

import pytest

from protocol.phases import (
    ARMED,
    BAD_PLAN,
    CLOCK_UNSURE,
    FROZEN,
    GO,
    HOLD,
    IDLE,
    NO_FAULT,
    OFF_PATH,
)
from robot_agent.core.agent import Agent
from robot_agent.core.ride import FACING
from sim.world.body import TURN_RATE, SimulatedBody
from tests.robot_agent.core.phases import LENGTH, MOTION, PATH, hear_next_epoch, hear_plan, run_in
from tests.robot_agent.core.rides import (
    COORDINATOR,
    MS,
    NUMBER,
    SECOND,
    TERM,
    Run,
    give_plan,
    motion_along,
)


def fresh_run() -> Run:
    return Run(Agent(), SimulatedBody(), start_ns=5 * SECOND)


def test_a_robot_without_the_time_does_not_arm_and_says_so():
    run = fresh_run()
    agent = run.agent
    run.command(HOLD)
    give_plan(agent, PATH, MOTION)
    pose = agent.ride.follower.start_pose()
    agent.tick(10 * MS, *pose)
    assert (agent.phase, agent.fault) == (IDLE, CLOCK_UNSURE)
    assert agent.clock_due(20 * MS)
    agent.hear_clock(COORDINATOR, 20 * MS, 500 * MS, 500 * MS, 37 * MS)
    agent.tick(50 * MS, *pose)
    assert (agent.phase, agent.fault) == (IDLE, CLOCK_UNSURE)
    assert agent.clock_due(60 * MS)
    agent.hear_clock(COORDINATOR, 60 * MS, 540 * MS, 540 * MS, 75 * MS)
    agent.tick(80 * MS, *pose)
    assert (agent.phase, agent.fault) == (ARMED, NO_FAULT)


@pytest.mark.parametrize("off", [(0.02, 0.0, 0.0), (0.0, -0.02, 0.0), (0.02, 0.0, 1.0)])
def test_a_robot_that_stands_elsewhere_does_not_arm_until_it_is_put_right(off):
    run = run_in(IDLE)
    give_plan(run.agent, PATH, MOTION)
    right = run.agent.ride.follower.start_pose()
    run.body.place(*(a + b for a, b in zip(right, off, strict=True)))
    run.until(run.now + 50 * MS)
    assert (run.agent.phase, run.agent.fault) == (IDLE, OFF_PATH)
    run.body.place(*right)
    run.until(run.now + 50 * MS)
    assert (run.agent.phase, run.agent.fault) == (ARMED, NO_FAULT)


@pytest.mark.parametrize("turned", [1.0, -3.0, 0.4, -0.17])
def test_a_robot_at_its_place_that_faces_elsewhere_turns_on_the_spot_and_arms(turned):
    run = run_in(IDLE)
    give_plan(run.agent, PATH, MOTION)
    x, y, heading = run.agent.ride.follower.start_pose()
    run.body.place(x, y, heading + turned)
    run.until(run.now + round(abs(turned) / TURN_RATE * SECOND) + 50 * MS)
    assert (run.agent.phase, run.agent.fault) == (ARMED, NO_FAULT)
    assert (run.body.x, run.body.y) == (x, y)
    assert abs(math.remainder(run.body.heading - heading, math.tau)) <= FACING


@pytest.mark.parametrize(
    ("path", "motion"),
    [
        ((3, PATH[1][:-1], *PATH[2:]), MOTION),
        ((3, PATH[1][:8] * 2, *PATH[2:]), MOTION),
        (PATH, motion_along(LENGTH + 0.01, 0.475, 0.5)),
        (PATH, ([], [], [], [], 0.0)),
        ((3, [0.0, 0, 0, 0, 1, 1, 1, 1, 1], *(5 * [1.0] for _ in range(3))), MOTION),
    ],
)
def test_a_plan_that_makes_no_sense_is_reported_and_not_held(path, motion):
    run = run_in(IDLE)
    give_plan(run.agent, path, motion)
    run.until(run.now + 50 * MS)
    assert (run.agent.phase, run.agent.fault, run.agent.epoch) == (IDLE, BAD_PLAN, 0)
    assert run.agent.hello_due(run.own(run.now) + SECOND)
    hear_plan(run)
    assert (run.agent.phase, run.agent.fault) == (ARMED, NO_FAULT)


@pytest.mark.parametrize(("boot", "epoch"), [(COORDINATOR + 1, 1), (COORDINATOR, 2)])
def test_a_plan_of_another_coordinator_or_epoch_is_not_held(boot, epoch):
    run = run_in(IDLE)
    give_plan(run.agent, PATH, MOTION, boot=boot, epoch=epoch)
    assert run.agent.ride is None


def test_a_plan_may_come_before_the_first_command_but_not_survive_a_strangers():
    for boot, held in ((COORDINATOR, True), (COORDINATOR + 1, False)):
        run = fresh_run()
        give_plan(run.agent, PATH, MOTION)
        run.hear(HOLD, boot=boot)
        assert (run.agent.ride is not None) == held


def test_a_robot_keeps_its_number_and_the_revision_of_its_course_from_its_plan():
    run = run_in(IDLE)
    give_plan(run.agent, PATH, MOTION, number=9, revision=2)
    assert (run.agent.number, run.agent.revision) == (9, 2)
    give_plan(run.agent, PATH, MOTION, number=NUMBER, revision=3)
    assert (run.agent.number, run.agent.revision) == (9, 2)


@pytest.mark.parametrize(("boot", "term"), [(COORDINATOR + 1, TERM), (COORDINATOR - 1, TERM + 1)])
@pytest.mark.parametrize("said", [HOLD, GO])
def test_an_armed_robot_changes_to_a_higher_coordinator_and_forgets_plan_and_time(boot, term, said):
    run = run_in(ARMED)
    assert run.hear(said, boot=boot, term=term, sequence=1)
    assert (run.agent.phase, run.agent.epoch, run.agent.clock.good) == (IDLE, 0, 0)
    assert run.agent.ride is None
    give_plan(run.agent, PATH, MOTION, boot=boot)
    assert run.agent.ride is not None


def test_the_plan_of_a_spent_epoch_is_not_taken_up_again():
    run = run_in(FROZEN)
    hear_next_epoch(run)
    give_plan(run.agent, PATH, MOTION)
    assert run.agent.ride is None
