"""A robot that drives takes a newer course, changes to it where it begins, or does not take it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from protocol.curve import Curve
from protocol.phases import DONE, FREEZE, FROZEN, GO, MOVING, NO_FAULT, OFF_PATH, STOP
from protocol.timeline import Timeline
from sim.world.body import SimulatedBody
from tests.robot_agent.core.phases import (
    BODY_ACCEL,
    LENGTH,
    MOTION,
    PATH,
    course_from_goal,
    hear_course_from_goal,
    run_in,
)
from tests.robot_agent.core.rides import (
    MS,
    RULES,
    SECOND,
    Run,
    armed_run,
    dense_line,
    driven_run,
    give_plan,
    motion_along,
    place_at,
    uniform_knots,
    winding_path,
)

FINISH = Timeline(*MOTION).finish
TRACK = RULES[0] / 1000.0
LINE = winding_path("fffffff", heading=0.0)
"""A straight line along x from (1, 2)."""
SPEED, ACCEL = 0.4, 0.5


def line_from(x, length, v0):
    """A straight course along x from (x, 2) that begins with a speed and ends at rest."""
    xs = np.linspace(x, x + length, 4).tolist()
    path = (3, [0.0] * 4 + [1.0] * 4, xs, [2.0] * 4, [1.0] * 4)
    ramp, first = SPEED**2 / (2 * ACCEL), (SPEED**2 - v0**2) / (2 * ACCEL)
    knots = [(0.0, v0), *([(first, SPEED)] if first > 0 else []), (length - ramp, SPEED)]
    return path, [*knots, (length, 0.0)]


def give_line(run, begin, x, v0, length=1.0, revision=1):
    path, knots = line_from(x, length, v0)
    length = Curve(*path).length
    knots[-1] = (length, 0.0)
    motion = ([s for s, _ in knots], [v for _, v in knots], [], [], begin)
    give_plan(run.agent, path, motion, revision=revision)
    return Timeline(*motion)


def on_line(authority=None) -> Run:
    """A robot in the middle of LINE, which is 1.58 m long."""
    run = armed_run(LINE, motion_along(Curve(*LINE).length, SPEED, ACCEL), body=body())
    run.authority = run.authority if authority is None else authority
    run.command(GO)
    run.until(run.start_ns + 1500 * MS)
    return run


def body():
    return SimulatedBody(BODY_ACCEL)


def plan_time(run):
    return (run.now - run.start_ns) / SECOND


def go_on(run, seconds):
    run.until(run.now + round(seconds * SECOND))


def test_a_robot_at_its_goal_drives_a_newer_course_from_its_beginning_on():
    run = run_in(DONE)
    begin = hear_course_from_goal(run, after=1.0)
    assert run.agent.holds == 1
    go_on(run, 0.9)
    assert run.agent.phase == DONE
    go_on(run, 0.2)
    assert run.agent.phase == MOVING
    path, motion = course_from_goal(begin)
    line = Timeline(*motion)
    go_on(run, 1.5)
    x, y = place_at(path, line.s_at(plan_time(run)))
    assert math.dist(run.places[-1], (x, y)) < TRACK
    run.agent.report_due(run.own(run.now))
    assert run.agent.report_late == 0
    go_on(run, line.finish)
    assert run.agent.phase == DONE
    assert math.dist(run.places[-1], place_at(path, line.length)) < 2e-3


@pytest.mark.parametrize("back", [0.003, 0.5 * TRACK, 0.85 * TRACK])
def test_a_robot_that_was_pushed_back_a_little_at_its_goal_leaves_it_on_its_next_course(back):
    length = Curve(*LINE).length
    motion = motion_along(length, SPEED, ACCEL)
    run = driven_run(LINE, motion, Timeline(*motion).finish + 1.0, body=body())
    assert run.agent.phase == DONE
    run.body.place(1.0 + length - back, 2.0, 0.0)
    go_on(run, 0.5)
    assert run.agent.phase == DONE
    give_line(run, round(plan_time(run) + 0.5, 3), 1.0 + length, 0.0)
    go_on(run, 1.0)
    assert (run.agent.phase, run.agent.revision) == (MOVING, 1)
    go_on(run, 5.0)
    assert run.agent.phase == DONE


@pytest.mark.parametrize("heading", [0.0, math.pi / 2, math.pi])
def test_a_robot_too_far_off_its_goal_to_turn_there_does_not_set_out_as_it_looks(heading):
    length = Curve(*LINE).length
    motion = motion_along(length, SPEED, ACCEL)
    run = driven_run(LINE, motion, Timeline(*motion).finish + 1.0, body=body())
    beside = (1.0 + length, 2.0 + 0.95 * TRACK)
    run.body.place(*beside, heading)
    go_on(run, 0.5)
    assert run.agent.phase == DONE
    give_line(run, round(plan_time(run) + 0.5, 3), 1.0 + length, 0.0)
    go_on(run, 1.0)
    assert (run.agent.phase, run.agent.fault, run.agent.revision) == (FROZEN, OFF_PATH, 1)
    assert run.places[-1] == beside


def test_a_robot_that_seems_to_have_left_its_goal_before_it_had_turned_does_not_set_out():
    """It looks back, turns towards its next course, and seems to be beyond its tolerance once."""
    length = Curve(*LINE).length
    motion = motion_along(length, SPEED, ACCEL)
    run = driven_run(LINE, motion, Timeline(*motion).finish + 1.0, body=body())
    x, y, _ = run.body.pose()
    run.body.place(x, y, math.pi)
    give_line(run, round(plan_time(run) + 0.3, 3), 1.0 + length, 0.0)
    for _ in range(100):
        if run.agent.drive_turn == 0.0:
            go_on(run, 0.02)
    own = run.own(run.now) + 10 * MS
    run.agent.tick(own, x + 1.02 * TRACK, y, run.body.heading)
    assert (run.agent.fault, run.agent.drive_speed) == (OFF_PATH, 0.0)


@pytest.mark.parametrize("turned", [-2.5, -1.5, 0.0, 1.5, 2.5])
@pytest.mark.parametrize("radius", [0.012, 0.025])
def test_a_robot_turns_on_the_spot_towards_a_course_that_begins_with_a_tight_bend(radius, turned):
    """Elsewhere on the bend the robot's heading would fit."""
    length = Curve(*LINE).length
    motion = motion_along(length, SPEED, ACCEL)
    run = driven_run(LINE, motion, Timeline(*motion).finish + 1.0, body=body())
    bend = [(radius * math.sin(a), radius * (1.0 - math.cos(a))) for a in np.linspace(0.0, 3.0, 7)]
    bend += [(bend[-1][0] - 0.1 * k, bend[-1][1]) for k in range(1, 5)]
    c, s = math.cos(turned), math.sin(turned)
    points = np.array([(1.0 + length + c * x - s * y, 2.0 + s * x + c * y) for x, y in bend])
    path = (3, uniform_knots(len(points)), *points.T.tolist(), [1.0] * len(points))
    begin = round(plan_time(run) + 0.2, 3)
    slow = motion_along(Curve(*path).length, 0.05, ACCEL)
    give_plan(run.agent, path, (*slow[:4], begin), revision=1)
    go_on(run, 20.0)
    assert (run.agent.phase, run.agent.fault, run.agent.revision) == (DONE, NO_FAULT, 1)


