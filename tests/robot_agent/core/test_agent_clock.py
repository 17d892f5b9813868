"""What a robot does whose own clock stops, is set, or is not known."""

from __future__ import annotations

import itertools
import math

import pytest

from protocol.curve import Curve
from protocol.phases import (
    ARMED,
    CLOCK_UNSURE,
    DONE,
    FREEZE,
    FROZEN,
    GO,
    HOLD,
    IDLE,
    MOVING,
    NO_FAULT,
)
from protocol.timeline import Timeline
from protocol.timing import LATE_STEP_MS
from robot_agent.core.agent import CLOCK_PATIENCE, Agent
from sim.world.body import SimulatedBody
from tests.robot_agent.core.phases import BODY_ACCEL, LENGTH, MOTION, PATH, run_in
from tests.robot_agent.core.rides import (
    COORDINATOR,
    MS,
    PERIOD,
    SECOND,
    armed_run,
    driven_run,
    give_plan,
    motion_along,
    winding_path,
)

WAITING = motion_along(LENGTH, 0.475, 0.5, stops=[(0.0, 5.0)])
LONG = winding_path("f" * 20)
LONG_LENGTH = Curve(*LONG).length
LONG_MOTION = motion_along(LONG_LENGTH, 0.475, 0.5, stops=[(2.0, 8.0)])


def pause(run, nanoseconds):
    """Stop the robot's computer, its clock included."""
    run.now = run.due = run.due + nanoseconds
    run.offset_ns -= nanoseconds


def set_clock(run, nanoseconds):
    """Set the robot's clock; its base moves on by the true time."""
    run.body._clock = lambda: run.now
    run.offset_ns += nanoseconds


@pytest.mark.parametrize("seconds", [0.45, 2.0, 6.0])
@pytest.mark.parametrize("motion", [MOTION, WAITING])
def test_a_robot_whose_computer_was_stopped_goes_on_without_a_fault(motion, seconds):
    run = driven_run(PATH, motion, 1.0, body=SimulatedBody(BODY_ACCEL))
    pause(run, round(seconds * SECOND))
    before = len(run.phases)
    run.until(run.start_ns + 20 * SECOND)
    assert set(run.phases[before:]) == {MOVING, DONE}
    assert (run.agent.phase, run.agent.fault) == (DONE, NO_FAULT)


@pytest.mark.parametrize("seconds", [-6.0, -0.4, 0.04, 0.4, 6.0])
@pytest.mark.parametrize("after", [0.7, 2.5, 5.0])
def test_a_robot_whose_clock_was_set_goes_on_without_a_fault_and_claims_no_more_than_it_did(
    after, seconds
):
    run = driven_run(LONG, LONG_MOTION, after, body=SimulatedBody(BODY_ACCEL))
    set_clock(run, round(seconds * SECOND))
    line, stamped = Timeline(*LONG_MOTION), 0
    while run.now < run.start_ns + 40 * SECOND:
        run.until(run.now + 200 * MS)
        if run.agent.phase == MOVING and run.agent.report_due(run.own(run.now)):
            stamped += 1
            claimed = run.agent.report_stamp_ms - LATE_STEP_MS * run.agent.report_late
            assert line.s_at(claimed / 1000.0) <= run.agent.ride.follower.s + 2e-3
    assert (run.agent.phase, run.agent.fault) == (DONE, NO_FAULT)
    assert stamped > 20


def test_a_robot_whose_clock_was_set_back_brakes_and_waits_until_it_asks_the_time():
    run = run_in(MOVING)
    before = run.agent.ride.follower.s
    set_clock(run, -400 * MS)
    run.until(run.now + 200 * MS, talking=False)
    assert (run.agent.phase, run.agent.fault) == (MOVING, NO_FAULT)
    assert run.body.speed < 0.475 - 0.4 * 0.2
    assert run.agent.ride.follower.s > before


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


