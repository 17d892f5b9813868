"""Every cell of the agent's state table, reached by what a robot hears, sees and waits for."""

from __future__ import annotations

import copy
import functools
import math

import pytest

from protocol.curve import Curve
from protocol.phases import (
    ARMED,
    BRAKING,
    DONE,
    FREEZE,
    FROZEN,
    GO,
    IDLE,
    MOVING,
    OFF_PATH,
    PHASE_NAMES,
)
from protocol.timeline import Timeline
from robot_agent.core import transitions
from tests.robot_agent.core.phases import (
    MOTION,
    hear_course_from_goal,
    hear_next_epoch,
    hear_plan,
    run_in,
)
from tests.robot_agent.core.rides import (
    MS,
    PERIOD,
    SECOND,
    Run,
    give_plan,
    motion_along,
    winding_path,
)

FINISH_NS = round(Timeline(*MOTION).finish * SECOND)
START = (1.0, 2.0, 0.3)


def stand(run: Run, pose, seconds: float) -> None:
    """Let time pass over a robot that does not move, the state repeated to it."""
    end = run.now + round(seconds * SECOND)
    while run.now < end:
        run.now += PERIOD
        run.command(run.phase)
        run.agent.tick(run.own(run.now), *pose)


def be_ready(run: Run) -> None:
    """Stand where the plan begins, certain of the time."""
    stand(run, START if run.agent.phase == IDLE else run.body.pose(), 0.01)


def rest(run: Run) -> None:
    """Have come to rest: a robot that brakes has to be ordered to stand first."""
    if run.agent.phase == BRAKING:
        while run.agent.drive_speed > 0.0:
            run.until(run.now + 11 * MS)
            assert run.agent.phase == BRAKING
    stand(run, run.body.pose(), 0.15)


def arrive(run: Run) -> None:
    """Reach the end of the plan's time: at the goal where a robot drives."""
    if run.agent.phase == BRAKING:
        brake_at_the_goal(run)
    else:
        run.until(run.start_ns + FINISH_NS + SECOND)


def brake_at_the_goal(run: Run) -> None:
    """Be told to freeze just before the goal, and come to rest there."""
    near = copy.deepcopy(brought(MOVING))
    near.until(near.start_ns + FINISH_NS - 20 * MS)
    near.command(FREEZE)
    near.until(near.start_ns + FINISH_NS + 300 * MS)
    vars(run).update(vars(near))


def change_course(run: Run) -> None:
    """Hear of a course that begins at the goal, or where a robot has stopped, and come there."""
    if run.agent.phase == FROZEN:
        run.command(GO)  # Nothing begins in a fleet that is frozen.
        x, y, heading = run.body.pose()
        path = winding_path("fffff", begin=(x, y), heading=heading)
        profile_s, profile_v, *_ = motion_along(Curve(*path).length, 0.475, 0.5)
        begin = round((run.now - run.start_ns) / SECOND + 0.2, 3)
        give_plan(run.agent, path, (profile_s, profile_v, [0.0], [begin], begin), revision=1)
    else:
        hear_course_from_goal(run)
    stand(run, run.body.pose(), 0.5)


def be_pushed(run: Run) -> None:
    """Be pushed aside."""
    run.body.x -= 0.05 * math.sin(run.body.heading)
    run.body.y += 0.05 * math.cos(run.body.heading)
    run.agent.tick(run.own(run.now), *run.body.pose())


def tick_late(run: Run) -> None:
    """Be let run again after so long that the robot's clock may have been set."""
    run.now += 60 * MS
    run.agent.tick(run.own(run.now), *run.body.pose())


STIMULI = {
    transitions.READY: be_ready,
    transitions.NOT_READY: tick_late,
    transitions.GO: lambda run: run.command(GO),
    transitions.TOLD_TO_FREEZE: lambda run: run.command(FREEZE),
    transitions.NEW_EPOCH: hear_next_epoch,
    transitions.TROUBLE: lambda run: run.agent.hear_driver_error(run.own(run.now)),
    transitions.AT_REST: rest,
    transitions.ARRIVED: arrive,
    transitions.LEFT_PATH: be_pushed,
    transitions.NEW_COURSE: change_course,
}
"""What brings an event about."""

ROWS = {
    (IDLE, transitions.READY): ARMED,
    (IDLE, transitions.NEW_EPOCH): IDLE,
    (ARMED, transitions.NOT_READY): IDLE,
    (ARMED, transitions.GO): MOVING,
    (ARMED, transitions.TOLD_TO_FREEZE): FROZEN,
    (ARMED, transitions.TROUBLE): FROZEN,
    (ARMED, transitions.NEW_EPOCH): IDLE,
    (MOVING, transitions.TOLD_TO_FREEZE): BRAKING,
    (MOVING, transitions.TROUBLE): BRAKING,
    (MOVING, transitions.NEW_EPOCH): BRAKING,
    (MOVING, transitions.ARRIVED): DONE,
    (MOVING, transitions.LEFT_PATH): BRAKING,
    (BRAKING, transitions.AT_REST): FROZEN,
    (BRAKING, transitions.ARRIVED): DONE,
    (FROZEN, transitions.NEW_EPOCH): IDLE,
    (DONE, transitions.NEW_EPOCH): IDLE,
    (DONE, transitions.LEFT_PATH): BRAKING,
    (DONE, transitions.NEW_COURSE): MOVING,
    (FROZEN, transitions.NEW_COURSE): MOVING,
}
"""What the rules at the head of agent.py ask for."""

PHASES = range(len(PHASE_NAMES))
PAIRS = [(phase, event) for phase in PHASES for event in STIMULI]


@functools.cache
def brought(phase: int) -> Run:
    """Return a robot in a phase; the idle one holds a plan, but stands beside its beginning."""
    run = run_in(phase)
    if phase == IDLE:
        run.body.place(START[0], START[1] + 0.05, START[2])
        hear_plan(run)
        assert (run.agent.phase, run.agent.fault) == (IDLE, OFF_PATH)
    return run


def state_of(run: Run) -> dict:
    """Return all that an agent has made up its mind about, its ride and clock included."""
    state = dict(vars(run.agent))
    state["clock"] = dict(vars(run.agent.clock))
    if run.agent.ride is not None:
        state["ride"] = dict(vars(run.agent.ride))
    return state


def test_the_table_has_a_row_here_for_each_of_its_cells_and_each_of_its_events():
    named = {
        value
        for name, value in vars(transitions).items()
        if name.isupper() and isinstance(value, str)
    }
    assert named == set(STIMULI)
    assert transitions.TRANSITIONS == ROWS


@pytest.mark.parametrize(("phase", "event"), PAIRS)
def test_what_happens_in_a_phase_leads_where_the_table_says_or_nowhere(phase, event):
    run = copy.deepcopy(brought(phase))
    held, epoch = run.agent.ride is not None, run.agent.epoch
    STIMULI[event](run)
    assert run.agent.phase == ROWS.get((phase, event), phase)
    if event == transitions.NEW_EPOCH and ROWS.get((phase, event)) == IDLE:
        assert (run.agent.ride, run.agent.epoch) == (None, 0)
    else:
        assert (run.agent.ride is not None, run.agent.epoch) == (held, epoch)


@pytest.mark.parametrize(("phase", "event"), [pair for pair in PAIRS if pair not in ROWS])
def test_an_event_outside_the_table_changes_nothing(phase, event):
    run = copy.deepcopy(brought(phase))
    before = state_of(run)
    run.agent._apply(event, run.own(run.now))
    assert state_of(run) == before