@pytest.mark.parametrize("before", [0.01, 0.05, 0.1])
def test_a_robot_that_stopped_at_its_goal_before_its_plan_ended_leaves_it(before):
    length = Curve(*LINE).length
    motion = motion_along(length, SPEED, ACCEL)
    finish = Timeline(*motion).finish
    run = driven_run(LINE, motion, finish - before, body=body())
    run.agent.hear_driver_error(run.own(run.now))
    go_on(run, 1.0)
    assert run.agent.phase == DONE
    assert run.agent.ride.time < finish
    give_line(run, round(plan_time(run) + 0.5, 3), 1.0 + length, 0.0)
    go_on(run, 1.0)
    assert (run.agent.phase, run.agent.revision) == (MOVING, 1)


def stopped_with_a_course(granted: bool):
    """A robot that has stopped at 1.5 s, and begun a course from there, granted it or not."""
    run = on_line()
    run.agent.hear_driver_error(run.own(run.now))
    go_on(run, 1.0)
    assert run.agent.phase == FROZEN
    x, _ = run.places[-1]
    begin = round(plan_time(run) + 0.2, 3)
    run.authority = run.next_authority = 1_000_000 if granted else round(1000 * begin)
    give_line(run, begin, x, 0.0, revision=1)
    go_on(run, 1.0)
    assert (run.agent.phase, run.agent.revision) == (MOVING, 1)
    return run, x