@pytest.mark.parametrize("seconds", [0.06, 0.4, 2.0])
def test_a_robot_that_hung_under_way_goes_on_without_a_fault(seconds):
    run = driven_run(PATH, MOTION, 1.5, body=SimulatedBody(BODY_ACCEL))
    run.now = run.due = run.due + round(seconds * SECOND)
    run.until(run.start_ns + 20 * SECOND)
    assert (run.agent.phase, run.agent.fault) == (DONE, NO_FAULT)


@pytest.mark.parametrize("clock", ["unknown", "doubted"])
def test_an_unsure_clock_does_not_stop_a_robot_that_drives_at_its_plans_pace(clock):
    run = driven_run(LONG, LONG_MOTION, 2.0, body=SimulatedBody(BODY_ACCEL))
    if clock == "unknown":
        run.agent.clock.start_over(run.own(run.now))
    else:
        run.agent.clock.doubt(run.own(run.now))
    line = Timeline(*LONG_MOTION)
    while run.now < run.start_ns + 14 * SECOND:
        run.until(run.now + 100 * MS, talking=False)
        assert (run.agent.phase, run.agent.fault) == (MOVING, NO_FAULT)
        planned = line.s_at((run.now - run.start_ns) / SECOND)
        assert run.agent.ride.follower.s == pytest.approx(planned, abs=0.02)
    run.until(run.start_ns + 20 * SECOND, talking=False)
    assert (run.agent.phase, run.agent.fault, run.agent.clock.good) == (DONE, NO_FAULT, 0)


def test_a_robot_without_the_time_keeps_within_its_authority_too():
    run = armed_run(LONG, LONG_MOTION, body=SimulatedBody(BODY_ACCEL))
    run.authority = 3_000
    run.command(GO)
    run.until(run.start_ns + 2 * SECOND)
    run.agent.clock.start_over(run.own(run.now))
    run.until(run.start_ns + 20 * SECOND, talking=False)
    assert (run.agent.phase, run.agent.fault) == (MOVING, NO_FAULT)
    end = Timeline(*LONG_MOTION).s_at(3.0)
    assert end - 0.02 <= run.agent.ride.follower.s <= end + 2e-3


@pytest.mark.parametrize("said", [HOLD, GO])
def test_a_command_said_in_the_future_costs_an_armed_robot_its_clock(said):
    run = run_in(ARMED)
    run.command(said, age=-SECOND)
    assert (run.agent.phase, run.agent.clock.good) == (IDLE, 0)
    run.agent.tick(run.own(run.now), *run.body.pose())
    assert (run.agent.phase, run.agent.fault) == (IDLE, CLOCK_UNSURE)


def test_a_command_said_in_the_future_costs_a_moving_robot_its_clock_and_nothing_else():
    run = run_in(MOVING)
    run.command(GO, age=-SECOND)
    assert (run.agent.phase, run.agent.fault, run.agent.clock.good) == (MOVING, NO_FAULT, 0)
    run.until(run.start_ns + 20 * SECOND)
    assert (run.agent.phase, run.agent.fault) == (DONE, NO_FAULT)


@pytest.mark.parametrize("age", [0, 400 * MS, 5 * SECOND, 10**6 * SECOND])
def test_old_commands_at_a_steady_rate_are_obeyed(age):
    run = run_in(MOVING)
    run.until(run.start_ns + 20 * SECOND, age=age)
    assert (run.agent.phase, run.agent.fault) == (DONE, NO_FAULT)


def test_a_robot_that_brakes_rests_no_later_because_its_clock_was_set():
    run = driven_run(PATH, MOTION, 1.5, body=SimulatedBody(BODY_ACCEL))
    began = run.now
    run.command(FREEZE)
    run.until(run.now + 200 * MS)
    run.offset_ns += 2 * SECOND
    while run.agent.phase != FROZEN:
        run.until(run.now + 11 * MS)
    assert run.now - began <= SECOND * 0.475 / BODY_ACCEL + 200 * MS


