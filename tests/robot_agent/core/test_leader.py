"""Which of several coordinators a robot obeys."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.phases import (
    ARMED,
    BRAKING,
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
from protocol.timing import COORDINATOR_TIMEOUT
from robot_agent.core.leader import Leader
from tests.robot_agent.core.phases import run_in
from tests.robot_agent.core.rides import COORDINATOR, MS, SECOND, TERM

OTHER = COORDINATOR - 1
HIGHER = [(OTHER, TERM + 1), (COORDINATOR, TERM + 1), (COORDINATOR + 1, TERM)]
LOWER = [(COORDINATOR + 1, TERM - 1), (COORDINATOR, TERM - 1), (OTHER, TERM)]


@pytest.mark.parametrize(("boot", "term"), LOWER)
@pytest.mark.parametrize("phase", [IDLE, ARMED, MOVING, BRAKING, FROZEN, DONE])
def test_a_lower_coordinator_is_ignored_while_the_robots_own_is_heard(phase, boot, term):
    run = run_in(phase)
    for epoch in (1, 2, 9):
        for said in (HOLD, GO, FREEZE, STOP):
            assert not run.hear(said, boot=boot, term=term, sequence=10**6, epoch=epoch)
    assert (run.agent.phase, run.agent.fault) == (phase, NO_FAULT)


@pytest.mark.parametrize(("boot", "term"), HIGHER)
def test_a_higher_coordinator_is_obeyed_in_motion_in_the_same_epoch_without_braking(boot, term):
    run = run_in(MOVING)
    assert run.hear(GO, boot=boot, term=term, sequence=0)
    assert (run.agent.phase, run.agent.epoch, run.agent.clock.good) == (MOVING, 1, 0)
    speed = run.agent.drive_speed
    run.until(run.now + 30 * MS, talking=False)
    assert (run.agent.phase, run.agent.fault) == (MOVING, NO_FAULT)
    assert run.agent.drive_speed >= 0.95 * speed
    assert not run.hear(FREEZE, sequence=10**6)
    assert run.hear(FREEZE, boot=boot, term=term, sequence=1)
    assert run.agent.phase == BRAKING


@pytest.mark.parametrize("phase", [MOVING, BRAKING, FROZEN, DONE])
@pytest.mark.parametrize(("boot", "term"), [*HIGHER, (COORDINATOR, TERM)])
def test_a_robot_under_way_obeys_no_coordinator_of_another_run(phase, boot, term):
    run = run_in(phase)
    for said in (HOLD, GO, FREEZE, STOP, OVER):
        for epoch in (1, 2):
            assert not run.hear(said, boot=boot, term=term, sequence=10**6, epoch=epoch, run=9)
    assert (run.agent.phase, run.agent.fault) == (phase, NO_FAULT)


@pytest.mark.parametrize("phase", [IDLE, ARMED])
def test_a_robot_before_motion_obeys_a_higher_coordinator_of_another_run(phase):
    run = run_in(phase)
    assert run.hear(HOLD, boot=COORDINATOR + 1, sequence=0, run=9)
    assert run.agent.phase == IDLE


def test_a_robot_led_by_another_coordinator_arrives_as_if_it_had_not_changed():
    """The other one's clock is that of the first, as on the same machine."""
    run = run_in(MOVING)
    run.hear(GO, boot=OTHER, term=TERM + 1, sequence=0)
    while run.agent.phase == MOVING:
        run.until(run.now + 100 * MS)
    same = run_in(MOVING)
    while same.agent.phase == MOVING:
        same.until(same.now + 100 * MS)
    assert (run.agent.phase, run.agent.fault) == (DONE, NO_FAULT)
    assert run.now <= same.now + 100 * MS


@pytest.mark.parametrize(("boot", "term"), LOWER)
@pytest.mark.parametrize("phase", [IDLE, ARMED])
def test_before_motion_another_coordinator_is_obeyed_when_the_robots_own_is_silent(
    phase, boot, term
):
    run = run_in(phase)
    run.command(HOLD)
    heard = run.now
    run.until(heard + COORDINATOR_TIMEOUT - 20 * MS, talking=False)
    assert not run.hear(HOLD, boot=boot, term=term, sequence=1)
    run.until(heard + COORDINATOR_TIMEOUT + 20 * MS, talking=False)
    assert run.hear(HOLD, boot=boot, term=term, sequence=1)
    assert (run.agent.phase, run.agent.ride) == (IDLE, None)


@pytest.mark.parametrize("phase", [MOVING, BRAKING, FROZEN, DONE])
def test_a_robot_that_has_set_out_obeys_no_lower_coordinator_however_long_its_own_is_silent(phase):
    run = run_in(phase)
    run.until(run.now + 10 * SECOND, talking=False)
    for boot, term in LOWER:
        assert not run.hear(GO, boot=boot, term=term, sequence=10**6)


ACCEPTANCE = st.tuples(st.integers(0, 3), st.integers(0, 3), st.integers(0, 5))


@settings(derandomize=True, max_examples=200)
@given(st.lists(ACCEPTANCE, max_size=12))
def test_a_robot_in_motion_obeys_what_is_greater_by_term_boot_and_sequence_and_nothing_else(heard):
    leader, greatest = Leader(), (-1, -1, -1)
    for term, boot, sequence in heard:
        counts = leader.counts(term, boot, sequence, False, 0)
        assert counts == ((term, boot, sequence) > greatest)
        if counts:
            other = greatest[0] >= 0 and (term, boot) != greatest[:2]
            assert leader.hear(term, boot, sequence, 1, GO, 0) == other
            greatest = term, boot, sequence
