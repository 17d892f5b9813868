"""Passing lanes beside another robot's path."""

from coordinator.paths.path_planner import Pathfinder
from coordinator.schedule.detours import lanes
from tests.scenarios import a_robot, a_scenario


def test_lanes_of_more_places_than_asked_for_are_left_out():
    robots = [a_robot("A", (1, 4), (199, 4)), a_robot("B", (199, 2), (1, 2))]
    scenario = a_scenario(robots, (200.0, 8.0))
    path = Pathfinder(scenario).path(1)
    counts = [len(places) for places in lanes(scenario, 0, 1, path, 10_000)]
    assert len(counts) == 6
    assert counts[0] == max(counts)
    assert [len(p) for p in lanes(scenario, 0, 1, path, counts[0] - 1)] == counts[1:]
    assert list(lanes(scenario, 0, 1, path, 100)) == []
