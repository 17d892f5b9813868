from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.curve import Curve
from protocol.phases import (
    ARMED,
    BAD_PLAN,
    BRAKING,
    CLOCK_UNSURE,
    DONE,
    DRIVER_ERROR,
    FREEZE,
    FROZEN,
    GO,
    HOLD,
    IDLE,
    LATE,
    LEASE_OUT,
    MOVING,
    NO_FAULT,
    OFF_PATH,
    OVER,
)
from robot_agent.agent import Agent
from robot_agent.transitions import TRANSITIONS
from sim.body import SimulatedBody
from tests.robot_agent.rides import (
    COORDINATOR,
    MS,
    RULES,
    SECOND,
    Run,
    armed_run,
    driven_run,
    motion_along,
    winding_path,
)

PATH = winding_path("ffffffl")
LENGTH = Curve(*PATH).length
MOTION = motion_along(LENGTH, 0.475, 0.5)
BODY_ACCEL = 0.5


def run_in(phase: int) -> Run:
    """Bring a robot into a phase by nothing but what it hears and where it stands."""
    if phase == IDLE:
        run = Run(Agent(0.5), SimulatedBody(), start_ns=5 * SECOND)
        run.body.place(1.0, 2.0, 0.3)
        run.command(HOLD)
        run.until(SECOND)
    elif phase == ARMED:
        run = armed_run(PATH, MOTION, body=SimulatedBody(BODY_ACCEL))
    elif phase == DONE:
        run = driven_run(PATH, MOTION, 10.0, body=SimulatedBody(BODY_ACCEL))
    else:
        run = driven_run(PATH, MOTION, 1.5, body=SimulatedBody(BODY_ACCEL))
        if phase in (BRAKING, FROZEN):
            run.command(FREEZE)
            run.until(run.now + (100 if phase == BRAKING else 2000) * MS)
    assert run.agent.phase == phase
    return run


def hear_plan(run: Run) -> None:
    run.agent.hear_plan(COORDINATOR, run.epoch, RULES, PATH, MOTION)
    run.agent.tick(run.own(run.now), *run.body.pose())


def hear_late_go(run: Run) -> None:
    run.start_ns = run.now - 2 * SECOND
    run.command(GO)


def hear_next_epoch(run: Run) -> None:
    run.epoch += 1
    run.command(HOLD)


EVENTS = {
    "plan": hear_plan,
    "go": lambda run: run.command(GO),
    "late go": hear_late_go,
    "freeze": lambda run: run.command(FREEZE),
    "over": lambda run: run.command(OVER),
    "next epoch": hear_next_epoch,
    "driver error": lambda run: run.agent.hear_driver_error(run.own(run.now)),
}
EXPECTED = {
    "plan": {IDLE: ARMED},
    "go": {ARMED: MOVING},
    "late go": {ARMED: FROZEN},
    "freeze": {ARMED: FROZEN, MOVING: BRAKING},
    "over": {},
    "next epoch": {ARMED: IDLE, MOVING: BRAKING, FROZEN: IDLE, DONE: IDLE},
    "driver error": {ARMED: FROZEN, MOVING: BRAKING},
}


@pytest.mark.parametrize("event", EVENTS)
@pytest.mark.parametrize("phase", [IDLE, ARMED, MOVING, BRAKING, FROZEN, DONE])
def test_every_event_in_every_phase_leads_where_the_rules_say(phase, event):
    run = run_in(phase)
    EVENTS[event](run)
    assert run.agent.phase == EXPECTED[event].get(phase, phase)


def test_the_table_lets_no_braked_robot_move_without_becoming_idle():
    reachable, frontier = set(), {BRAKING}
    while frontier:
        phase = frontier.pop()
        reachable.add(phase)
        after = {to for (was, _), to in TRANSITIONS.items() if was == phase}
        frontier |= after - reachable - {IDLE}
    assert reachable == {BRAKING, FROZEN}


