"""Who slows down or goes aside for whom, on plans that are made by hand and by the planner."""

import pytest
from msgspec.structs import replace

from coordinator.findings.giving_way import ASIDE, BEFORE, BEHIND, SLOWS, giving_way
from coordinator.motion.slowing import Slow, slowed
from coordinator.motion.velocity_profile import Motion, Wait, limits_on
from coordinator.paths.path_planner import Pathfinder
from coordinator.plan.drafting import draft_plan
from coordinator.plan.shares_of_tau import BRAKING_SHARE
from coordinator.plan.wire import drive
from coordinator.planning.planner import plan_scenario
from coordinator.scenario.model import Robot, Scenario, Workspace
from sim.floors.generator import generate

TAU = 1.0


def crossing():
    """Return two robots whose straight ways cross after 5 m at a right angle."""
    limits = {"radius": 0.2, "max_speed": 1.0, "max_accel": 1.0, "max_lateral_accel": 1.0}
    robots = (
        Robot(id="R1", start=(1.0, 6.0), goal=(11.0, 6.0), **limits),
        Robot(id="R2", start=(6.0, 1.0), goal=(6.0, 11.0), **limits),
    )
    corners = ((0.0, 0.0), (12.0, 0.0), (12.0, 12.0), (0.0, 12.0))
    floor = Workspace(boundary=corners, obstacles=())
    return Scenario(name="x", workspace=floor, robots=robots, tau=TAU)


def drafted(scenario, points, slow=(), leaves=0.0):
    """Return a plan in which R1 drives over points, slowly on stretches, and R2 straight on."""
    finder = Pathfinder(scenario)
    shortest = [finder.path(index) for index in range(2)]
    paths = list(shortest)
    if points:
        via = replace(scenario.robots[0], via=tuple(points))
        others = replace(scenario, robots=(via, scenario.robots[1]))
        paths[0] = Pathfinder(others).path(0)
    motions = []
    for path, robot, parts, start in zip(
        paths, scenario.robots, (slow, ()), (0.0, leaves), strict=True
    ):
        speed = scenario.planned_speed(robot)
        limits = limits_on(path, speed, BRAKING_SHARE * robot.max_accel, robot.max_lateral_accel)
        motions.append(Motion(slowed(limits, parts), [Wait(0.0, start, -1)] if start else []))
    drafted = draft_plan(scenario, paths, motions, TAU, 1, [], shortest=shortest)
    return drafted.document


def test_a_robot_that_drives_slowly_up_to_another_ones_path_slows_for_it():
    (found,) = giving_way(drafted(crossing(), [], [Slow(0.5, 4.0, 0.6)]))
    assert (found.robot, found.how, found.other) == ("R1", SLOWS, "R2")
    assert found.on == pytest.approx((0.5, 4.0), abs=0.6)
    assert found.lost == pytest.approx(3.5 / 0.6 - 3.5 / 0.95, abs=0.5)
    assert found.since < 1.5
    assert found.until == pytest.approx(found.since + 3.5 / 0.6, abs=1.5)


def test_a_robot_that_drives_slowly_where_nobody_is_has_no_reason():
    assert giving_way(drafted(crossing(), [], [Slow(6.5, 9.0, 0.5)])) == []


def test_a_robot_at_its_limits_slows_for_nobody():
    assert giving_way(drafted(crossing(), [], leaves=9.0)) == []


def test_a_bend_across_the_path_of_a_robot_that_has_passed_leads_behind_it():
    found = giving_way(drafted(crossing(), [(6.0, 3.0)]))
    assert [(one.robot, one.how, one.other) for one in found] == [("R1", BEHIND, "R2")]
    assert found[0].on[0] < 2.0
    assert found[0].on[1] < 8.0, "only until it has passed the other one's path"


def test_a_bend_across_the_path_of_a_robot_that_comes_later_leads_before_it():
    found = giving_way(drafted(crossing(), [(6.0, 9.0)], leaves=0.5))
    assert [(one.robot, one.how, one.other) for one in found] == [("R1", BEFORE, "R2")]


def test_a_robot_that_leaves_room_for_one_which_comes_towards_it_gives_way_aside():
    scenario = crossing()
    first, second = scenario.robots
    second = replace(second, start=(10.5, 7.0), via=((6.0, 6.0),), goal=(1.5, 7.0))
    found = giving_way(drafted(replace(scenario, robots=(first, second)), [(6.0, 5.0)]))
    assert [(one.robot, one.how, one.other) for one in found] == [("R1", ASIDE, "R2")]


def test_a_detour_on_which_nobody_would_have_been_met_has_no_reason():
    assert giving_way(drafted(crossing(), [(3.0, 9.0)], leaves=30.0)) == []


def test_in_a_fleet_that_is_planned_in_space_and_time_robots_on_other_ways_have_reasons():
    document = plan_scenario(generate("open", 20, 1), effort=8)
    bent = {robot.id for robot in document.robots if robot.shortest is not None}
    found = giving_way(document)
    told = {one.robot for one in found if one.how != SLOWS}
    assert bent
    assert told <= bent
    assert len(told) >= 0.7 * len(bent)
    for one in found:
        line = drive(document)[[robot.id for robot in document.robots].index(one.robot)].timeline
        assert one.since < one.until <= line.finish + 1e-6
        assert line.s_at(one.since) == pytest.approx(one.on[0], abs=0.1)
        assert line.s_at(one.until) == pytest.approx(one.on[1], abs=0.1)