def test_a_robot_that_cannot_learn_the_time_arms_after_a_while_and_drives_within_its_authority(
    monkeypatch,
):
    run = run_in(IDLE)
    monkeypatch.setattr(run.agent.clock, "add", lambda *_: True)
    run.agent.clock.start_over(run.own(run.now))
    curve = Curve(*PATH)
    curve.place(0.0)
    run.body.place(curve.x, curve.y, math.atan2(curve.dy, curve.dx))
    give_plan(run.agent, PATH, MOTION)
    given, run.authority = run.now, 3_000
    run.until(given + round((CLOCK_PATIENCE - 0.1) * SECOND))
    assert (run.agent.phase, run.agent.fault) == (IDLE, CLOCK_UNSURE)
    run.until(given + round((CLOCK_PATIENCE + 0.1) * SECOND))
    for _ in range(5):
        assert (run.agent.phase, run.agent.fault) == (ARMED, NO_FAULT)
        run.until(run.now + PERIOD)
    run.start_ns = run.now + 500 * MS
    run.command(GO)
    run.until(run.start_ns - MS)
    assert run.agent.phase == ARMED, "GO is heard ahead of the start"
    run.until(run.start_ns + 6 * SECOND)
    assert run.agent.ride.follower.s == pytest.approx(Timeline(*MOTION).s_at(3.0), abs=2e-3)
    run.authority = 10**6
    run.until(run.now + 20 * SECOND)
    assert run.agent.phase == DONE


@pytest.mark.parametrize("asked", [True, False])
@pytest.mark.parametrize("coordinator", [COORDINATOR, COORDINATOR + 1, 0])
def test_only_the_coordinator_that_the_robot_obeys_tells_it_the_time_and_only_when_asked(
    coordinator, asked
):
    run = run_in(ARMED)
    clock, own = run.agent.clock, run.own(run.now)
    known = clock.offset_ns, clock.good, clock.error_ns(own)
    if asked:
        clock.ask(own - MS)
    told = run.now + SECOND
    run.agent.hear_clock(coordinator, own - MS, told, told, own)
    believed = coordinator == COORDINATOR and asked
    assert (run.agent.phase == IDLE) == believed
    assert ((clock.offset_ns, clock.good, clock.error_ns(own)) == known) != believed


def test_an_answer_of_a_foreign_coordinator_leaves_the_question_open():
    run = run_in(ARMED)
    clock, own = run.agent.clock, run.own(run.now)
    good = clock.good
    clock.ask(own - MS)
    run.agent.hear_clock(COORDINATOR + 1, own - MS, run.now, run.now, own)
    run.agent.hear_clock(COORDINATOR, own - MS, run.now, run.now, own)
    assert clock.good == good + 1


def test_before_it_has_heard_a_coordinator_nobody_tells_a_robot_the_time():
    agent = Agent()
    assert agent.clock_due(0)
    agent.hear_clock(COORDINATOR, 0, MS, MS, 2 * MS)
    assert agent.clock.good == 0


def test_a_better_offset_moves_the_clock_of_a_robot_under_way_little_by_little():
    run = driven_run(PATH, MOTION, 1.5)
    agent, own = run.agent, run.own(run.now)
    agent.clock.ask(own - 3 * MS)
    agent.hear_clock(COORDINATOR, own - 3 * MS, run.now - 3 * MS, run.now - 3 * MS, own)
    offsets = [agent.clock.offset_ns]
    for tick in range(1, 31):
        agent.tick(own + 10 * MS * tick, *run.body.pose())
        offsets.append(agent.clock.offset_ns)
    steps = [abs(b - a) for a, b in itertools.pairwise(offsets)]
    assert abs(offsets[-1] - offsets[0]) > MS
    assert max(steps) <= 10 * MS // 50


def test_a_tick_after_ticks_that_were_let_pass_is_on_time():
    agent = Agent(0.5, PERIOD)
    agent.tick(SECOND, 0.0, 0.0, 0.0)
    agent.skip_all(5 * SECOND)
    assert agent.skip(5 * SECOND + PERIOD)
    assert not agent.skip(9 * SECOND)
