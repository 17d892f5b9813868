"""Whole fleets on ways in space and time, judged by their curves and motions, densely sampled."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest
import shapely
from msgspec.structs import replace
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from coordinator.bends.flow_search import FlowSearch
from coordinator.bends.mesh_kernels import MOVES, OPEN, distances
from coordinator.bends.meshes import NARROW, WIDE, Meshes
from coordinator.curves.chords import chords_of
from coordinator.motion.velocity_profile import Motion, Wait, limits_on
from coordinator.paths.path_planner import Pathfinder, find_paths
from coordinator.scenario.model import Robot, Scenario, Workspace
from coordinator.schedule.given_motions import meeting
from coordinator.schedule.junctions import Junctions
from coordinator.schedule.timetable import Motions
from coordinator.schedule.track import Track
from sim.floors.generator import generate

TAU = 1.0


def robot(name, start, goal, **more):
    limits = {"max_speed": 0.8, "max_accel": 0.8, "max_lateral_accel": 0.8, "radius": 0.2}
    return Robot(id=name, start=start, goal=goal, **limits, **more)


def floor(robots, walls=(), side=10.0):
    corners = ((0.0, 0.0), (side, 0.0), (side, side), (0.0, side))
    return Scenario(
        name="flow",
        workspace=Workspace(boundary=corners, obstacles=walls),
        robots=tuple(robots),
        tau=TAU,
    )


def searched(scenario, rounds=0):
    finder = Pathfinder(scenario)

    def track_of(index, path):
        one = scenario.robots[index]
        speed = scenario.planned_speed(one)
        return Track(
            limits_on(path, speed, 0.8 * one.max_accel, one.max_lateral_accel),
            chords_of(path, 1e-3),
        )

    paths = find_paths(finder)
    tracks = [track_of(index, path) for index, path in enumerate(paths)]
    search = FlowSearch(finder, paths, tracks, track_of, TAU)
    return search, search.run(rounds)


def places_of(course, times):
    """Return where a robot is at times (n,) [s]."""
    s = np.array([course.motion.place_at(time) for time in times])
    return course.path.at_arc(s)


def least_apart(one, other, tau):
    """Return the least distance of two robots of which each is at most tau [s] early or late."""
    times = np.arange(0.0, max(one.motion.finish, other.motion.finish) + tau, 0.05)
    places, steps = places_of(other, times), round(tau / 0.05)
    apart = math.inf
    for shift in range(-steps, steps + 1):
        at = np.clip(np.arange(len(times)) + shift, 0, len(times) - 1)
        gaps = np.hypot(*(places_of(one, times) - places[at]).T)
        apart = min(apart, float(gaps.min()))
    return apart


def keeps_clear(scenario, courses):
    for one, other in combinations(range(len(courses)), 2):
        need = scenario.need(scenario.robots[one], scenario.robots[other])
        assert least_apart(courses[one], courses[other], TAU) > need - 0.002, (one, other)


def test_of_two_robots_head_on_one_gives_way_aside_and_nobody_rests():
    scenario = floor([robot("A", (1.0, 5.0), (9.0, 5.0)), robot("B", (9.0, 5.05), (1.0, 5.05))])
    search, courses = searched(scenario)
    assert not any(course.motion.waits for course in courses)
    assert max(course.motion.finish for course in courses) < max(search.alone) + 1.0
    keeps_clear(scenario, courses)


def test_robots_of_higher_priority_keep_their_ways():
    robots = [
        robot("A", (1.0, 5.0), (9.0, 5.0)),
        robot("B", (9.0, 5.0), (1.5, 5.5), priority=2),
        robot("C", (5.0, 1.0), (5.0, 9.0), priority=1),
    ]
    search, courses = searched(floor(robots))
    assert courses[1].motion.finish == pytest.approx(search.alone[1])
    keeps_clear(floor(robots), courses)


def test_robots_with_headings_and_via_points_keep_their_paths_and_wait_at_their_starts():
    robots = [
        robot("A", (1.0, 5.0, 0.0), (9.0, 5.0)),
        robot("B", (5.0, 1.0), (5.0, 9.0), via=((5.2, 4.0),)),
    ]
    scenario = floor(robots)
    _, courses = searched(scenario)
    assert sorted(len(course.motion.waits) for course in courses) == [0, 1]
    keeps_clear(scenario, courses)


@pytest.mark.parametrize(("kind", "seed"), [("open", 1), ("warehouse", 2), ("rooms", 3)])
def test_no_two_robots_of_a_fleet_come_too_near(kind, seed):
    scenario = replace(generate(kind, 12, seed), tau=TAU)
    search, courses = searched(scenario, 5)
    keeps_clear(scenario, courses)
    assert search.alone[0] <= courses[0].motion.finish + 1e-6


@pytest.mark.parametrize("rounds", [0, 12])
def test_the_same_fleet_gets_the_same_ways(rounds):
    scenario = replace(generate("open", 12, 4), tau=TAU)
    ones, others = (searched(scenario, rounds)[1] for _ in range(2))
    for one, other in zip(ones, others, strict=True):
        assert one.path == other.path or np.array_equal(one.path.points, other.path.points)
        assert one.motion.finish == other.motion.finish


def test_rounds_never_make_the_sum_of_arrivals_worse():
    scenario = replace(generate("cross-town", 14, 2), tau=TAU)
    sums = [
        sum(course.motion.finish for course in searched(scenario, rounds)[1])
        for rounds in (0, 6, 20)
    ]
    assert sums == sorted(sums, reverse=True)


def test_the_later_one_of_two_robots_that_meet_on_exact_zones_is_told():
    scenario = floor([robot("A", (1.0, 5.0), (9.0, 5.0)), robot("B", (5.0, 1.2), (5.0, 9.2))])
    _, courses = searched(scenario)
    lone = [searched(floor([one]))[1][0] for one in scenario.robots]

    def met(found, late, priorities=(0, 0)):
        tracks = [course.track for course in found]
        motions = [found[0].motion, Motion(found[1].motion.limits, late or found[1].motion.waits)]
        junctions = Junctions(tracks, [0.2, 0.2], scenario.margin, TAU)
        return meeting(junctions, Motions(junctions.lengths(), motions), priorities)

    assert met(courses, []) == set()
    assert met(lone, [Wait(0.0, 0.5, -1)]) == {1}
    assert met(lone, [Wait(0.0, 0.5, -1)], priorities=(0, 1)) == {0}
    assert met(lone, [Wait(0.0, 5.0, -1)]) == set()


def test_moves_of_a_mesh_are_clear_of_obstacles_and_of_other_robots_places():
    wall = ((4.0, 2.0), (6.0, 2.0), (6.0, 6.5), (4.0, 6.5))
    scenario = floor(
        [robot("A", (1.0, 5.0), (9.0, 5.0)), robot("B", (2.0, 8.0), (8.0, 1.5))], [wall]
    )
    finder = Pathfinder(scenario)
    spaces = {index: finder.space_among_places(index) for index in range(2)}
    meshes = Meshes(finder, spaces, WIDE, keeps_off=True)
    mesh = meshes.of(0)
    solid = shapely.Polygon(wall).buffer(0.249)
    discs = [shapely.Point(place).buffer(0.449) for place in ((2.0, 8.0), (8.0, 1.5))]
    opened = 0
    for cell, k in zip(*np.nonzero((mesh.codes == OPEN) | (mesh.codes == 0)), strict=True):
        x, y = mesh.x + cell % mesh.columns * mesh.size, mesh.y + cell // mesh.columns * mesh.size
        dx, dy = MOVES[k] * mesh.size
        line = shapely.LineString([(x, y), (x + dx, y + dy)])
        assert not line.intersects(solid)
        assert not any(line.intersects(disc) for disc in discs)
        opened += 1
    assert opened > 1000


def test_where_anothers_place_closes_the_only_way_a_robot_passes_it_in_time():
    scenario = floor(
        [
            robot("A", (1.0, 5.0), (7.0, 5.0)),
            robot("B", (4.0, 5.0), (9.0, 5.0)),
        ],
        [
            ((0.0, 5.4), (10.0, 5.4), (10.0, 6.0), (0.0, 6.0)),
            ((0.0, 4.0), (10.0, 4.0), (10.0, 4.6), (0.0, 4.6)),
        ],
    )
    finder = Pathfinder(scenario)
    among = {index: finder.space_among_places(index) for index in range(2)}
    alone = {index: finder.space(scenario.robots[index]) for index in range(2)}
    assert Meshes(finder, among, NARROW, keeps_off=True).ends(0) is None
    assert Meshes(finder, alone, NARROW, keeps_off=False).ends(0) is not None
    _, courses = searched(scenario)
    keeps_clear(scenario, courses)


def test_distances_on_a_mesh_are_those_of_dijkstra():
    scenario = floor([robot("A", (1.0, 5.0), (9.0, 5.0)), robot("B", (2.0, 8.0), (8.0, 1.5))])
    finder = Pathfinder(scenario)
    spaces = {index: finder.space_among_places(index) for index in range(2)}
    meshes = Meshes(finder, spaces, WIDE, keeps_off=True)
    mesh = meshes.of(0)
    ends = meshes.ends(0)
    cells, moves = np.nonzero((mesh.codes == OPEN) | (mesh.codes == 0))
    to = cells + MOVES[moves, 1] * mesh.columns + MOVES[moves, 0]
    far = mesh.size * np.hypot(*MOVES[moves].T)
    size = len(mesh.codes)
    graph = coo_matrix((far, (to, cells)), shape=(size, size)).tocsr()
    assert distances(mesh, 0, ends.leaves) == pytest.approx(
        dijkstra(graph, indices=ends.leaves), abs=1e-6
    )
