"""Refusals are true: what a planner refuses, no exhaustive search of all places can do."""

import pytest
from msgspec.structs import replace

from benchmarks.joint_search import Found, search
from benchmarks.refusals import measure, scene
from coordinator.scenario.model import Workspace
from tests.floors import box
from tests.sweeps import seeds

LANE = box(0, 0, 4, 0.6)


def swap(boundary, obstacles=()):
    """Return two robots of 0.2 m that exchange places at both ends of a lane."""
    made = scene(2, 0)
    left, right = (0.4, 0.3), (3.6, 0.3)
    robots = [
        replace(one, radius=0.2, start=start, goal=goal)
        for one, start, goal in zip(made.robots, (left, right), (right, left), strict=True)
    ]
    floor = Workspace(boundary=boundary, obstacles=tuple(obstacles))
    return replace(made, workspace=floor, robots=tuple(robots))


def test_the_search_finds_that_two_robots_exchange_places_only_where_there_is_a_bay():
    bay = [(0, 0), (4, 0), (4, 0.6), (2.3, 0.6), (2.3, 1.2), (1.7, 1.2), (1.7, 0.6), (0, 0.6)]
    assert search(swap(LANE)) == Found.NOTHING
    assert search(swap(tuple(bay))) == Found.SOLVED
    assert search(swap(tuple(bay), [box(1.9, 0.7, 2.1, 0.9)])) == Found.NOTHING


@pytest.mark.parametrize("number", seeds(120))
def test_no_scene_is_refused_that_the_search_solves(number):
    tried = measure(number)
    assert tried.possible != Found.SOLVED.value
    assert (tried.possible == "") == (tried.answer != "blocked")