def test_a_robot_that_was_granted_nothing_on_its_course_takes_another_one_from_where_it_stands():
    """The coordinator took that course back before the robot heard of it, and sent another."""
    run, x = stopped_with_a_course(granted=False)
    assert run.places[-1][0] == x
    give_line(run, round(plan_time(run) + 0.2, 3), x, 0.0, length=0.5, revision=2)
    go_on(run, 0.5)
    assert run.agent.revision == 2
    run.authority = run.next_authority = 1_000_000
    go_on(run, 5.0)
    assert run.agent.phase == DONE
    assert run.places[-1][0] == pytest.approx(x + 0.5, abs=TRACK)


def test_a_robot_that_was_granted_its_course_takes_none_from_where_that_began():
    run, x = stopped_with_a_course(granted=True)
    give_line(run, round(plan_time(run) + 0.2, 3), x, 0.0, length=0.5, revision=2)
    go_on(run, 5.0)
    assert (run.agent.phase, run.agent.revision) == (DONE, 1)
    assert run.places[-1][0] == pytest.approx(x + 1.0, abs=TRACK)


def test_a_course_heard_on_the_way_is_driven_when_the_goal_is_reached():
    run = driven_run(PATH, MOTION, 1.5, body=body())
    path, motion = course_from_goal(round(FINISH, 3) + 0.001)
    give_plan(run.agent, path, motion, revision=1)
    assert run.agent.holds == 1
    run.until(run.start_ns + round((FINISH + 0.1) * SECOND))
    assert run.agent.phase == MOVING
    run.until(run.start_ns + round((Timeline(*motion).finish + 1.0) * SECOND))
    assert run.agent.phase == DONE
    both = np.concatenate((dense_line(PATH)[0], dense_line(path)[0]))
    apart = [np.hypot(*(both - place).T).min() for place in run.places]
    assert max(apart) < TRACK


def test_a_late_robot_changes_where_the_course_begins_not_when():
    run = on_line(authority=2000)
    go_on(run, 3.0)
    s = Timeline(*motion_along(Curve(*LINE).length, SPEED, ACCEL)).s_at(3.2)
    give_line(run, begin=3.2, x=1.0 + s, v0=SPEED)
    assert run.agent.holds == 1
    go_on(run, 1.0)
    assert run.agent.ride.follower.s < s  # The end of its authority lies on the old course.
    run.authority = 10**6
    go_on(run, 3.0)
    assert run.agent.ride.begin == 3.2
    go_on(run, 6.0)
    assert run.agent.phase == DONE
    assert math.dist(run.places[-1], (2.0 + s, 2.0)) < 3e-3


