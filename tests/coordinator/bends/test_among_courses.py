"""Courses as traffic, held against their own timelines, and paths that move aside for them."""

import math

import numpy as np
import pytest
from msgspec.structs import replace

from coordinator.bends import among_courses, courses_met
from coordinator.bends.among_courses import Bends, pitches_of
from coordinator.bends.courses_met import errand_of, samples_of, stretch_of
from coordinator.plan.course import Course
from coordinator.planning import earliest_course
from coordinator.planning.course_proposal import propose
from coordinator.planning.planner import plan_fleet
from coordinator.planning.wish import Site, Wish
from sim.floors.generator import generate
from tests.coordinator.planning.test_course_proposal import assert_keeps_apart
from tests.scenarios import a_robot, a_scenario
from tests.sweeps import are_whole

HALL = a_scenario(
    [a_robot("R1", (1.0, 4.0), (1.5, 4.0)), a_robot("R2", (9.0, 4.0), (2.6, 4.0))], tau=0.6
)


def courses_of(scenario, since=0.0):
    plan = plan_fleet(scenario, effort=0)
    return plan, [Course(one, since) for one in plan.driven]


@pytest.mark.parametrize("seed", [1, 2])
def test_samples_cover_a_course_at_all_times_and_are_near_it(seed):
    for course in courses_of(generate("warehouse", 8, seed), since=1.0)[1]:
        x, y, begin, end, radius = samples_of(course).T
        assert (begin[0], end[-1]) == (course.since, math.inf)
        assert (begin[1:] <= end[:-1] + 1e-9).all()
        assert (radius == course.driven.radius).all()
        for time in np.linspace(course.since, course.driven.timeline.finish + 2.0, 300):
            s = course.driven.timeline.s_at(time)
            place = course.driven.curve.at_arc([s])[0]
            is_there = (begin <= time + 1e-6) & (time - 1e-6 <= end)
            apart = np.hypot(x - place[0], y - place[1])[is_there]
            assert apart.size
            assert apart.max() <= 0.16


def wished(plan, courses, robots, **changes):
    """R1 is wanted on the other side of R2, which comes towards it on the straight line."""
    mine = courses[0]
    robot = replace(robots[0], start=mine.goal, goal=(9.0, 4.0), **changes)
    begin = math.ceil(1000.0 * mine.driven.timeline.finish) + 200
    return Site(HALL, plan.document), Wish(robot, 0.0, 0, 1, begin)


def test_a_robot_gives_way_aside_where_waiting_takes_longer(monkeypatch):
    plan, courses = courses_of(HALL)
    site, wish = wished(plan, courses, HALL.robots)
    bent = propose(site, wish, courses[1:])
    assert_keeps_apart(bent, courses[1:], site.terms.tau, site.terms.margin)
    monkeypatch.setattr(Bends, "path", lambda *_: None)
    monkeypatch.setattr(earliest_course, "_DETOURS", 0)
    waits = propose(site, wish, courses[1:])
    times = [one.course.driven.timeline.finish for one in (bent, waits)]
    assert times[0] < times[1] - 2.0
    assert bent.course.driven.curve.length > waits.course.driven.curve.length


HEAVY = [(5, 0)] if are_whole() else []
"""It takes a minute and more."""


@pytest.mark.parametrize(("seed", "index"), [(3, 11), (6, 5), *HEAVY])
def test_between_rooms_a_robot_arrives_earlier_on_a_finer_mesh(monkeypatch, seed, index):
    floor = generate("rooms", 24, seed)
    plan, others = courses_of(floor)
    del others[index]
    site, wish = Site(floor, plan.document), Wish(floor.robots[index], 0.0, 0, 1, 200)
    pitches, times = among_courses.PITCHES, []
    for used in (pitches, pitches[:1], ()):
        monkeypatch.setattr(among_courses, "PITCHES", used)
        found = propose(site, wish, others)
        assert_keeps_apart(found, others, site.terms.tau, site.terms.margin)
        times.append(found.course.driven.timeline.finish)
    assert times[0] < times[1] - 5.0
    assert times[1] <= times[2]


def test_no_mesh_is_searched_twice_where_a_floor_is_too_large_for_fine_ones():
    small, large = generate("rooms", 24, 1), generate("open", 1000, 1)
    assert pitches_of(small, small.robots[0]) == list(among_courses.PITCHES)
    assert pitches_of(large, large.robots[0]) == list(among_courses.PITCHES[:1])


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_is_left_out_of_a_course_cannot_be_met_at_any_time(seed):
    scenario = generate("open", 8, seed)
    _, (_, *others) = courses_of(scenario)
    robot, tau, reach = scenario.robots[0], 0.6, scenario.robots[0].radius + 0.05
    leaves, latest, delay = 4.0, 25.0, 1.5
    errand = errand_of(robot, leaves, latest, 0.5)
    left_out = 0
    for course in others:
        stretch = stretch_of(course, errand, reach, tau, delay)
        begin, end = stretch or (math.inf, math.inf)
        line, curve = course.driven.timeline, course.driven.curve
        need = reach + course.driven.radius
        for time in np.arange(0.0, line.finish + 5.0, 0.05):
            s = line.s_at(time)
            if begin - 1e-4 <= s <= end + 1e-4:
                continue
            left_out += 1
            (place,) = curve.at_arc([s])
            from_start, to_goal = (math.dist(place, at[:2]) for at in (robot.start, robot.goal))
            for met in np.linspace(max(time - tau, leaves), time + delay + tau, 12):
                in_reach = from_start < 0.5 * (met - leaves) + need
                assert not (in_reach and to_goal < 0.5 * max(latest - met, 0.0) + need)
    assert left_out > 100


@pytest.mark.parametrize(("floor", "seed"), [("open", 1), ("warehouse", 2)])
def test_a_course_is_as_early_as_if_all_of_the_others_courses_counted(monkeypatch, floor, seed):
    scenario = generate(floor, 12, seed)
    plan, (mine, *others) = courses_of(scenario)
    robot = replace(scenario.robots[0], start=mine.goal, goal=scenario.robots[0].start[:2])
    begin = math.ceil(1000.0 * mine.driven.timeline.finish) // 2
    site = Site(scenario, plan.document)
    wish = Wish(robot, 0.0, 0, 1, begin)
    found = propose(site, wish, others).course.driven.timeline.finish
    monkeypatch.setattr(courses_met, "part_met", lambda samples, *_: (0, len(samples)))
    assert found == pytest.approx(propose(site, wish, others).course.driven.timeline.finish)
