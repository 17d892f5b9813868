"""What an agent says, and when."""

from __future__ import annotations

import itertools

import pytest

from protocol.phases import ARMED, BRAKING, DONE, FREEZE, FROZEN, GO, HOLD, IDLE, MOVING, OVER
from protocol.timeline import Timeline
from protocol.timing import LATE_STEP_MS
from robot_agent.core.agent import Agent
from robot_agent.core.ride import MOST_LATE, MOST_STAMP, NOTHING, Ride
from tests.robot_agent.core.phases import MOTION, PATH, hear_plan, run_in
from tests.robot_agent.core.rides import COORDINATOR, MS, RULES, SECOND, TERM, give_plan, place_at


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
    agent.hear_command(COORDINATOR, TERM, 1, 1, HOLD, 0, 0, 0, False, 0)
    asked = []
    for now in range(0, 10 * SECOND, 10 * MS):
        if agent.clock_due(now):
            asked.append(now)
            agent.hear_clock(COORDINATOR, now, now, now, now + 4 * MS)
    assert asked[:8] == [i * 40 * MS for i in range(8)]
    assert [b - a for a, b in itertools.pairwise(asked[7:])] == [2 * SECOND] * 4


def test_a_robot_has_finished_when_all_is_over_and_not_before():
    for phase in (IDLE, ARMED, MOVING, BRAKING, FROZEN, DONE):
        run = run_in(phase)
        assert not run.agent.finished
        run.command(OVER)
        run.until(run.now + 100 * MS)
        assert run.agent.finished == (phase not in (MOVING, BRAKING))


def reported(run):
    """Return stamp and lateness [ms] of the first report."""
    assert run.agent.report_due(run.own(run.now))
    return run.agent.report_stamp_ms, LATE_STEP_MS * run.agent.report_late


@pytest.mark.parametrize("phase", [IDLE, ARMED, MOVING, BRAKING, FROZEN, DONE])
def test_a_robot_states_a_stamp_when_it_is_under_way_or_at_its_goal(phase):
    run = run_in(phase)
    stamp, late = reported(run)
    assert (stamp != NOTHING) == (phase in (MOVING, DONE))
    assert late == 0


def test_a_robot_that_does_not_know_the_time_reports_the_plan_time_that_it_drives_by():
    run = run_in(MOVING)
    run.agent.clock.start_over(run.own(run.now))
    run.until(run.now + 500 * MS, talking=False)
    assert run.agent.clock.good == 0
    stamp, late = reported(run)
    assert stamp == pytest.approx(2_000, abs=30)
    assert late <= LATE_STEP_MS
    assert Timeline(*MOTION).s_at((stamp - late) / 1000.0) <= run.agent.ride.follower.s + 2e-3


def test_a_report_states_the_revision_of_the_course_that_is_driven():
    run = run_in(IDLE)
    give_plan(run.agent, PATH, MOTION, revision=7)
    assert run.agent.report_due(run.own(run.now) + SECOND)
    assert run.agent.revision == 7


def a_ride(seconds=1.5):
    """Return a ride whose robot stands where its plan has it after so many seconds."""
    ride = Ride(1, RULES, PATH, MOTION, 0.5, 0.01)
    line = Timeline(*MOTION)
    x, y = place_at(PATH, line.s_at(seconds))
    ride.follower.s = line.s_at(seconds)
    ride.follower.locate(x, y, 0.3)
    return ride, line


@pytest.mark.parametrize("now_ms", [1_500, 1_549, 1_551, 2_000, 2_001, 2_049, 2_050, 100_000])
def test_lateness_is_rounded_up_so_that_no_more_progress_is_claimed_than_made(now_ms):
    ride, line = a_ride()
    ride.reckon(now_ms)
    assert ride.stamp_ms == now_ms
    passed = ride.stamp_ms - LATE_STEP_MS * ride.late
    slack = 0.2 * RULES[0] / 1000.0
    assert line.s_at(passed / 1000.0) <= ride.follower.s + slack + 1e-9
    if ride.late:
        assert line.s_at((passed + LATE_STEP_MS) / 1000.0) > ride.follower.s + slack


def test_a_robot_ahead_of_its_plan_reports_the_time_that_it_is_and_no_lateness():
    ride, _ = a_ride()
    ride.reckon(1_000)
    assert (ride.stamp_ms, ride.late) == (1_000, 0)


@pytest.mark.parametrize("now_ms", [(MOST_LATE + 1) * LATE_STEP_MS + 2_000, MOST_STAMP + 1])
def test_a_robot_too_late_to_say_how_late_states_its_progress_as_the_stamp(now_ms):
    ride, line = a_ride()
    ride.reckon(now_ms)
    assert ride.late == 0
    assert ride.stamp_ms == pytest.approx(1_500, abs=10)
    assert line.s_at(ride.stamp_ms / 1000.0) <= ride.follower.s + 0.2 * RULES[0] / 1000.0


def test_a_stamp_long_before_the_start_is_one_that_fits_in_a_report():
    ride, _ = a_ride()
    ride.reckon(-(10**12))
    assert (ride.stamp_ms, ride.late) == (-MOST_STAMP, 0)
