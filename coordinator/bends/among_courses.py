"""The path of one robot that moves aside for others whose courses are known.

Decides: how courses become traffic, and the polygon of a path among them.  Must not know: when the
robot drives on that path, zones.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from coordinator.base.bounds import bounds_of
from coordinator.base.errors import PlanError
from coordinator.bends.courses_met import CoursesMet, errand_of, part_of
from coordinator.bends.mesh_kernels import Mesh, close_near
from coordinator.bends.meshes import PLACE_ROOM, cell_size, ends_on, open_mesh
from coordinator.bends.traffic_kernels import (
    BEGIN,
    END,
    Traffic,
    free_from,
    gathered,
)
from coordinator.bends.way_kernels import Trip
from coordinator.bends.ways import way_among
from coordinator.curves.nurbs import Nurbs
from coordinator.paths.path_planner import Pathfinder
from coordinator.paths.smoothing import least_radius, smooth
from coordinator.scenario.model import Robot, Scenario


class Pitch(NamedTuple):
    """How fine a mesh is, and for which robots it is searched.

    cells: their size, as a multiple of the need of two robots; lost [s]: a robot that loses less
    without it does not search it; room [m]: what ways on it keep beyond the need, because the curve
    along a way differs a little from it; is_last: whether it is searched only if no coarser one has
    a path that suits.
    """

    cells: float
    lost: float
    room: float
    is_last: bool = False


PITCHES: Final = (Pitch(0.9, 1.0, 0.04), Pitch(0.45, 3.0, 0.03), Pitch(0.3, 8.0, 0.02, True))
"""On fine meshes robots pass each other in doors, but the search takes longer."""

_PAD: Final = 0.1
"""What a way keeps beyond tau [s].  When the robot drives is found on the curve itself."""

_TIGHTEST: Final = 0.015
"""The least radius [m] of a bend.  Where robots without limits turn within a tick or two of their
loops, their steering cannot follow: at a radius of 2 mm one left its path."""

_MOST_STATES: Final = 2_500
_STATES_PER_CELL: Final = 0.125
"""How many states the search for one way expands at most: so many, or so many for each cell of its
mesh if that is more, as ways are longer on large floors."""

_ITSELF: Final = -3
"""The number of the robot that looks for a path; no sample, and no place on a mesh, is its own."""

_STEP: Final = 0.15
"""Distance [m] between the samples of a course."""

_GAP: Final = 0.02
"""How much wider [m] than needed the cells are in which samples are looked up."""


class Times(NamedTuple):
    """When a robot may leave its start, and has to arrive [s of plan time].

    ramp [s]: what speeding up costs it; tau [s]: for how long others keep off where it passes.
    """

    leaves: float
    latest: float
    ramp: float
    tau: float


class Bends:
    """The meshes of one floor, for the paths of single robots."""

    def __init__(self) -> None:
        self._meshes: dict[tuple[float, float], Mesh] = {}

    def path(
        self,
        finder: Pathfinder,
        traffic: Traffic,
        times: Times,
        pitch: Pitch,
    ) -> Nurbs | None:
        """Return a path for the first robot of a scenario, on which it should arrive earliest.

        The robots after it stand where others rest.  None if there is no path in this traffic on
        which it arrives in time.
        """
        robot = finder.scenario.robots[0]
        reach, tau = robot.radius + finder.scenario.margin + pitch.room, times.tau + _PAD
        latest = times.latest - times.leaves - times.ramp
        if free_from(traffic, _ITSELF, *robot.goal[:2], reach, tau) >= latest:
            return None
        space, mesh = finder.space_among_places(0), self._mesh(finder, pitch.cells)
        ends = ends_on(mesh, _ITSELF, space, robot)
        if ends is None:
            return None
        speed = finder.scenario.planned_speed(robot)
        trip = Trip(_ITSELF, *ends, speed, times.ramp, reach, tau)
        most = max(_MOST_STATES, int(_STATES_PER_CELL * mesh.columns * mesh.rows))
        way, _ = way_among(mesh, trip, space, traffic, latest, most)
        if not len(way):
            return None
        exact = np.zeros(len(way), dtype=np.bool_)
        exact[[0, -1]] = True
        try:
            found = smooth(way, exact, space, finder.handling(robot))
        except PlanError:
            return None
        return found.curve if least_radius(found) >= _TIGHTEST else None

    def _mesh(self, finder: Pathfinder, pitch: float) -> Mesh:
        """Return the mesh of a scenario's first robot, which keeps off where the others stand."""
        robot, *stand = finder.scenario.robots
        key = (robot.radius, pitch)
        if key not in self._meshes:
            self._meshes[key] = open_mesh(finder, robot, pitch)
        base = self._meshes[key]
        mesh = base._replace(codes=base.codes.copy())
        if stand:
            reach = robot.radius + finder.scenario.margin + PLACE_ROOM
            needs = np.array([one.radius for one in stand]) + reach
            close_near(mesh, np.array([one.start[:2] for one in stand]), needs)
        return mesh


def pitches_of(scenario: Scenario, robot: Robot) -> list[Pitch]:
    """Return those of PITCHES that make meshes of their own: on large floors some have one mesh."""
    by_size: dict[float, Pitch] = {}
    for pitch in PITCHES:
        by_size.setdefault(cell_size(scenario, robot, pitch.cells), pitch)
    return list(by_size.values())


def traffic_for(finder: Pathfinder, others: CoursesMet, times: Times) -> Traffic:
    """Return the samples of the courses that the first robot of a scenario may meet on its way.

    times.leaves counts as 0.
    """
    robot, zero, tau = finder.scenario.robots[0], times.leaves, times.tau + _PAD
    reach = robot.radius + finder.scenario.margin + max(pitch.room for pitch in PITCHES)
    errand = errand_of(robot, zero, times.latest, finder.scenario.planned_speed(robot))
    met = others.met(errand, reach, tau)
    delays = [others.delays[k] for k in met]
    courses = [others.courses[k] for k in met]
    parts = [
        part_of(one, errand, reach, tau, delay) for one, delay in zip(courses, delays, strict=True)
    ]
    owner = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    samples = np.concatenate([*parts, np.empty((0, 5))])
    samples[:, BEGIN] -= zero
    samples[:, END] += np.array(delays)[owner] - zero
    size = reach + max((one.driven.radius for one in courses), default=0.0) + _GAP
    places = samples[:, :2] if len(samples) else np.zeros((1, 2))
    low, high = bounds_of(places)
    low -= size
    columns, rows = np.ceil((high + size - low) / size).astype(int).tolist()
    return gathered(samples, owner, float(low[0]), float(low[1]), size, columns, rows)
