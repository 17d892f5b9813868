"""Which places close a way, on floors where that is plain to see."""

from msgspec.structs import replace

from coordinator.planning.floor_check import closed_ways
from coordinator.scenario.model import Demand
from tests.scenarios import a_robot, a_scenario, box

WALLS = (box(4.0, 0.0, 6.0, 3.5), box(4.0, 4.5, 6.0, 8.0))
"""A corridor along x, a metre wide, between two rooms."""


def test_a_robot_that_rests_in_a_corridor_closes_the_way_between_the_rooms():
    robots = [a_robot("R1", (1.0, 1.0), (9.0, 7.0)), a_robot("R2", (1.0, 7.0), (5.0, 4.0))]
    (closed,) = closed_ways(a_scenario(robots, obstacles=WALLS))
    assert (closed.name, closed.place) == ("R2's goal", (5.0, 4.0))
    assert {closed.one, closed.other} == {"R1's start", "R1's goal"}


def test_robots_that_rest_in_the_rooms_close_nothing():
    robots = [a_robot("R1", (1.0, 1.0), (9.0, 7.0)), a_robot("R2", (1.0, 7.0), (9.0, 1.0))]
    assert closed_ways(a_scenario(robots, obstacles=WALLS)) == []


def test_places_of_demand_and_homes_count():
    robots = [a_robot("R1", (1.0, 1.0), (9.0, 7.0), home=(4.3, 4.0))]
    scenario = a_scenario(robots, obstacles=WALLS)
    assert [one.name for one in closed_ways(scenario)] == ["R1's home"]
    demand = Demand(places=((5.5, 4.0), (2.0, 5.0)))
    found = closed_ways(replace(scenario, demand=demand))
    assert [one.name for one in found] == ["R1's home", "demand.places[0]"]


def test_rooms_that_are_apart_anyway_are_no_matter():
    shut = (*WALLS, box(4.0, 3.0, 6.0, 5.0))
    robots = [a_robot("R1", (1.0, 1.0), (3.0, 7.0)), a_robot("R2", (9.0, 1.0), (9.0, 6.0))]
    assert closed_ways(a_scenario(robots, obstacles=shut)) == []