def test_a_robot_without_the_time_does_not_arm_and_says_so():
    agent = Agent()
    agent.hear_command(COORDINATOR, 1, 1, HOLD, 0, False, 0)
    agent.hear_plan(COORDINATOR, 1, RULES, PATH, MOTION)
    pose = agent.ride.follower.start_pose()
    agent.tick(10 * MS, *pose)
    assert (agent.phase, agent.fault) == (IDLE, CLOCK_UNSURE)
    agent.hear_clock(20 * MS, 500 * MS, 500 * MS, 37 * MS)
    agent.tick(50 * MS, *pose)
    assert (agent.phase, agent.fault) == (IDLE, CLOCK_UNSURE)
    agent.hear_clock(50 * MS, 530 * MS, 530 * MS, 65 * MS)
    agent.tick(70 * MS, *pose)
    assert (agent.phase, agent.fault) == (ARMED, NO_FAULT)


@pytest.mark.parametrize("off", [(0.02, 0.0, 0.0), (0.0, -0.02, 0.0), (0.0, 0.0, 1.0)])
def test_a_robot_that_stands_elsewhere_does_not_arm_until_it_is_put_right(off):
    run = run_in(IDLE)
    run.agent.hear_plan(COORDINATOR, 1, RULES, PATH, MOTION)
    right = run.agent.ride.follower.start_pose()
    run.body.place(*(a + b for a, b in zip(right, off, strict=True)))
    run.until(run.now + 50 * MS)
    assert (run.agent.phase, run.agent.fault) == (IDLE, OFF_PATH)
    run.body.place(*right)
    run.until(run.now + 50 * MS)
    assert (run.agent.phase, run.agent.fault) == (ARMED, NO_FAULT)


@pytest.mark.parametrize(
    ("path", "motion"),
    [
        ((3, PATH[1][:-1], *PATH[2:]), MOTION),
        ((3, PATH[1][:8] * 2, *PATH[2:]), MOTION),
        (PATH, motion_along(LENGTH + 0.01, 0.475, 0.5)),
        (PATH, ([], [], [], [])),
        ((3, [0.0, 0, 0, 0, 1, 1, 1, 1, 1], *(5 * [1.0] for _ in range(3))), MOTION),
    ],
)
def test_a_plan_that_makes_no_sense_is_reported_and_not_held(path, motion):
    run = run_in(IDLE)
    run.agent.hear_plan(COORDINATOR, 1, RULES, path, motion)
    run.until(run.now + 50 * MS)
    assert (run.agent.phase, run.agent.fault, run.agent.epoch) == (IDLE, BAD_PLAN, 0)
    assert run.agent.hello_due(run.own(run.now) + SECOND)
    hear_plan(run)
    assert (run.agent.phase, run.agent.fault) == (ARMED, NO_FAULT)


@pytest.mark.parametrize(("boot", "epoch"), [(COORDINATOR + 1, 1), (COORDINATOR, 2)])
def test_a_plan_of_another_coordinator_or_epoch_is_not_held(boot, epoch):
    run = run_in(IDLE)
    run.agent.hear_plan(boot, epoch, RULES, PATH, MOTION)
    assert run.agent.ride is None


def test_a_plan_may_come_before_the_first_command_but_not_survive_a_strangers():
    for boot, held in ((COORDINATOR, True), (COORDINATOR + 1, False)):
        agent = Agent()
        agent.hear_plan(COORDINATOR, 1, RULES, PATH, MOTION)
        agent.hear_command(boot, 1, 1, HOLD, 0, False, 0)
        assert (agent.ride is not None) == held


def test_an_armed_robot_changes_to_another_coordinator_and_forgets_plan_and_time():
    run = run_in(ARMED)
    run.agent.hear_command(COORDINATOR + 1, 1, 1, GO, run.start_ns, False, run.own(run.now))
    assert (run.agent.phase, run.agent.epoch, run.agent.clock.good) == (IDLE, 0, 0)


