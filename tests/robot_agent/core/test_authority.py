"""A robot never passes the plan time that it was granted, and says how far behind it is."""

import itertools
import math
import random

import numpy as np
import pytest

from protocol.curve import Curve
from protocol.phases import DONE, FREEZE, FROZEN, GO, MOVING, NO_FAULT, STOP
from protocol.timeline import Timeline
from protocol.timing import LATE_STEP_MS
from robot_agent.core.ride import NOTHING
from sim.world.body import SimulatedBody
from tests.robot_agent.core.rides import (
    AT_ONCE,
    MS,
    RULES,
    SECOND,
    armed_run,
    dense_line,
    driven_run,
    motion_along,
    winding_path,
)
from tests.sweeps import seeds

PASSED = 2e-3
"""How far [m] the tests let a robot's place be beyond the end of its authority."""

PATH = winding_path()
LENGTH = Curve(*PATH).length
PLACES, ARCS = dense_line(PATH)


def arc_of(place):
    return float(ARCS[np.hypot(*(PLACES - place).T).argmin()])


def a_motion(accel, stops=((1.1, 9.0),)):
    return motion_along(LENGTH, 0.5, accel, stops)


def granted_run(rules, accel, seed=None, slip=0.0):
    motion = a_motion(accel)
    body = SimulatedBody(max_accel=accel, slip=slip) if slip else SimulatedBody(max_accel=accel)
    run = armed_run(PATH, motion, rules, body=body, seed=seed)
    run.authority = 0
    run.command(GO)
    return run, Timeline(*motion)


@pytest.mark.parametrize(("rules", "accel"), [(RULES, 0.5), (AT_ONCE, math.inf)])
@pytest.mark.parametrize("seed", seeds(12))
def test_a_robot_never_passes_its_authority_and_arrives_when_it_is_granted_all(rules, accel, seed):
    dice = random.Random(seed)
    run, line = granted_run(rules, accel, seed)
    ends = []
    while run.authority < 1000.0 * line.finish:
        run.until(run.now + dice.randint(50, 1_500) * MS)
        ends += [line.s_at(run.authority / 1000.0)] * (len(run.places) - len(ends))
        run.authority += dice.choice([0, dice.randint(1, 300), dice.randint(300, 2_500)])
    for place, end in zip(run.places, ends, strict=False):
        assert arc_of(place) <= end + PASSED
    run.until(run.now + 60 * SECOND)
    assert (run.agent.fault, run.agent.phase) == (NO_FAULT, DONE)


def test_a_robot_brakes_before_the_end_of_its_authority_and_stands_there():
    run, line = granted_run(RULES, 0.5)
    run.authority = 3_000
    run.until(run.start_ns + 12 * SECOND)
    assert run.agent.phase == MOVING
    assert run.body.speed == pytest.approx(0.0, abs=1e-3)
    assert arc_of(run.places[-1]) == pytest.approx(line.s_at(3.0), abs=0.01)
    speeds = np.hypot(*np.diff(np.array(run.places), axis=0).T) / np.diff(run.times)
    assert np.diff(speeds).min() / 0.01 > -0.5 - 0.1


def test_a_robot_that_is_granted_enough_drives_as_one_without_a_limit():
    free = driven_run(PATH, a_motion(0.5), 20.0)
    run = armed_run(PATH, a_motion(0.5))
    run.command(GO)
    for time in itertools.count(100, 100):
        run.authority = time + 1_800
        run.until(run.start_ns + time * MS)
        if time == 20_000:
            break
    assert run.places == free.places
    assert run.phases == free.phases


def test_less_authority_than_before_takes_nothing_back():
    run, _ = granted_run(RULES, 0.5)
    run.authority = 3_000
    run.until(run.start_ns + 500 * MS)
    run.authority = 100
    run.until(run.start_ns + 10 * SECOND)
    assert arc_of(run.places[-1]) > 0.5


def test_a_robot_of_which_commands_say_nothing_keeps_what_it_was_granted():
    run, line = granted_run(RULES, 0.5)
    run.authority = NOTHING
    run.until(run.start_ns + 3 * SECOND)
    assert arc_of(run.places[-1]) == pytest.approx(0.0, abs=PASSED)
    run.authority = 3_000
    run.until(run.now + 200 * MS)
    run.authority = NOTHING
    run.until(run.now + 20 * SECOND)
    assert run.agent.phase == MOVING
    assert arc_of(run.places[-1]) == pytest.approx(line.s_at(3.0), abs=0.01)