def test_a_robot_changes_to_another_course_in_motion_without_slowing_down():
    run = on_line()
    old = Timeline(*motion_along(Curve(*LINE).length, SPEED, ACCEL))
    line = give_line(run, begin=2.0, x=1.0 + old.s_at(2.0), v0=SPEED, length=1.5)
    go_on(run, 0.4)
    for _ in range(40):
        go_on(run, 0.02)
        assert run.agent.drive_speed > 0.9 * SPEED
    assert run.agent.ride.begin == 2.0
    go_on(run, line.finish)
    assert math.dist(run.places[-1], (1.0 + old.s_at(2.0) + line.length, 2.0)) < 2e-3


@pytest.mark.parametrize("late", [0.0, 0.4])
def test_a_robot_changes_in_motion_to_a_course_that_has_begun_and_runs_along_its_own(late):
    """The new course leads off to the left, 0.3 m after its beginning."""
    run = on_line(authority=1700 if late else None)
    go_on(run, 2.0 * late)
    run.authority = 10**9
    go_on(run, late)
    old = Timeline(*motion_along(Curve(*LINE).length, SPEED, ACCEL))
    begin = 1.2
    path = winding_path("fffffflff", step=0.1, begin=(1.0 + old.s_at(begin), 2.0), heading=0.0)
    length = Curve(*path).length
    motion = ([0.0, length - 0.16, length], [SPEED, SPEED, 0.0], [], [], begin)
    give_plan(run.agent, path, motion, revision=1)
    assert run.agent.holds == 1
    speed = run.agent.drive_speed
    for _ in range(30):
        go_on(run, 0.02)
        assert run.agent.drive_speed > 0.9 * speed
    assert run.agent.revision == 1
    line = Timeline(*motion)
    if not late:
        assert math.dist(run.places[-1], place_at(path, line.s_at(plan_time(run)))) < 5e-3
    go_on(run, line.finish)
    assert run.agent.phase == DONE
    assert math.dist(run.places[-1], place_at(path, length)) < 3e-3
    apart = [np.hypot(*(dense_line(path)[0] - p).T).min() for p in run.places[-300:]]
    assert max(apart) < TRACK


def test_a_robot_beyond_the_place_where_a_course_leads_off_does_not_take_it():
    run = on_line()
    old = Timeline(*motion_along(Curve(*LINE).length, SPEED, ACCEL))
    begin = 0.9
    path = winding_path("ffllff", step=0.05, begin=(1.0 + old.s_at(begin), 2.0), heading=0.0)
    length = Curve(*path).length
    motion = ([0.0, length - 0.16, length], [SPEED, SPEED, 0.0], [], [], begin)
    give_plan(run.agent, path, motion, revision=1)
    assert run.agent.holds == 0


def test_a_robot_stops_at_the_end_of_its_authority_where_a_course_begins_at_rest():
    run = on_line(authority=2500)
    old = Timeline(*motion_along(Curve(*LINE).length, SPEED, ACCEL))
    x = 1.0 + old.s_at(2.5)
    path = winding_path("ffff", step=0.2, begin=(x, 2.0), heading=1.2)
    profile_s, profile_v, *_ = motion_along(Curve(*path).length, 0.3, ACCEL)
    motion = (profile_s, profile_v, [0.0], [5.0], 2.5)
    give_plan(run.agent, path, motion, revision=1)
    assert run.agent.holds == 1
    run.authority = 10**6
    go_on(run, 0.3)
    run.until(run.start_ns + round(Timeline(*motion).finish * SECOND) + SECOND)
    assert run.agent.phase == DONE
    assert math.dist(run.places[-1], place_at(path, Curve(*path).length)) < 3e-3
    assert max(x for x, _ in run.places if abs(_ - 2.0) < 1e-3) < x + TRACK


