"""Compile or load all kernels: `python -m coordinator.planning.warm [PART]`.

Compiling takes more than a minute of CPU time, once per machine and version; loading compiled
kernels takes a fraction of a second, once per process.  This module does both ahead of time, so
that no plan has to wait for them.  The parts have few kernels in common, so processes can compile
them in parallel.

Decides: which functions are called so that every kernel is compiled.  Must not know: what these
functions return, and who calls this module when.
"""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable
from typing import Final

import numpy as np

from coordinator.curves.chords import chords_of
from coordinator.curves.nurbs import Nurbs
from coordinator.ground.free_space import NO_DISCS
from coordinator.ground.grown_floor import GrownFloor
from coordinator.ground.rough_grid import RoughGrid
from coordinator.motion.velocity_profile import limits_on
from coordinator.paths.path_planner import Pathfinder, find_paths
from coordinator.plan.staircases import NO_STAIRCASES
from coordinator.planning.planner import plan_scenario
from coordinator.scenario.model import GivenPath, Point, Pose, Robot, Scenario, Workspace
from coordinator.schedule.authority import Authority
from coordinator.schedule.given_motions import meeting
from coordinator.schedule.junctions import Junctions
from coordinator.schedule.timetable import Motions
from coordinator.schedule.track import Track


@functools.cache
def load_kernels() -> None:
    """Compile or load the kernels of planning, by planning a scenario that uses all of them."""
    plan_scenario(_floor_with_a_wall())
    _compile_authority()
    _compile_bends()


def compile_rest() -> None:
    """Compile the kernels that few plans need: headings, maps, robots that make room."""
    turning = _robot("E", (2.0, 3.0, 2.0), (8.0, 3.0, 2.0))
    plan_scenario(_scenario((turning, _robot("F", (5.0, 1.0), (5.0, 5.0))), ()))
    _compile_maps()
    _compile_ground()
    _compile_places()


def _compile_all() -> None:
    load_kernels()
    compile_rest()


def _compile_paths() -> None:
    """Compile the kernels that find paths and those that read maps."""
    find_paths(Pathfinder(_floor_with_a_wall()), None)
    _compile_maps()
    _compile_ground()


def _compile_schedules() -> None:
    """Compile the kernels that find zones, schedule robots and prove a plan.

    All paths are given, so none is searched for.
    """
    ends: tuple[tuple[str, Point, Point], ...] = (
        ("A", (1.0, 1.0), (9.0, 1.0)),
        ("B", (6.0, 3.0), (9.0, 3.0)),
        ("C", (7.5, 0.5), (7.5, 4.5)),
    )
    robots = tuple(
        _robot(name, start, goal, GivenPath(degree=1, control_points=(start, goal)))
        for name, start, goal in ends
    )
    plan_scenario(_scenario(robots, ()))
    _compile_authority()


def _compile_authority() -> None:
    """Compile the kernels that grant authority."""
    authority = Authority(NO_STAIRCASES, 2)
    authority.grant(0, 0, 0)
    authority.holder_of(0)
    authority.allows(NO_STAIRCASES)


def _compile_ground() -> None:
    """Compile the kernel that finds places closed."""
    floor = _floor_with_a_wall()
    grown = GrownFloor(floor.workspace.boundary, floor.workspace.obstacles)
    grid = RoughGrid(grown.ground(0.2), 0.2)
    grid.parts(np.array([1.0, 1.0]), np.array([9.0, 1.0]), NO_DISCS)


def _compile_places() -> None:
    """Compile the kernels of robots that make room, which few plans load."""
    from coordinator.places.early_moves import early_moves
    from coordinator.places.moves import find_moves, one_after_the_other
    from coordinator.places.parting_kernels import clear_by_steps
    from coordinator.places.place_graph import place_graph

    floor = _floor_with_a_wall()
    workspace = floor.workspace
    grown = GrownFloor(workspace.boundary, workspace.obstacles)
    graph = place_graph(floor, grown, [robot.radius for robot in floor.robots])
    assert graph is not None  # Its robots have room to move.
    for few in (len(floor.robots), 0):
        find_moves(graph, few)
    one_after_the_other(graph)
    early_moves(graph, find_moves(graph)[1], 0.5)
    clear_by_steps(graph.ways[0], graph.ways[0], 0.4, 0.05)