def disturb(run, dice):
    """Let something happen to a robot that must not make it pass its authority."""
    what = dice.choice(
        ["nothing", "stop", "clock unknown", "put off", "brought forward", "silence"]
    )
    if what == "stop":
        run.command(STOP)
        run.until(run.now + dice.randint(1, 1_500) * MS)
        run.command(GO)
    elif what == "clock unknown":
        run.agent.clock.start_over(run.own(run.now))
    elif what in ("put off", "brought forward"):
        run.start_ns += dice.randint(1, 2_000) * MS * (1 if what == "put off" else -1)
    run.until(run.now + dice.randint(50, 1_500) * MS, talking=what != "silence")


@pytest.mark.parametrize(("rules", "accel"), [(RULES, 0.5), (AT_ONCE, math.inf)])
@pytest.mark.parametrize("seed", seeds(20))
def test_whatever_happens_to_its_clock_start_and_link_a_robot_never_passes_its_authority(
    rules, accel, seed
):
    dice = random.Random(seed)
    jitter = seed if seed % 2 else None
    run, line = granted_run(rules, accel, jitter)
    ends = []
    for _ in range(25):
        disturb(run, dice)
        granted = max(run.agent.ride._authority, 0.0)
        ends += [line.s_at(granted)] * (len(run.places) - len(ends))
        run.authority += dice.choice([0, dice.randint(1, 300), dice.randint(300, 1_500)])
    for place, end in zip(run.places, ends, strict=True):
        assert arc_of(place) <= end + PASSED
    assert jitter is not None or run.agent.fault == NO_FAULT


@pytest.mark.parametrize("told", [FREEZE, STOP])
@pytest.mark.parametrize("milliseconds", range(0, 1_000, 90))
def test_a_robot_told_to_brake_before_the_end_of_its_authority_does_not_pass_it(told, milliseconds):
    run, line = granted_run(RULES, 0.5)
    run.authority = 2_500
    run.until(run.start_ns + 1_500 * MS + milliseconds * MS)
    run.command(told)
    run.until(run.now + 5 * SECOND)
    assert run.agent.phase == (FROZEN if told == FREEZE else MOVING)
    assert max(map(arc_of, run.places)) <= line.s_at(2.5) + PASSED


@pytest.mark.parametrize("seed", seeds(8))
def test_a_robot_never_reports_more_progress_than_it_has_made(seed):
    """Its place is at or beyond that of the plan at stamp - late, but for the track tolerance."""
    dice = random.Random(seed)
    run, line = granted_run(RULES, 0.5, seed)
    run.until(run.start_ns)
    stamped = late = 0
    while run.agent.phase != DONE:
        run.authority += dice.choice([0] * 7 + [600])
        run.until(run.now + 100 * MS)
        if run.agent.report_due(run.own(run.now)) and run.agent.report_stamp_ms != NOTHING:
            agent = run.agent
            stamped += 1
            late += agent.report_late > 0
            progress = (agent.report_stamp_ms - LATE_STEP_MS * agent.report_late) / 1000.0
            assert arc_of(run.places[-1]) >= line.s_at(progress) - RULES[0] / 1000.0
    assert stamped > 50
    assert late > 10


def test_a_robot_on_time_reports_no_lateness():
    run = armed_run(PATH, a_motion(0.5))
    run.command(GO)
    for time in range(200, 5_000, 200):
        run.until(run.start_ns + time * MS)
        assert run.agent.report_due(run.own(run.now))
        assert run.agent.report_late == 0
        assert run.agent.report_stamp_ms == pytest.approx(time, abs=30)


def test_a_robot_that_waits_by_its_plan_is_not_late_until_the_wait_is_over():
    run, line = granted_run(RULES, 0.5)
    run.authority = round(1000.0 * line.arrivals[0]) + 50
    for time in np.arange(200, 14_000, 200).tolist():
        run.until(run.start_ns + time * MS)
        run.agent.report_due(run.own(run.now))
        if line.arrivals[0] + 0.5 < time / 1000.0 <= 9.0:
            assert run.agent.report_late == 0
    assert run.agent.report_late * LATE_STEP_MS >= 3_000


def test_a_robot_at_its_goal_is_never_late_even_if_it_stopped_a_little_short():
    run = driven_run(PATH, a_motion(0.5), 14.0)
    run.until(run.start_ns + 40 * SECOND)
    assert run.agent.phase == DONE
    run.body.x -= 0.004 * math.cos(run.body.heading)
    run.body.y -= 0.004 * math.sin(run.body.heading)
    run.until(run.now + 500 * MS)
    assert run.agent.phase == DONE
    assert run.agent.report_due(run.own(run.now))
    assert run.agent.report_late == 0
    assert run.agent.report_stamp_ms > 40_000