@pytest.mark.parametrize(
    ("begin", "x", "v0"),
    [
        (1.4, 0.0, 0.5 * SPEED),  # It has begun, and does not run along the one under way.
        (2.0, 0.05, SPEED),  # It begins somewhere else.
        (2.0, 0.0, 0.5 * SPEED),  # It begins at another speed.
        (2.0, 0.0, 0.0),  # It begins at rest, where the robot may drive on.
    ],
)
def test_a_course_that_the_one_under_way_does_not_lead_into_is_not_taken(begin, x, v0):
    run = on_line()
    old = Timeline(*motion_along(Curve(*LINE).length, SPEED, ACCEL))
    give_line(run, begin=begin, x=1.0 + old.s_at(begin) + x, v0=v0)
    assert run.agent.holds == 0
    run.until(run.start_ns + round(old.finish * SECOND) + SECOND)
    assert run.agent.phase == DONE
    assert math.dist(run.places[-1], place_at(LINE, old.length)) < 2e-3


@pytest.mark.parametrize("change", ["epoch", "path"])
def test_a_course_for_others_or_of_nonsense_is_not_taken(change):
    run = run_in(DONE)
    path, motion = course_from_goal(plan_time(run) + 0.5)
    path = (3, [], [], [], []) if change == "path" else path
    give_plan(run.agent, path, motion, epoch=2 if change == "epoch" else 1, revision=1)
    go_on(run, 1.0)
    assert (run.agent.phase, run.agent.fault, run.agent.holds) == (DONE, 0, 0)


def test_a_robot_at_its_goal_takes_a_course_that_should_have_begun_already():
    run = run_in(DONE)
    go_on(run, 1.0)
    assert run.agent.report_due(run.own(run.now) + SECOND)
    path, motion = course_from_goal(plan_time(run) - 0.5)
    give_plan(run.agent, path, motion, revision=1)
    go_on(run, 0.1)
    assert (run.agent.phase, run.agent.holds, run.agent.revision) == (MOVING, 1, 1)
    go_on(run, Timeline(*motion).finish)
    assert run.agent.phase == DONE


@pytest.mark.parametrize("after", [-0.5, 0.3])
def test_a_robot_that_starts_at_once_takes_a_course_from_its_goal_early_or_late(after):
    rules = (RULES[0], 0, RULES[2])
    run = driven_run(PATH, motion_along(LENGTH, 0.475, math.inf), 10.0, rules=rules)
    assert run.agent.phase == DONE
    path, _ = course_from_goal(0.0)
    begin = round(plan_time(run) + after, 3)
    line = Timeline([0.0, Curve(*path).length], [0.475, 0.475], [0.0], [begin], begin)
    motion = ([0.0, line.length], [0.475, 0.475], [0.0], [begin], begin)
    give_plan(run.agent, path, motion, rules, revision=1)
    assert run.agent.holds == 1
    go_on(run, line.finish - begin + max(after, 0.0) + 1.0)
    assert (run.agent.phase, run.agent.revision) == (DONE, 1)
    assert math.dist(run.places[-1], place_at(path, line.length)) < 5e-3


def test_a_course_has_a_number_and_authority_of_its_own():
    run = run_in(DONE)
    path, motion = course_from_goal(plan_time(run) + 0.3)
    run.authority = 0  # It was granted much on its old course.
    give_plan(run.agent, path, motion, number=9, revision=1)
    assert (run.agent.number, run.agent.next_number) == (4, 9)
    go_on(run, 2.0)
    assert (run.agent.phase, run.agent.number) == (MOVING, 9)
    assert math.dist(run.places[-1], place_at(path, 0.0)) < TRACK
    run.authority = 10**6
    go_on(run, Timeline(*motion).finish)
    assert run.agent.phase == DONE


def test_an_older_course_is_not_taken_after_a_newer_one():
    run = run_in(DONE)
    hear_course_from_goal(run, revision=3, after=0.5)
    hear_course_from_goal(run, revision=2, after=0.4)
    assert run.agent.holds == 3
    go_on(run, 0.45)
    assert run.agent.phase == DONE