def _compile_bends() -> None:
    """Compile the kernels of ways in space and time, which small fleets do not need."""
    from coordinator.bends.flow_search import FlowSearch
    from coordinator.bends.traffic_kernels import (
        Errand,
        count_meetings,
        first_meeting,
        gathered,
        part_met,
    )

    robots = _robot("A", (1.0, 1.0), (9.0, 1.0)), _robot("B", (9.0, 1.1), (1.0, 1.1))
    finder = Pathfinder(_scenario(robots, ()))

    def track_of(index: int, path: Nurbs) -> Track:
        robot = robots[index]
        limits = limits_on(
            path, robot.max_speed, robot.max_accel, robot.max_lateral_accel, robot.max_turn_rate
        )
        return Track(limits, chords_of(path, 1e-3))

    paths = find_paths(finder)
    tracks = [track_of(index, path) for index, path in enumerate(paths)]
    courses = FlowSearch(finder, paths, tracks, track_of, 0.5).run(1)
    if courses is not None:
        junctions = Junctions([one.track for one in courses], [0.2, 0.2], 0.05, 0.5)
        motions = Motions(junctions.lengths(), [one.motion for one in courses])
        meeting(junctions, motions, [0, 0])
    samples = np.zeros((1, 5))
    traffic = gathered(samples, np.zeros(1, np.int64), 0.0, 0.0, 1.0, 1, 1)
    first_meeting(samples, traffic, 0, 0.2, 0.5)
    count_meetings(samples, traffic, 0, 0.2, 0.5, 1)
    part_met(samples, Errand(np.zeros(2), np.ones(2), 0.0, 1.0, 1.0), 0.2, 0.5, 0.0)


def _compile_maps() -> None:
    from coordinator.curves.knots import insert_knot
    from coordinator.curves.nurbs import nurbs
    from coordinator.scenario_files.maps.cells import outline_cells

    insert_knot(nurbs(1, [0.0, 0.0, 1.0, 1.0], [[0.0, 0.0], [1.0, 0.0]]), 0.5)
    outline_cells(np.ones((2, 2), dtype=np.bool_), 1.0)


PARTS: Final[dict[str, Callable[[], None]]] = {
    "schedules": _compile_schedules,
    "places": _compile_places,
    "paths": _compile_paths,
    "bends": _compile_bends,
}
"""Parts that processes can compile in parallel; `compile_rest` compiles the remaining kernels.

The longest part comes first, the one that shares most kernels with the others last.
"""


def _floor_with_a_wall() -> Scenario:
    robots = (
        _robot("A", (1.0, 1.0), (9.0, 1.0)),
        _robot("B", (2.5, 6.8), (5.0, 6.8)),
        _robot("C", (6.0, 3.0), (9.0, 3.0)),
        _robot("D", (7.5, 1.5), (7.5, 4.5)),
    )
    return _scenario(robots, (((3.0, 0.0), (4.0, 0.0), (4.0, 6.0), (3.0, 6.0)),))


def _scenario(robots: tuple[Robot, ...], walls: tuple[tuple[Point, ...], ...]) -> Scenario:
    floor = Workspace(boundary=((0.0, 0.0), (10.0, 0.0), (10.0, 8.0), (0.0, 8.0)), obstacles=walls)
    return Scenario(name="warm", workspace=floor, robots=robots, tau=0.5)


def _robot(name: str, start: Pose, goal: Pose, path: GivenPath | None = None) -> Robot:
    return Robot(
        id=name,
        start=start,
        goal=goal,
        radius=0.2,
        max_speed=0.8,
        max_accel=0.8,
        max_lateral_accel=0.8,
        path=path,
    )


if __name__ == "__main__":
    for part in sys.argv[1:]:
        PARTS[part]()
    if not sys.argv[1:]:
        _compile_all()
