"""A new course for one robot among the courses of all others, held against dense sampling."""

import dataclasses
import math
import random

import numpy as np
import pytest
from msgspec.structs import replace

from coordinator.base.errors import PlanError
from coordinator.plan.capacity import Capacity
from coordinator.plan.course import Course
from coordinator.plan.document import Limits
from coordinator.planning.course_proposal import Proposal, among_further, proposal_of, propose
from coordinator.planning.course_search import search
from coordinator.planning.planner import plan_fleet
from coordinator.planning.wish import Site, Wish
from coordinator.proof.course_proof import course_failures
from coordinator.schedule.staircase_making import staircases_of
from sim.floors.generator import generate
from tests.scenarios import a_robot, a_scenario, box

STEP = 0.02


def a_site(scenario):
    """A site, the courses of its plan by robot, and the robots."""
    plan = plan_fleet(scenario, effort=0)
    courses = {one.id: Course(one, 0.0) for one in plan.driven}
    return Site(scenario, plan.document), courses, {one.id: one for one in scenario.robots}


def sent_on(site, courses, robots, name, goal, revision=1):
    """Let a robot that has arrived go to another goal; the others keep their courses."""
    wish = a_wish(courses, robots, name, goal, revision)
    return propose(site, wish, [one for other, one in courses.items() if other != name])


def a_wish(courses, robots, name, goal, revision=1):
    line, curve = courses[name].driven.timeline, courses[name].driven.curve
    _, ahead = curve.derivatives([curve.knots[-1]], 1)
    return Wish(
        replace(robots[name], start=courses[name].goal, goal=goal, via=()),
        math.atan2(ahead[0, 1], ahead[0, 0]),
        list(courses).index(name),
        revision,
        math.ceil(1000.0 * line.finish) + 300,
    )


def places(course, times):
    s = [course.driven.timeline.s_at(t) for t in times.tolist()]
    return course.driven.curve.at_arc(np.array(s))


def assert_keeps_apart(found: Proposal, others, tau, margin):
    """Sample the courses at all times no more than tau apart, from the course's beginning on."""
    end = max(one.driven.timeline.finish for one in (found.course, *others)) + 1.0
    mine = np.arange(found.course.since, end, STEP)
    for other in others:
        his = np.arange(max(found.course.since - tau, 0.0), end, STEP)
        gap = places(found.course, mine)[:, None] - places(other, his)
        apart = np.hypot(gap[..., 0], gap[..., 1])
        apart[np.abs(mine[:, None] - his) > tau] = np.inf
        need = found.course.driven.radius + other.driven.radius + margin
        assert apart.min() >= need - 1e-3


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_robots_that_have_arrived_are_sent_on_and_on_while_the_others_drive(seed):
    scenario = generate("open", 6, seed)
    site, courses, robots = a_site(scenario)
    starts = {robot.id: robot.start[:2] for robot in scenario.robots}
    for name in sorted(courses, key=lambda name: courses[name].driven.timeline.finish):
        found = sent_on(site, courses, robots, name, starts[name])
        others = [one for other, one in courses.items() if other != name]
        assert_keeps_apart(found, others, site.terms.tau, site.terms.margin)
        assert found.course.goal == pytest.approx(starts[name], abs=1e-5)
        assert found.course.driven.plan.begin_ms == round(1000.0 * found.course.since)
        assert found.course.driven.plan.revision == 1
        courses[name] = found.course


def stairs_by_course(proposal):
    """Return the knots of each staircase by the courses that it is between."""
    courses, found = [proposal.course, *proposal.near], proposal.staircases
    pairs = zip(found.ahead.tolist(), found.behind.tolist(), strict=True)
    return {
        (courses[ahead].driven.id, courses[behind].driven.id): found.knots_of(k).tolist()
        for k, (ahead, behind) in enumerate(pairs)
    }


@pytest.mark.parametrize("seed", range(1, 5))
def test_a_course_counts_further_courses_as_if_it_had_been_looked_for_among_all(seed):
    scenario = generate("open", 8, seed)
    site, courses, robots = a_site(scenario)
    verdicts = set()
    for name in robots:
        others = [one for other, one in courses.items() if other != name]
        goal = robots[name].start[:2]
        for known in (others[:2], others[:5], others):
            further = [one for one in others if one not in known]
            wish = a_wish(courses, robots, name, goal)
            found = propose(site, wish, known)
            whole = among_further(found, further, site.terms)
            judged = proposal_of(found.message, site, wish, others)
            failures = course_failures(
                [judged.course, *judged.near],
                judged.staircases,
                site.terms.margin,
                Limits.of(robots[name]),
                site.gap,
            )
            verdicts.add(whole is None)
            assert (whole is None) == bool(failures)
            if whole is not None:
                assert whole.message == found.message
                assert stairs_by_course(whole) == stairs_by_course(judged)
                assert_keeps_apart(whole, others, site.terms.tau, site.terms.margin)
    assert verdicts == {False, True}


