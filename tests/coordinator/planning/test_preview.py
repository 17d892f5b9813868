"""A preview of an order says what a course found in the same state comes to."""

import dataclasses
import math

import pytest

from coordinator.planning.preview import Fleet, preview
from tests.coordinator.planning.test_course_proposal import a_site, sent_on
from tests.scenarios import a_robot, a_scenario

CROSSED = [a_robot("R1", (1.0, 4.0), (2.0, 4.0)), a_robot("R2", (5.0, 1.0), (5.0, 7.0))]


def a_fleet(robots, *, now=0.0, idle=(), tau=0.6):
    site, courses, known = a_site(a_scenario(robots, tau=tau))
    return site, Fleet(known, courses, now, {}, frozenset(idle)), courses, known


def test_a_robot_goes_on_from_its_goal_and_waits_for_whom_it_crosses():
    site, fleet, courses, robots = a_fleet(CROSSED)
    found = preview(site, fleet, "R1", (9.0, 4.0), (), at_once=False)
    assert tuple(found.way[0]) == pytest.approx((2.0, 4.0), abs=1e-3)
    assert tuple(found.way[-1]) == pytest.approx((9.0, 4.0), abs=1e-3)
    assert found.begin == pytest.approx(courses["R1"].driven.timeline.finish, abs=2e-3)
    course = sent_on(site, courses, robots, "R1", (9.0, 4.0)).course.driven
    assert found.finish == pytest.approx(course.timeline.finish, abs=0.35)
    rests = sum(wait.seconds for wait in found.waits)
    assert {wait.robot for wait in found.waits} <= {"R2"}
    assert found.finish - found.begin == pytest.approx(found.alone + rests, abs=1.0)


def test_a_rest_names_the_robot_that_has_to_pass_first():
    robots = [
        a_robot("R1", (1.0, 4.0), (2.0, 4.0)),
        a_robot("R2", (6.0, 0.6), (6.0, 7.0), max_speed=0.5),
        a_robot("R3", (9.0, 1.0), (9.0, 1.5)),
    ]
    site, fleet, _, _ = a_fleet(robots)
    # With a heading at its goal it does not move aside.
    found = preview(site, fleet, "R1", (8.0, 4.0, 0.0), (), at_once=False)
    assert found.reason == ""
    assert sum(wait.seconds for wait in found.waits) > 1.0
    assert {wait.robot for wait in found.waits if wait.seconds > 0.5} == {"R2"}


def test_a_redirect_leaves_the_course_where_the_robot_can_stop():
    site, fleet, courses, _ = a_fleet(CROSSED, now=3.0)
    found = preview(site, fleet, "R2", (8.0, 3.0), (), at_once=True)
    line = courses["R2"].driven
    left = line.curve.at_arc([line.timeline.s_at(found.begin)])[0]
    assert math.dist(found.way[0], left) < 0.01
    assert 3.0 < found.begin < 5.0


def test_of_the_free_robots_the_nearest_by_way_does_an_order_for_anybody():
    site, fleet, _, _ = a_fleet(CROSSED, now=60.0, idle=("R1", "R2"))
    assert preview(site, fleet, "", (3.0, 4.0), (), at_once=False).robot == "R1"
    assert preview(site, fleet, "", (5.0, 6.0), (), at_once=False).robot == "R2"
    nobody = dataclasses.replace(fleet, idle=frozenset())
    found = preview(site, nobody, "", (3.0, 4.0), (), at_once=False)
    assert (found.robot, len(found.way)) == ("", 0)
    assert found.reason == "no robot is free; the first that is gets it"


def test_a_goal_on_which_another_robot_rests_is_told():
    site, fleet, courses, _ = a_fleet(CROSSED, now=60.0)
    found = preview(site, fleet, "R1", courses["R2"].goal, (), at_once=False)
    assert found.reason == "R2 rests in the way"
    assert len(found.way) > 1


def test_a_goal_outside_of_the_floor_is_told():
    site, fleet, _, _ = a_fleet(CROSSED, now=60.0)
    found = preview(site, fleet, "R1", (90.0, 4.0), (), at_once=False)
    assert found.reason
    assert len(found.way) == 0


@pytest.mark.parametrize("via", [(), ((2.0, 4.0),)])
def test_a_robot_that_is_sent_to_where_it_rests_stays(via):
    site, fleet, courses, _ = a_fleet(CROSSED, now=60.0)
    here = tuple(courses["R1"].goal)
    found = preview(site, fleet, "R1", here, tuple(here for _ in via), at_once=False)
    assert found.reason == ""
    assert math.dist(found.way[0], found.way[-1]) < 1e-3
    assert found.finish - found.begin < 0.2
