"""What an agent says, and when."""

from __future__ import annotations

import itertools

import pytest

from protocol.phases import ARMED, BRAKING, DONE, FREEZE, FROZEN, GO, IDLE, LATE, MOVING, OVER
from robot_agent.core.agent import Agent
from tests.robot_agent.core.phases import hear_plan, run_in
from tests.robot_agent.core.rides import MS, SECOND


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
    run.command(GO, age=0)
    assert not run.agent.may_leave(run.own(run.now) + 600 * MS)
    assert run.agent.may_leave(run.own(run.now) + 601 * MS)
    assert not run_in(FROZEN).agent.may_leave(1 << 60)
    run.command(OVER)
    assert run.agent.may_leave(run.own(run.now))


def test_a_robot_that_hung_says_nothing_before_it_knows_whether_it_is_late():
    run = run_in(MOVING)
    run.until(run.now + 500 * MS)
    run.now = run.due = run.due + 400 * MS
    said = []
    for _ in range(30):
        run.until(run.now + 11 * MS)
        if run.agent.report_due(run.own(run.now)):
            said.append((run.agent.phase, run.agent.fault))
    assert said[0] == (BRAKING, LATE)
    assert run.agent.report_sequence == len(said)