@pytest.mark.parametrize("goal", [(2.0, 4.0), (2.65, 4.35), (2.78, 4.42), (3.69, 4.91)])
def test_a_robot_finds_no_way_to_a_place_where_another_one_rests_for_ever(goal):
    """In float32 the motions to most of these are longer by some 1e-8 m than the curves."""
    robots = [a_robot("R1", (1.0, 4.0), goal), a_robot("R2", (5.0, 1.0), (5.0, 7.0))]
    site, courses, robots = a_site(a_scenario(robots))
    with pytest.raises(PlanError, match="has no way among the others, whenever it sets out"):
        sent_on(site, courses, robots, "R2", goal)


def test_where_another_one_went_before_it_arrived_is_in_nobodys_way():
    """R2 was held on the way that R1 has taken since; its new course begins when it was held."""
    site, courses, _ = a_site(a_scenario([a_robot("R1", (1.0, 4.0), (9.0, 4.0))]))
    passed, r2 = courses["R1"], a_robot("R2", (5.0, 4.0), (5.0, 7.0))
    finish_ms = math.ceil(1000.0 * passed.driven.timeline.finish)
    wish = Wish(r2, 0.0, 1, 1, 0, delay=0.001 * finish_ms)
    assert passed.arrived(None) is passed.arrived(finish_ms - 2) is passed
    with pytest.raises(PlanError, match="has no way among the others, whenever it sets out"):
        propose(site, wish, [passed])
    found = propose(site, wish, [passed.arrived(finish_ms)])
    assert found.course.goal == pytest.approx((5.0, 7.0), abs=1e-5)
    assert len(found.staircases.ahead) == 0
    with pytest.raises(PlanError):  # R1 stands there.
        propose(site, wish.to((8.9, 4.1)), [passed.arrived(finish_ms)])


def test_a_robot_waits_at_its_place_for_one_that_is_under_way_across_its_course():
    scenario = a_scenario(
        [a_robot("R1", (1.0, 4.0), (2.0, 4.0)), a_robot("R2", (5.0, 1.0), (5.0, 7.0))], tau=0.6
    )
    site, courses, robots = a_site(scenario)
    found = sent_on(site, courses, robots, "R1", (9.0, 4.0))
    assert [one.driven.id for one in found.near] == ["R2"]
    assert_keeps_apart(found, [courses["R2"]], site.terms.tau, site.terms.margin)
    alone = sent_on(site, {"R1": courses["R1"]}, robots, "R1", (9.0, 4.0))
    assert alone.near == []
    assert found.course.driven.timeline.finish >= alone.course.driven.timeline.finish


def test_a_robot_may_rest_where_another_one_has_left_and_is_sent_on_from_there():
    scenario = a_scenario(
        [a_robot("R1", (1.0, 4.0), (3.0, 4.0)), a_robot("R2", (8.0, 4.0), (8.0, 1.0))], tau=0.6
    )
    site, courses, robots = a_site(scenario)
    for revision, goal in enumerate(((8.0, 4.0), (8.0, 6.5)), start=1):
        found = sent_on(site, courses, robots, "R1", goal, revision)
        assert_keeps_apart(found, [courses["R2"]], site.terms.tau, site.terms.margin)
        courses["R1"] = found.course
    assert found.course.goal == pytest.approx((8.0, 6.5), abs=1e-5)


def test_a_robot_gets_time_to_turn_towards_its_course():
    scenario = a_scenario([a_robot("R1", (1.0, 4.0), (2.0, 4.0))], tau=0.6)
    site, courses, robots = a_site(scenario)
    times = {}
    for goal in ((3.0, 4.0), (1.0, 4.0)):
        found = sent_on(site, courses, robots, "R1", goal)
        times[goal] = float(found.course.driven.timeline.t0[0]) - found.course.since
    assert times[3.0, 4.0] < 0.05
    assert times[1.0, 4.0] >= math.pi / robots["R1"].max_turn_rate


