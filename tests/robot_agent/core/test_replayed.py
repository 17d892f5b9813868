"""Messages of the past put on the wire once more: a robot does as if they had not come."""

from __future__ import annotations

import copy

import pytest

from protocol import keys
from protocol.codec import encode
from protocol.messages import Clock, Command, Hello, Report
from protocol.phases import ARMED, DONE, FREEZE, FROZEN, GO, HOLD, IDLE, MOVING, OVER, STOP
from protocol.timing import COORDINATOR_TIMEOUT
from tests.robot_agent.core.phases import MOTION, PATH, run_in
from tests.robot_agent.core.rides import COORDINATOR, ME, MS, SECOND, TERM, give_plan
from tests.robot_agent.test_service import FLEET, Hall

FORMER = COORDINATOR - 1
EVERY_PHASE = (IDLE, ARMED, MOVING, FROZEN, DONE)
EVERY_COMMAND = (HOLD, GO, FREEZE, OVER, STOP)


def state(run):
    agent = run.agent
    return (
        agent.phase,
        agent.epoch,
        agent.fault,
        agent.revision,
        agent.finished,
        agent.clock.good,
        agent.ride is None,
        agent.rest._tell,
        agent._start_ns,
        agent.ride and (agent.ride._authority, agent.ride._halted),
    )


def replay(run, boot=COORDINATOR, sequence=1, epoch=1, phase=FREEZE, term=TERM):
    """Let the robot hear a Command again, with what it would do most harm with."""
    again = copy.copy(run)
    again.start_ns, again.authority = run.now - SECOND, 2 * run.authority
    return again.hear(
        phase, boot=boot, term=term, sequence=sequence, epoch=epoch, wanted=True, age=0
    )


@pytest.mark.parametrize("said", EVERY_COMMAND)
@pytest.mark.parametrize("phase", EVERY_PHASE)
def test_a_command_of_an_earlier_sequence_changes_nothing(phase, said):
    run = run_in(phase)
    before = state(run)
    for sequence in (0, 1, run.sequence - 1, run.sequence):
        for epoch in (0, 1, 2, 2**32 - 1):
            assert not replay(run, sequence=sequence, epoch=epoch, phase=said)
    assert state(run) == before


@pytest.mark.parametrize("said", EVERY_COMMAND)
@pytest.mark.parametrize("phase", EVERY_PHASE)
def test_a_command_of_a_former_coordinator_changes_nothing(phase, said):
    run = run_in(phase)
    before = state(run)
    for epoch in (0, 1, 2):
        assert not replay(run, boot=FORMER, sequence=2**31, epoch=epoch, phase=said)
        assert not replay(
            run, COORDINATOR + 5, sequence=2**31, epoch=epoch, phase=said, term=TERM - 1
        )
    assert state(run) == before


def test_a_command_of_an_earlier_epoch_changes_nothing_for_a_robot_on_its_way_in_the_next():
    run = run_in(MOVING)
    run.epoch = 2
    run.command(FREEZE)
    run.until(run.now + 2 * SECOND)
    run.command(HOLD)
    before = state(run)
    for boot, term in ((FORMER, TERM), (COORDINATOR + 5, TERM - 1)):
        for said in EVERY_COMMAND:
            assert not replay(run, boot=boot, sequence=10**6, epoch=1, phase=said, term=term)
    assert state(run) == before


def test_what_is_replayed_does_not_pass_for_the_coordinators_voice():
    run = run_in(ARMED)
    run.command(HOLD)
    end = run.now + COORDINATOR_TIMEOUT
    while run.now < end:
        assert not run.hear(HOLD, boot=FORMER, sequence=1)
        run.until(run.now + 50 * MS, talking=False)
        replay(run, sequence=run.sequence, phase=GO)
    run.until(run.now + 50 * MS, talking=False)
    assert run.hear(HOLD, boot=FORMER, sequence=1)


def test_what_is_replayed_grants_nothing():
    run = run_in(MOVING)
    again = run.agent.ride._authority
    replay(run, sequence=run.sequence, phase=GO)
    replay(run, boot=FORMER, sequence=10**6, phase=GO)
    assert run.agent.ride._authority == again


@pytest.mark.parametrize("boot", [COORDINATOR, FORMER])
@pytest.mark.parametrize("phase", EVERY_PHASE)
def test_a_plan_of_an_earlier_epoch_or_of_a_former_coordinator_is_not_held(phase, boot):
    run = run_in(phase)
    held = run.agent.ride
    for epoch in (0, 1) if phase != IDLE else (0,):
        give_plan(run.agent, PATH, MOTION, boot=boot, epoch=epoch, revision=1)
    assert run.agent.ride is held


def test_the_plan_of_the_last_epoch_is_not_held_in_the_next():
    run = run_in(ARMED)
    run.epoch = 2
    run.command(HOLD)
    assert run.agent.ride is None
    give_plan(run.agent, PATH, MOTION, epoch=1)
    assert run.agent.ride is None
    give_plan(run.agent, PATH, MOTION, epoch=2)
    assert run.agent.ride is not None


def test_an_answer_about_the_time_that_comes_again_moves_no_clock():
    run = run_in(MOVING)
    clock = run.agent.clock
    offset, error = clock.offset_ns, clock.error_ns(run.own(run.now))
    for age in (20 * MS, 100 * MS, SECOND, 9 * SECOND):
        sent = run.own(run.now - age)
        for answered in (run.now - age, run.now - age + MS, run.now - age // 2):
            run.agent.hear_clock(COORDINATOR, sent, answered, answered, run.own(run.now))
    clock.follow(run.own(run.now), False)
    assert abs(clock.offset_ns - offset) <= error


def test_a_freeze_of_the_past_makes_no_robot_say_where_it_stands():
    """A robot that has not driven says its place in its Hellos while the fleet rests."""
    hall = Hall()
    hall.plans = []
    hall.body.place(1.0, 2.0, 0.3)
    old = encode(Command(COORDINATOR, TERM, 1, 1, FREEZE, 0, 0))
    step, ends = hall.sleep, hall.clock() + 3 * SECOND

    def sleep(ns):
        hall.link.put(keys.command(FLEET), old)
        step(ns)
        if hall.clock() > ends:
            hall.phase = OVER

    hall.sequence = 1
    hall.command()
    assert hall.run(sleep=sleep) == 0
    hellos = [message for message in hall.heard if isinstance(message, Hello)]
    assert len(hellos) > 10
    assert all(hello.place is None for hello in hellos)


def test_hellos_of_a_robot_are_numbered():
    hall = Hall()
    assert hall.run() == 0
    numbers = [message.sequence for message in hall.heard if isinstance(message, Hello)]
    assert numbers == list(range(1, len(numbers) + 1))
    assert any(isinstance(message, Report | Clock) for message in hall.heard)
    assert ME == "R1"
