"""Why no order of two robots works is told as it is."""

import pytest

from coordinator.paths.path_planner import Pathfinder
from coordinator.planning.planner import _Stages
from coordinator.schedule.detours import lanes
from coordinator.schedule.refusals import pair_error
from tests.scenarios import a_robot, a_scenario


def said_of(*robots, size=(10.0, 8.0), **how):
    scenario = a_scenario(robots, size)
    stages = _Stages(scenario, 0.5, None)
    stages.find_paths()
    stages.find_zones()
    error = pair_error(scenario, stages.junctions, (0, 1), **how)
    assert error.blames in {robot.id for robot in robots}
    return str(error)


def test_facts_that_ask_for_one_order_are_no_reason_against_both():
    robots = [a_robot("A", (1, 0.5), (6, 0.5)), a_robot("B", (3, 0.5), (9, 0.5))]
    said = said_of(*robots, size=(10.0, 1.0))
    assert "whoever goes first" not in said
    assert said.startswith("no order was found in which A and B both arrive: ")
    assert "B's start (3.00, 0.50) lies on A's way" in said
    assert "A's goal (6.00, 0.50) lies on B's way" in said


def test_robots_without_places_on_each_others_ways_are_said_to_come_near():
    said = said_of(a_robot("A", (1, 4), (9, 4)), a_robot("B", (5, 1), (5, 7)))
    assert "whoever goes first" not in said
    assert "A and B come near each other on their ways" in said


@pytest.mark.parametrize("names", ["AB", "BA"])
def test_facts_that_ask_for_both_orders_are_told_as_such(names):
    robots = [a_robot("A", (1, 4), (9, 4)), a_robot("B", (9, 4), (1, 4))]
    said = said_of(*sorted(robots, key=lambda robot: names.index(robot.id)))
    assert "block each other whoever goes first" in said
    assert "A's start (1.00, 4.00) lies on B's way" in said
    assert "B's start (9.00, 4.00) lies on A's way" in said


def test_what_two_robots_could_do_alone_is_not_said_to_be_impossible():
    robots = [a_robot("A", (1, 4), (9, 4)), a_robot("B", (9, 4), (1, 4))]
    said = said_of(*robots, among_others=True)
    assert said.startswith("no order was found in which A and B both arrive among all others: ")


def test_lanes_of_more_places_than_asked_for_are_left_out():
    robots = [a_robot("A", (1, 4), (199, 4)), a_robot("B", (199, 2), (1, 2))]
    scenario = a_scenario(robots, (200.0, 8.0))
    path = Pathfinder(scenario).path(1)
    counts = [len(places) for places in lanes(scenario, 0, 1, path, 10_000)]
    assert len(counts) == 6
    assert counts[0] == max(counts)
    assert [len(p) for p in lanes(scenario, 0, 1, path, counts[0] - 1)] == counts[1:]
    assert list(lanes(scenario, 0, 1, path, 100)) == []