def test_where_another_one_rests_for_good_there_is_no_course_to():
    scenario = a_scenario(
        [a_robot("R1", (1.0, 4.0), (2.0, 4.0)), a_robot("R2", (8.0, 1.0), (8.0, 6.0))], tau=0.6
    )
    site, courses, robots = a_site(scenario)
    with pytest.raises(PlanError) as caught:
        sent_on(site, courses, robots, "R1", (8.0, 5.9))
    assert caught.value.robot == "R1"


def through_a_wall(*gaps):
    """R1 is to go through a wall with gaps [m]; R2 rests in the last one.

    If there are two, R3 will rest in the first one.
    """
    edges = [0.0, *(edge for gap in gaps for edge in gap), 4.0]
    walls = [box(2.9, low, 3.1, high) for low, high in zip(edges[::2], edges[1::2], strict=True)]
    robots = [
        a_robot("R1", (1.0, 2.0), (1.1, 2.0)),
        a_robot("R2", (3.1, 2.0), (3.0, 2.0)),
        a_robot("R3", (5.6, 3.6), (3.0 if gaps[1:] else 5.6, 0.6), max_speed=0.06, max_accel=1.0),
    ]
    site, courses, robots = a_site(a_scenario(robots, (6.0, 4.0), walls, margin=0.05, tau=0.6))
    assert courses["R3"].driven.timeline.finish > 40.0
    courses |= {name: courses[name].arrived(20_000) for name in ("R1", "R2")}
    wish = dataclasses.replace(a_wish(courses, robots, "R1", (5.0, 2.0)), begin_ms=20_000)
    return search(site, wish, [courses["R2"], courses["R3"]]), site, courses


def test_a_robot_goes_where_another_one_will_rest_rather_than_through_one_that_rests():
    found, site, courses = through_a_wall((0.3, 0.9), (1.7, 2.3))
    finish = found.proposal.course.driven.timeline.finish
    assert finish < courses["R3"].driven.timeline.finish - site.terms.tau
    others = [courses["R2"], courses["R3"]]
    assert_keeps_apart(found.proposal, others, site.terms.tau, site.terms.margin)


def test_a_robot_is_told_who_rests_in_the_only_way():
    found, *_ = through_a_wall((1.7, 2.3))
    assert (found.proposal, found.blockers) == (None, ("R2",))
    assert found.reason == "has no way past robots that are parked"


def test_a_course_that_comes_too_near_another_one_is_found_by_its_proof():
    scenario = a_scenario(
        [a_robot("R1", (1.0, 4.0), (2.0, 4.0)), a_robot("R2", (5.0, 1.0), (5.0, 7.0))], tau=0.6
    )
    site, courses, robots = a_site(scenario)
    found = sent_on(site, {"R1": courses["R1"]}, robots, "R1", (9.0, 4.0))
    late = sent_on(site, courses, robots, "R2", (5.0, 1.2), revision=3)
    limits, terms = Limits.of(robots["R1"]), site.terms
    arguments = (found.staircases, terms.margin, limits, site.gap)
    assert course_failures([found.course], *arguments) == []
    assert course_failures([found.course, late.course], *arguments) != []
    for since, until in ((1e5, math.inf), (0.0, 0.1)):
        elsewhere = Course(late.course.driven, since, until)
        assert course_failures([found.course, elsewhere], *arguments) == []


def test_a_late_robot_is_not_proven_through_one_that_stands_where_its_course_begins_later():
    """R2 is known to drive a course that begins at 95 s; R1 is so late that it goes on at 80 s."""
    robots = [a_robot("R1", (1.0, 3.0), (2.0, 3.0)), a_robot("R2", (4.0, 3.0), (5.0, 3.0))]
    site, courses, known = a_site(a_scenario(robots))

    def wish(name, goal, begin_ms):
        robot = replace(known[name], start=courses[name].goal, goal=goal, via=())
        return Wish(robot, 0.0, 8, 1, begin_ms)

    leaves = propose(site, wish("R2", (5.0, 6.0), 95_000), []).course.begun()
    through = propose(site, wish("R1", (8.0, 3.0), 80_000), []).course
    terms, limits = site.terms, Limits.of(known["R1"])
    both = [through, leaves]
    driven, since = [one.driven for one in both], [one.since for one in both]
    staircases = staircases_of(driven, terms.tau, terms.margin, (0,), since)
    assert course_failures(both, staircases, terms.margin, limits, site.gap)
    late = propose(site, wish("R1", (8.0, 3.0), 80_000), [leaves]).course
    times = np.arange(80.0, 130.0, STEP)
    assert np.hypot(*(places(late, times) - places(leaves, times)).T).min() >= 0.45