def test_a_newer_course_takes_the_place_of_one_that_has_not_begun():
    run = run_in(DONE)
    hear_course_from_goal(run, revision=1, after=0.5)
    hear_course_from_goal(run, revision=2, after=1.0)
    go_on(run, 0.8)
    assert (run.agent.phase, run.agent.holds) == (DONE, 2)
    go_on(run, 0.4)
    assert run.agent.phase == MOVING


def test_a_robot_turns_on_the_spot_before_it_sets_out_on_a_course_in_another_direction():
    run = run_in(DONE)
    x, y, heading = run.body.pose()
    path = winding_path("fffff", begin=place_at(PATH, LENGTH), heading=heading + 2.5)
    begin = round(plan_time(run) + 0.2, 3)
    profile_s, profile_v, *_ = motion_along(Curve(*path).length, 0.4, ACCEL)
    motion = (profile_s, profile_v, [0.0], [begin + 3.0], begin)
    give_plan(run.agent, path, motion, revision=1)
    go_on(run, 2.5)
    assert math.dist(run.places[-1], (x, y)) < 3e-3
    turned = run.body.pose()[2] - heading - 2.5
    assert abs(math.remainder(turned, 2 * math.pi)) < 0.25
    run.until(run.start_ns + round(Timeline(*motion).finish * SECOND) + SECOND)
    assert run.agent.phase == DONE
    apart = [np.hypot(*(dense_line(path)[0] - p).T).min() for p in run.places[-300:]]
    assert max(apart) < TRACK


@pytest.mark.parametrize("order", [FREEZE, STOP])
@pytest.mark.parametrize("before", [0.05, 0.4])
def test_a_robot_told_to_brake_near_a_change_stays_on_its_courses(order, before):
    run = on_line()
    old = Timeline(*motion_along(Curve(*LINE).length, SPEED, ACCEL))
    give_line(run, begin=2.0, x=1.0 + old.s_at(2.0), v0=SPEED)
    run.until(run.start_ns + round((2.0 - before) * SECOND))
    run.command(order)
    go_on(run, 3.0)
    assert run.agent.phase == (FROZEN if order == FREEZE else MOVING)
    assert run.agent.drive_speed == 0.0
    assert max(abs(y - 2.0) for _, y in run.places) < TRACK


def stopped_run(order=None):
    """A robot that has stopped in the middle of LINE: by a fault of its own, or by an order."""
    run = on_line()
    if order is None:
        run.agent.hear_driver_error(run.own(run.now))
    else:
        run.command(order)
    go_on(run, 2.0)
    assert run.agent.phase == FROZEN
    return run


def course_from_here(run, aside=0.0, turns="fffff", turned=0.0):
    x, y, heading = run.body.pose()
    path = winding_path(turns, begin=(x, y + aside), heading=heading + turned)
    begin = round(plan_time(run) + 0.3, 3)
    profile_s, profile_v, *_ = motion_along(Curve(*path).length, SPEED, ACCEL)
    return path, (profile_s, profile_v, [0.0], [begin + 2.0 * (turned != 0.0)], begin)


@pytest.mark.parametrize("turned", [0.0, 2.0])
def test_a_robot_that_stopped_by_a_fault_goes_on_on_a_course_from_where_it_stands(turned):
    run = stopped_run()
    path, motion = course_from_here(run, turned=turned)
    give_plan(run.agent, path, motion, revision=1)
    assert (run.agent.phase, run.agent.holds) == (FROZEN, 1)
    go_on(run, 0.2)
    assert run.agent.phase == FROZEN
    go_on(run, 0.3)
    assert (run.agent.phase, run.agent.revision, run.agent.fault) == (MOVING, 1, 0)
    go_on(run, Timeline(*motion).finish)
    assert run.agent.phase == DONE
    assert math.dist(run.places[-1], place_at(path, Timeline(*motion).length)) < 5e-3


