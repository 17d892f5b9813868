"""Until when a newer course is the old one, against dense sampling of both."""

import dataclasses
import math

import msgspec
import numpy as np
import pytest
from msgspec.structs import replace

from coordinator.plan.course import Course
from coordinator.plan.document import Limits
from coordinator.plan.wire import unpack
from coordinator.planning.course_proposal import propose
from coordinator.planning.course_search import search
from coordinator.planning.leading_off import UnderWay
from coordinator.planning.planner import plan_fleet
from coordinator.planning.wish import Site, Wish
from coordinator.proof.course_proof import course_failures
from coordinator.proof.shared_course import shared_until
from coordinator.scenario.margin import SAME
from coordinator.schedule.staircase_making import staircases_of
from protocol.codec import decode, encode
from protocol.plan_bytes import pack_points, unpack_points
from tests.scenarios import a_robot, a_scenario

BEGIN, LEAVE = 2.0, 3.5
PLACES = [(8.0, 4.0), (7.5, 7.0), (2.0, 6.0), (1.0, 2.5)]
"""Ahead to the left, to the left, back, and behind it."""


def on_its_way(goal, **fields):
    """A robot that drives along y = 1, and its wish to leave for another goal in motion."""
    robot = a_robot("R1", (1.0, 1.0), (9.0, 1.0), **fields)
    scenario = a_scenario([robot])
    plan = plan_fleet(scenario, effort=0)
    (old,) = plan.driven
    leaves = UnderWay(old, round(1000 * BEGIN), round(1000 * LEAVE))
    wanted = replace(robot, start=(*place(old, LEAVE),), goal=goal)
    wish = Wish(wanted, 0.0, 1, 1, round(1000 * LEAVE), 1.0, leaves=leaves)
    return Site(scenario, plan.document), wish, old


def place(driven, time):
    return tuple(driven.curve.at_arc([driven.timeline.s_at(time)])[0].tolist())


def apart(old, new, until):
    times = np.arange(BEGIN, until, 0.002).tolist()
    return max(math.dist(place(old, t), place(new, t)) for t in times)


def faster(old, new, until):
    times = np.arange(BEGIN, until, 0.002).tolist()
    return max(abs(old.timeline.v_at(t) - new.timeline.v_at(t)) for t in times)


@pytest.mark.parametrize("goal", PLACES)
@pytest.mark.parametrize("fields", [{}, {"min_turn_radius": 0.5}, {"max_lateral_accel": math.inf}])
def test_a_course_leads_off_another_smoothly_where_it_may_and_not_before(goal, fields):
    site, wish, old = on_its_way(goal, **fields)
    found = propose(site, wish.in_motion(), []).course
    new = found.driven
    assert shared_until(old, new) >= LEAVE
    assert apart(old, new, LEAVE) < SAME
    assert apart(old, new, shared_until(old, new)) < SAME
    assert faster(old, new, shared_until(old, new)) < 1.001e-3
    assert found.goal == pytest.approx(goal, abs=1e-5)
    assert new.timeline.v_at(BEGIN) == pytest.approx(old.timeline.v_at(BEGIN), abs=1e-5)
    assert min(new.timeline.v_at(t) for t in np.arange(BEGIN, new.timeline.finish - 1.0, 0.01)) > 0
    u = np.linspace(0.0, new.curve.knots[-1], 20_001)
    _, first, second = new.curve.derivatives(u, 2)
    assert np.hypot(*np.diff(first, axis=0).T).max() < 0.01
    assert np.hypot(*np.diff(second, axis=0).T).max() < 0.1 * np.hypot(*second.T).max() + 1e-9
    assert not new.timeline.next_stop(BEGIN)


def test_places_to_pass_and_the_heading_at_the_goal_hold_in_motion_too():
    site, wish, old = on_its_way((8.0, 5.0, 1.0))
    wish = dataclasses.replace(wish, robot=replace(wish.robot, via=((6.0, 3.0), (7.0, 2.0))))
    new = propose(site, wish.in_motion(), []).course.driven
    assert shared_until(old, new) >= LEAVE
    places, ahead = new.curve.derivatives(np.linspace(0.0, new.curve.knots[-1], 20_001), 1)
    for via in wish.robot.via:
        assert np.hypot(*(places - via).T).min() < 2e-3
    assert math.atan2(ahead[-1, 1], ahead[-1, 0]) == pytest.approx(1.0, abs=0.01)


def test_the_quicker_of_going_on_in_motion_and_after_a_stop_is_taken():
    site, wish, old = on_its_way((8.0, 4.0))
    assert search(site, wish, []).proposal.course.since == BEGIN
    behind = place(old, LEAVE)[0] - 0.3
    site, wish, old = on_its_way((behind, 1.0))
    assert search(site, wish, []).proposal.course.since == LEAVE


def a_course(goal=(8.0, 4.0)):
    site, wish, old = on_its_way(goal)
    return site, old, propose(site, wish.in_motion(), []).course.driven


def changed(driven, **fields):
    plan = decode("plan", encode(driven.plan))
    return unpack(encode(msgspec.structs.replace(plan, **fields)), driven.radius)


def test_a_course_that_begins_a_moment_later_or_moves_by_a_millimetre_shares_nothing():
    _, old, new = a_course()
    begin = new.plan.begin_ms
    assert shared_until(old, changed(new, begin_ms=begin + 2)) == pytest.approx(BEGIN + 2e-3)
    moved = pack_points([(x, y + 1e-3) for x, y in unpack_points(new.plan.points)])
    assert shared_until(old, changed(new, points=moved)) == pytest.approx(BEGIN)


def test_a_course_that_begins_in_motion_is_not_proven_but_where_it_runs_along_the_one_before():
    site, old, new = a_course()
    late = changed(new, begin_ms=new.plan.begin_ms + 5)
    for driven, before, good in ((new, old, True), (new, None, False), (late, old, False)):
        course = Course(driven, 0.001 * driven.plan.begin_ms)
        staircases = staircases_of([driven], site.terms.tau, site.terms.margin, (0,), [0.0])
        limits = Limits.of(site.scenario.robots[0])
        found = course_failures([course], staircases, site.terms.margin, limits, site.gap, before)
        assert (found == []) == good
