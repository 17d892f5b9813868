"""The agent's phases: every event in each, and what no message can make it do."""

from __future__ import annotations

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
)
from robot_agent.core.transitions import NEW_TIMES, TRANSITIONS
from sim.world.body import SimulatedBody
from tests.robot_agent.core.phases import (
    BODY_ACCEL,
    MOTION,
    PATH,
    hear_next_epoch,
    hear_plan,
    run_in,
)
from tests.robot_agent.core.rides import COORDINATOR, MS, SECOND, Run, armed_run


def hear_late_go(run: Run) -> None:
    run.start_ns = run.now - 2 * SECOND
    run.command(GO)


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


def test_the_table_lets_no_braked_robot_move_without_becoming_idle_or_getting_new_times():
    reachable, frontier = set(), {BRAKING}
    while frontier:
        phase = frontier.pop()
        reachable.add(phase)
        after = {
            to for (was, event), to in TRANSITIONS.items() if was == phase and event != NEW_TIMES
        }
        frontier |= after - reachable - {IDLE}
    assert reachable == {BRAKING, FROZEN, DONE}


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
            assert agent.phase not in (MOVING, BRAKING, DONE)