def test_a_robot_that_fails_before_it_sets_out_goes_on_on_a_course_from_where_it_stands():
    run = armed_run(LINE, motion_along(Curve(*LINE).length, SPEED, ACCEL), body=body())
    run.agent.hear_driver_error(run.own(run.now))
    assert run.agent.phase == FROZEN
    run.command(GO)
    run.until(run.start_ns + SECOND)
    path, motion = course_from_here(run)
    give_plan(run.agent, path, motion, revision=1)
    go_on(run, 0.5)
    assert (run.agent.phase, run.agent.revision, run.agent.fault) == (MOVING, 1, 0)


def test_a_robot_that_dropped_a_course_when_it_stopped_does_not_take_a_late_copy_of_it():
    length = Curve(*LINE).length
    motion = motion_along(length, SPEED, ACCEL)
    finish = Timeline(*motion).finish
    run = driven_run(LINE, motion, finish - 0.1, body=body())
    give_line(run, finish + 3.0, 1.0 + length, 0.0)
    assert run.agent.holds == 1
    run.body.place(1.0 + length - 0.01, 2.0, 0.0)
    run.agent.hear_driver_error(run.own(run.now))
    go_on(run, 1.0)
    assert (run.agent.phase, run.agent.holds) == (FROZEN, 0)
    give_line(run, finish + 3.0, 1.0 + length, 0.0)
    assert run.agent.holds == 0
    give_line(run, finish + 3.0, 1.0 + length, 0.0, revision=2)
    assert run.agent.holds == 2


def test_a_robot_that_has_stopped_takes_no_course_that_begins_elsewhere():
    run = stopped_run()
    path, motion = course_from_here(run, aside=0.1)
    give_plan(run.agent, path, motion, revision=1)
    go_on(run, 1.0)
    assert (run.agent.phase, run.agent.holds) == (FROZEN, 0)


def test_a_frozen_fleet_begins_no_course():
    run = stopped_run(FREEZE)
    path, motion = course_from_here(run)
    give_plan(run.agent, path, motion, revision=1)
    go_on(run, 2.0)
    assert run.agent.phase == FROZEN


def test_a_robot_pushed_away_from_where_its_next_course_begins_stays_there():
    run = stopped_run()
    path, motion = course_from_here(run)
    give_plan(run.agent, path, motion, revision=1)
    x, y, heading = run.body.pose()
    run.body.place(x, y + 0.1, heading)
    go_on(run, 2.0)
    assert (run.agent.phase, run.agent.revision) == (FROZEN, 0)


@pytest.mark.parametrize("has_next", [False, True])
def test_a_robot_that_holds_its_next_course_drives_on_after_a_tight_bend(has_next):
    """It is located twice in a tick then.  Its plan is slow in the bend, and fast after it."""
    out, back = (
        [-0.4, -0.3, -0.2, -0.1, 0.0, 0.006],
        [0.006, 0.0, -0.1, *np.arange(-0.2, -1.1, -0.2)],
    )
    xs, ys = [*out, *back], [1.992] * len(out) + [2.0] * len(back)
    path = (3, uniform_knots(len(xs)), xs, ys, [1.0] * len(xs))
    length, slow = Curve(*path).length, 0.01
    knots = [(0.0, 0.0), (0.1, SPEED), (0.25, SPEED), (0.4, slow), (0.42, slow)]
    knots += [(0.6, SPEED), (length - 0.2, SPEED), (length, 0.0)]
    finish = Timeline([s for s, _ in knots], [v for _, v in knots], [], [], 0.0).finish
    run = armed_run(path, ([s for s, _ in knots], [v for _, v in knots], [], [], 0.0), body=body())
    run.command(GO)
    run.until(run.start_ns + 300 * MS)
    if has_next:
        give_line(run, round(finish + 20.0, 3), xs[-1], 0.0)
        assert run.agent.holds == 1
    while run.agent.phase == MOVING and plan_time(run) < finish + 10.0:
        go_on(run, 0.05)
    assert (run.agent.phase, run.agent.fault) == (DONE, NO_FAULT)
    assert plan_time(run) < finish + 0.5