@pytest.mark.parametrize("late", [0.0, 12.0])
def test_a_robot_goes_behind_a_late_one_as_late_as_that_is(late):
    robots = [a_robot("R1", (5.0, 1.0), (5.0, 2.0)), a_robot("R2", (1.0, 4.0), (9.0, 4.0))]
    site, courses, known = a_site(a_scenario(robots))
    robot = replace(known["R1"], start=courses["R1"].goal, goal=(5.0, 6.0), via=())
    begin_ms = math.ceil(1000.0 * courses["R1"].driven.timeline.finish) + 300
    wish = Wish(robot, math.pi / 2, 8, 1, begin_ms, late={"R2": late} if late else {})
    found = propose(site, wish, [courses["R2"]])
    assert_keeps_apart(found, [courses["R2"]], site.terms.tau, site.terms.margin)
    mine, his = found.course.driven.timeline, courses["R2"].driven.timeline
    times = np.arange(0.0, mine.finish, STEP)
    late_places = places(courses["R2"], np.maximum(times - late, 0.0))
    apart = np.hypot(*(places(found.course, times) - late_places).T)
    assert apart[times >= begin_ms / 1000.0].min() >= 0.4
    assert (mine.finish < his.finish) == (late == 0.0)


def test_a_robot_that_finds_no_way_behind_a_late_one_is_planned_as_if_that_were_on_time():
    robots = [a_robot("R1", (1.0, 1.0), (1.0, 2.0)), a_robot("R2", (1.0, 4.0), (9.0, 4.0))]
    site, courses, known = a_site(a_scenario(robots))
    line = courses["R1"].driven.timeline
    robot = replace(known["R1"], start=courses["R1"].goal, goal=(1.0, 3.5), via=())
    wish = Wish(robot, math.pi / 2, 8, 1, math.ceil(1000.0 * line.finish) + 300)
    on_time = propose(site, wish, [courses["R2"]]).course.driven.timeline.finish
    never = propose(site, dataclasses.replace(wish, late={"R2": 1e6}), [courses["R2"]])
    assert never.course.driven.timeline.finish < on_time + 1.0


def test_a_robot_in_whose_way_another_one_comes_moves_aside():
    """Neither at its start nor on its shortest path could it wait for the other one to pass."""
    robots = [a_robot("A", (3.0, 1.0), (9.0, 1.0)), a_robot("B", (9.5, 4.0), (0.5, 4.0))]
    site, courses, robots = a_site(a_scenario(robots))
    stopped = replace(robots["A"], start=(3.0, 4.0), goal=(8.0, 4.0))
    found = propose(site, Wish(stopped, 0.0, 0, 1, 1_000), [courses["B"]])
    assert_keeps_apart(found, [courses["B"]], site.terms.tau, site.terms.margin)
    assert np.abs(found.course.driven.chain.points[:, 1] - 4.0).max() > 0.3


def test_a_robot_gets_a_course_that_it_can_hold_or_is_told_what_it_cannot():
    scenario = generate("rooms", 24, 6)
    site, courses, robots = a_site(scenario)
    others = [one for name, one in courses.items() if name != "R6"]
    wish = Wish(robots["R6"], 0.0, 0, 1, 200)
    free = propose(site, wish, others).course.driven
    small = Capacity(points=len(free.curve.points) - 1)
    fits = propose(site, dataclasses.replace(wish, holds=small), others)
    assert len(fits.course.driven.curve.points) <= small.points
    assert_keeps_apart(fits, others, site.terms.tau, site.terms.margin)
    with pytest.raises(PlanError, match="R6: cannot hold its path"):
        propose(site, dataclasses.replace(wish, holds=Capacity(points=4)), others)
    with pytest.raises(PlanError, match=r"cannot hold its course: \d+ bytes, it holds 100"):
        propose(site, dataclasses.replace(wish, holds=Capacity(size=100)), others)


def test_a_way_past_too_many_places_to_be_sent_is_refused_with_what_would_help():
    site, courses, robots = a_site(a_scenario([a_robot("R1", (1.0, 4.0), (2.0, 4.0))]))
    wish = a_wish(courses, robots, "R1", (9.0, 4.0))
    places = random.Random(2)
    via = tuple((places.uniform(1.0, 9.0), places.uniform(1.0, 7.0)) for _ in range(50))
    found = search(site, dataclasses.replace(wish, robot=replace(wish.robot, via=via)), [])
    assert found.proposal is None
    assert found.reason.startswith("has a way that cannot be sent: arc length along the curve is")
    assert found.reason.endswith("; fewer places to pass would help")