def test_a_moving_robot_believes_another_coordinator_only_with_a_higher_epoch():
    run = run_in(MOVING)
    run.agent.hear_command(COORDINATOR + 1, 1, 1, FREEZE, 0, False, run.own(run.now))
    assert run.agent.phase == MOVING
    before = run.agent.clock.offset_ns
    run.agent.hear_command(COORDINATOR + 1, 1, 2, FREEZE, 0, False, run.own(run.now))
    assert (run.agent.phase, run.agent.clock.offset_ns) == (BRAKING, before)


def test_an_old_or_doubled_command_changes_nothing():
    run = run_in(MOVING)
    for sequence in (1, run.sequence - 1, run.sequence):
        run.agent.hear_command(COORDINATOR, sequence, 1, FREEZE, 0, False, run.own(run.now))
    assert run.agent.phase == MOVING


def test_a_robot_bears_silence_for_its_lease_and_then_brakes():
    run = run_in(MOVING)
    run.command(GO)
    heard = run.now
    run.until(heard + 595 * MS, talking=False)
    assert (run.agent.phase, run.agent.fault) == (MOVING, NO_FAULT)
    run.until(heard + 625 * MS, talking=False)
    assert (run.agent.phase, run.agent.fault) == (BRAKING, LEASE_OUT)


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
    rules = (*RULES[:3], 0)
    motion = motion_along(LENGTH, 0.475, math.inf)
    run = driven_run(PATH, motion, 1.0, rules=rules)
    s = run.agent.ride.follower.s
    run.command(FREEZE)
    run.until(run.now + 150 * MS)
    assert run.agent.phase == FROZEN
    assert run.agent.ride.follower.s - s <= 0.475 * 0.01 + 1e-6


def test_a_braking_robot_does_not_pass_a_stop_of_its_plan():
    motion = motion_along(LENGTH, 0.475, 0.5, [(0.8, 60.0)])
    run = driven_run(PATH, motion, 1.5, rules=(*RULES[:3], 100), body=SimulatedBody(0.5))
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


def test_a_braked_robot_never_moves_again_in_its_epoch_and_does_in_the_next():
    run = run_in(FROZEN)
    for _ in range(20):
        run.command(GO)
        hear_plan(run)
        run.until(run.now + 20 * MS)
        assert (run.agent.phase, run.agent.drive_speed) == (FROZEN, 0.0)
    hear_next_epoch(run)
    assert (run.agent.epoch, run.agent.fault) == (0, NO_FAULT)
    run.body.place(*run_in(ARMED).body.pose())
    run.start_ns = run.now + SECOND
    hear_plan(run)
    assert (run.agent.phase, run.agent.epoch) == (ARMED, 2)
    run.command(GO)
    run.until(run.start_ns + SECOND)
    assert run.agent.phase == MOVING


def test_the_plan_of_a_spent_epoch_is_not_taken_up_again():
    run = run_in(FROZEN)
    hear_next_epoch(run)
    run.agent.hear_plan(COORDINATOR, 1, RULES, PATH, MOTION)
    assert run.agent.ride is None


def test_a_driver_error_is_kept_as_the_fault_of_the_robot():
    run = run_in(MOVING)
    run.agent.hear_driver_error(run.own(run.now))
    run.until(run.now + 2 * SECOND)
    assert (run.agent.phase, run.agent.fault) == (FROZEN, DRIVER_ERROR)


def test_a_robot_whose_clock_became_uncertain_brakes():
    run = run_in(MOVING)
    run.agent.clock.reset(run.own(run.now))
    run.agent.tick(run.own(run.now), *run.body.pose())
    assert (run.agent.phase, run.agent.fault) == (BRAKING, CLOCK_UNSURE)


def test_reports_come_on_change_and_every_period():
    run = run_in(ARMED)
    now = run.own(run.now)
    assert run.agent.report_due(now)
    assert not run.agent.report_due(now + 199 * MS)
    assert run.agent.report_due(now + 200 * MS)
    run.command(GO)
    assert run.agent.report_due(now + 201 * MS)
    assert not run.agent.report_due(now + 202 * MS)
    assert run.agent.report_sequence == 3


