"""The agent's phases: every event in each, and what no message can make it do."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.phases import (
    ARMED,
    BRAKING,
    CLOCK_UNSURE,
    DONE,
    FREEZE,
    FROZEN,
    GO,
    HOLD,
    IDLE,
    MOVING,
    NO_FAULT,
    OVER,
    STOP,
)
from protocol.timeline import Timeline
from robot_agent.core.ride import NOTHING
from robot_agent.core.transitions import NEW_COURSE, TRANSITIONS
from sim.world.body import SimulatedBody
from tests.robot_agent.core.phases import (
    BODY_ACCEL,
    MOTION,
    PATH,
    hear_next_epoch,
    hear_plan,
    run_in,
)
from tests.robot_agent.core.rides import COORDINATOR, MS, SECOND, TERM, Run, armed_run
from tests.sweeps import seeds

EVENTS = {
    "plan": hear_plan,
    "go": lambda run: run.command(GO),
    "stop": lambda run: run.command(STOP),
    "freeze": lambda run: run.command(FREEZE),
    "over": lambda run: run.command(OVER),
    "next epoch": hear_next_epoch,
    "driver error": lambda run: run.agent.hear_driver_error(run.own(run.now)),
}
EXPECTED = {
    "plan": {IDLE: ARMED},
    "go": {ARMED: MOVING},
    "stop": {},
    "freeze": {ARMED: FROZEN, MOVING: BRAKING},
    "over": {ARMED: FROZEN, MOVING: BRAKING},
    "next epoch": {ARMED: IDLE, MOVING: BRAKING, FROZEN: IDLE, DONE: IDLE},
    "driver error": {ARMED: FROZEN, MOVING: BRAKING},
}


@pytest.mark.parametrize("event", EVENTS)
@pytest.mark.parametrize("phase", [IDLE, ARMED, MOVING, BRAKING, FROZEN, DONE])
def test_every_event_in_every_phase_leads_where_the_rules_say(phase, event):
    run = run_in(phase)
    EVENTS[event](run)
    assert run.agent.phase == EXPECTED[event].get(phase, phase)


def test_the_table_lets_no_braked_robot_move_without_a_new_epoch_or_course():
    rows = {cell: to for cell, to in TRANSITIONS.items() if cell[1] != NEW_COURSE}
    reachable, frontier = set(), {BRAKING}
    while frontier:
        phase = frontier.pop()
        reachable.add(phase)
        after = {to for (was, _), to in rows.items() if was == phase}
        frontier |= after - reachable - {IDLE}
    assert reachable == {BRAKING, FROZEN, DONE}


def test_an_old_or_doubled_command_changes_nothing():
    run = run_in(MOVING)
    for sequence in (1, run.sequence - 1, run.sequence):
        assert not run.hear(FREEZE, sequence=sequence)
    assert run.agent.phase == MOVING


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
    assert (run.agent.phase, run.agent.fault) == (IDLE, CLOCK_UNSURE)
    run.until(run.now + 50 * MS)
    assert (run.agent.phase, run.agent.epoch) == (ARMED, 2)
    run.command(GO)
    run.until(run.start_ns + SECOND)
    assert run.agent.phase == MOVING


STEPS = st.lists(
    st.sampled_from(
        [
            "go", "stop", "freeze", "hold", "next epoch", "plan", "wait", "wait long", "push",
            "old", "lower", "error", "grant",
        ]
    ),
    max_size=25,
)  # fmt: skip


def _take_step(run: Run, step: str) -> None:
    said = {"go": GO, "stop": STOP, "freeze": FREEZE, "hold": HOLD}
    if step in said:
        run.command(said[step], wanted=True)
    elif step in ("next epoch", "plan"):
        EVENTS[step](run)
    elif step == "push":
        run.body.x += 0.004
    elif step == "old":
        run.hear(GO, sequence=0, epoch=9, wanted=True)
    elif step == "lower":
        run.hear(GO, term=TERM - 1, sequence=10**6, epoch=9, wanted=True)
    elif step == "grant":
        run.authority += 500
    elif step == "error":
        run.agent.hear_driver_error(run.own(run.now))
    else:
        run.until(run.now + (100 if step == "wait" else 900) * MS, talking=False)


@settings(derandomize=True, max_examples=40, deadline=None)
@given(STEPS)
def test_whatever_a_robot_hears_it_moves_only_as_granted_and_tells_its_place_only_at_rest(steps):
    run = armed_run(PATH, MOTION, body=SimulatedBody(BODY_ACCEL))
    run.start_ns = run.now + 100 * MS
    run.authority = 500
    line, braked = Timeline(*MOTION), set()
    for step in steps:
        _take_step(run, step)
        agent = run.agent
        if agent.phase in (BRAKING, FROZEN):
            braked.add(agent.epoch)
        assert not (agent.phase == MOVING and agent.epoch in braked)
        assert agent.drive_speed == 0.0 or agent.phase in (MOVING, BRAKING)
        if agent.drive_speed > 0.0:
            reached = agent.ride.follower.s + agent.drive_distance
            assert reached <= max(line.s_at(run.authority / 1000.0), agent.ride.follower.s) + 1e-9
        if agent.report_due(run.own(run.now)) and agent.report_s is not None:
            assert agent.phase not in (MOVING, BRAKING, DONE)


def hear_random_command(run, dice):
    def one_of(usual, *others):
        return usual if dice.random() < 0.9 else dice.choice(others)

    run.sequence += 1
    run.agent.hear_command(
        one_of(COORDINATOR, 0, COORDINATOR + 1, 2**32 - 1),
        one_of(TERM, 0, TERM + 1, 2**32 - 1),
        one_of(run.sequence, 0, 2**32 - 1),
        one_of(1, 0, 2, 2**32 - 1),
        one_of(GO, HOLD, STOP, FREEZE, OVER),
        dice.choice([-(2**62), 0, run.start_ns, run.start_ns + SECOND, 2**62]),
        one_of(run.now, -(2**62), 0, 2**62),
        dice.choice([NOTHING, -(2**31), 0, 3_000, 2**62]),
        dice.random() < 0.5,
        run.own(run.now),
    )


@pytest.mark.parametrize("seed", seeds(40))
def test_no_numbers_in_commands_make_a_tick_fail_or_a_report_that_cannot_be_sent(seed):
    dice = random.Random(seed)
    run = armed_run(PATH, MOTION, body=SimulatedBody(BODY_ACCEL))
    run.command(GO)
    for _ in range(60):
        hear_random_command(run, dice)
        if dice.random() < 0.5:
            hear_plan(run)
        run.until(run.now + 50 * MS, talking=False)
        run.agent.report_due(run.own(run.now))
        assert run.agent.report_stamp_ms == NOTHING or abs(run.agent.report_stamp_ms) < 2**31
        assert 0 <= run.agent.report_late < 2**16