def test_the_arc_length_is_said_once_at_rest_and_again_when_it_is_wanted():
    run = run_in(BRAKING)
    said = []
    for _ in range(300):
        run.until(run.now + 11 * MS)
        if run.agent.report_due(run.own(run.now)):
            said.append((run.agent.phase, run.agent.report_s))
    rest = run.agent.ride.follower.s
    assert [s for phase, s in said if phase == BRAKING] == [None] * len(
        [1 for phase, _ in said if phase == BRAKING]
    )
    frozen = [s for phase, s in said if phase == FROZEN]
    assert frozen[0] == pytest.approx(rest, abs=1e-3)
    assert set(frozen[1:]) == {None}
    run.command(FREEZE, wanted=True)
    assert run.agent.report_due(run.own(run.now) + 200 * MS)
    assert run.agent.report_s == rest
    assert run.agent.report_due(run.own(run.now) + 400 * MS)
    assert run.agent.report_s is None


def test_a_question_for_the_arc_length_is_not_answered_on_the_move():
    run = run_in(MOVING)
    run.command(GO, wanted=True)
    assert run.agent.report_due(run.own(run.now) + SECOND)
    assert run.agent.report_s is None


def test_a_robot_says_hello_until_it_holds_a_plan():
    run = run_in(IDLE)
    now = run.own(run.now)
    assert [run.agent.hello_due(now + ms * MS) for ms in (0, 100, 199, 200, 250, 400)] == [
        True,
        False,
        False,
        True,
        False,
        True,
    ]
    hear_plan(run)
    assert not run.agent.hello_due(now + SECOND)


def test_the_time_is_asked_for_often_at_first_and_rarely_later():
    agent = Agent()
    asked = []
    for now in range(0, 10 * SECOND, 10 * MS):
        if agent.clock_due(now):
            asked.append(now)
            agent.hear_clock(now, now, now, now + 4 * MS)
    assert asked[:8] == [i * 40 * MS for i in range(8)]
    assert [b - a for a, b in itertools.pairwise(asked[7:])] == [2 * SECOND] * 4


def test_a_robot_may_leave_when_all_is_over_or_at_its_goal_alone():
    run = run_in(DONE)
    run.command(GO)
    assert not run.agent.may_leave(run.own(run.now) + 600 * MS)
    assert run.agent.may_leave(run.own(run.now) + 601 * MS)
    assert not run_in(FROZEN).agent.may_leave(1 << 60)
    run.command(OVER)
    assert run.agent.may_leave(run.own(run.now))


STEPS = st.lists(
    st.sampled_from(
        ["go", "freeze", "hold", "next epoch", "plan", "wait", "wait long", "push", "old", "error"]
    ),
    max_size=25,
)


def _take_step(run: Run, step: str) -> None:
    if step in ("go", "freeze", "hold"):
        run.command({"go": GO, "freeze": FREEZE, "hold": HOLD}[step], wanted=True)
    elif step in ("next epoch", "plan"):
        EVENTS[step](run)
    elif step == "push":
        run.body.x += 0.004
    elif step == "old":
        run.agent.hear_command(COORDINATOR, 0, 9, GO, 0, True, run.own(run.now))
    elif step == "error":
        run.agent.hear_driver_error(run.own(run.now))
    else:
        run.until(run.now + (100 if step == "wait" else 900) * MS, talking=False)


@settings(derandomize=True, max_examples=40, deadline=None)
@given(STEPS)
def test_whatever_a_robot_hears_it_moves_only_on_a_plan_and_tells_its_place_only_at_rest(steps):
    run = armed_run(PATH, MOTION, body=SimulatedBody(BODY_ACCEL))
    run.start_ns = run.now + 100 * MS
    braked: set[int] = set()
    for step in steps:
        _take_step(run, step)
        agent = run.agent
        if agent.phase in (BRAKING, FROZEN):
            braked.add(agent.epoch)
        assert not (agent.phase == MOVING and agent.epoch in braked)
        assert agent.drive_speed == 0.0 or agent.phase in (MOVING, BRAKING)
        if agent.report_due(run.own(run.now)) and agent.report_s is not None:
            assert agent.phase == FROZEN
