"""The mesh of a floor for robots of one radius, and where each robot enters and leaves it.

Decides: how fine the mesh is, and which of its moves are clear.  Must not know: times.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from coordinator.base.bounds import bounds_of
from coordinator.bends.mesh_kernels import CLOSED, HALF, MOVES, OPEN, Mesh, close_near, distances
from coordinator.curves.nurbs import Array
from coordinator.ground.free_space import Space
from coordinator.paths.path_planner import Pathfinder
from coordinator.scenario.model import Robot, Scenario

WIDE: Final = 0.9
NARROW: Final = 0.27
"""Sizes of cells, as multiples of the need of two robots: where there is room, and for passages
that no wide cell hits."""

_MOST_CELLS: Final = 40_000
"""Greatest number of cells; on larger floors they are larger."""

PLACE_ROOM: Final = 0.02
"""How much farther off [m] than needed ways pass other robots' starts and goals."""

_NEAR: Final = 2.0
"""A robot enters the mesh at a cell at most this many cell sizes away."""


class Ends(NamedTuple):
    """The cells where a robot enters and leaves its mesh, its start and goal (2,) [m].

    left (cells,) [m]: the distances of all cells from the one where it leaves.
    """

    enters: int
    leaves: int
    start: Array
    goal: Array
    left: Array


class Meshes:
    """The meshes of a fleet, one for each radius, made when they are asked for.

    spaces: where the robots that may bend may drive; pitch: WIDE or NARROW.  If the fleet
    `keeps_off`, no move comes near other robots' starts and goals.
    """

    def __init__(
        self, finder: Pathfinder, spaces: Mapping[int, Space], pitch: float, keeps_off: bool
    ) -> None:
        self._finder, self.spaces = finder, spaces
        self._pitch, self._keeps_off = pitch, keeps_off
        self._meshes: dict[float, Mesh] = {}
        self._ends: dict[int, Ends | None] = {}

    def of(self, index: int) -> Mesh:
        """Return the mesh of a robot."""
        robots = self._finder.scenario.robots
        radius = robots[index].radius
        if radius not in self._meshes:
            mesh = open_mesh(self._finder, robots[index], self._pitch)
            if self._keeps_off:
                reach = radius + self._finder.scenario.margin + PLACE_ROOM
                needs = np.array([other.radius for other in robots]) + reach
                for places in ([one.start[:2] for one in robots], [one.goal[:2] for one in robots]):
                    close_near(mesh, np.array(places), needs)
            self._meshes[radius] = mesh
        return self._meshes[radius]

    def ends(self, index: int) -> Ends | None:
        """Return where a robot enters and leaves its mesh; None if no moves join both."""
        if index not in self._ends:
            robot = self._finder.scenario.robots[index]
            self._ends[index] = ends_on(self.of(index), index, self.spaces[index], robot)
        return self._ends[index]


def ends_on(mesh: Mesh, index: int, space: Space, robot: Robot) -> Ends | None:
    """Return where robot number `index` enters and leaves a mesh; None if no moves join both."""
    start, goal = np.array(robot.start[:2]), np.array(robot.goal[:2])
    enters, leaves = (_cell(mesh, index, space, place) for place in (start, goal))
    if enters < 0 or leaves < 0:
        return None
    left = distances(mesh, index, leaves)
    return Ends(enters, leaves, start, goal, left) if np.isfinite(left[enters]) else None


def _cell(mesh: Mesh, index: int, space: Space, place: Array) -> int:
    """Return the nearest cell that a straight line joins with a place (2,); -1 if none."""
    steps = np.arange(-2, 3)
    at = np.round((place - (mesh.x, mesh.y)) / mesh.size).astype(int)
    columns, rows = (np.array(np.meshgrid(steps, steps)) + at[:, None, None]).reshape(2, -1)
    inside = (columns >= 0) & (rows >= 0) & (columns < mesh.columns) & (rows < mesh.rows)
    cells = rows[inside] * mesh.columns + columns[inside]
    middles = np.column_stack((columns[inside], rows[inside])) * mesh.size + (mesh.x, mesh.y)
    codes = mesh.codes[cells]
    usable = ((codes == OPEN) | (codes == index)).any(axis=1)
    far = np.hypot(*(middles - place).T)
    for k in np.flatnonzero(usable)[np.argsort(far[usable], kind="stable")].tolist():
        if far[k] > _NEAR * mesh.size:
            break
        if space.keeping(place[None], middles[k][None])[0]:
            return int(cells[k])
    return -1


def cell_size(scenario: Scenario, robot: Robot, pitch: float) -> float:
    """Return the size [m] of the cells of a mesh for robots as wide as this one."""
    low, high = bounds_of(np.array(scenario.workspace.boundary))
    size = pitch * (2.0 * robot.radius + scenario.margin)
    return max(size, float(np.sqrt(np.prod(high - low) / _MOST_CELLS)))


def open_mesh(finder: Pathfinder, robot: Robot, pitch: float) -> Mesh:
    """Return the mesh for robots as wide as this one, with all moves that no solid thing closes."""
    scenario = finder.scenario
    low, high = bounds_of(np.array(scenario.workspace.boundary))
    reach, size = robot.radius + scenario.margin, cell_size(scenario, robot, pitch)
    columns, rows = np.maximum(np.ceil((high - low) / size).astype(int), 1).tolist()
    x, y = (low + 0.5 * ((high - low) - size * (np.array((columns, rows)) - 1))).tolist()
    row, column = np.divmod(np.arange(columns * rows), columns)
    middles = np.column_stack((x + size * column, y + size * row))
    codes = np.full((columns * rows, 2 * HALF), CLOSED, dtype=np.int32)
    space = finder.space(robot)
    far = reach + size * float(np.hypot(*MOVES[:HALF].T).max()) + 1e-5  # From there all is clear.
    is_open = finder.floor.are_open(middles)
    room = np.where(is_open, space.ground.gaps(middles, far), 0.0) - reach
    for k in range(HALF):
        dx, dy = MOVES[k].tolist()
        ok = (column + dx >= 0) & (column + dx < columns) & (row + dy < rows)
        begin = np.flatnonzero(ok & (room > 0.0))
        end = begin + dy * columns + dx
        begin, end = begin[room[end] > 0.0], end[room[end] > 0.0]
        unsure = room[begin] + room[end] <= size * np.hypot(dx, dy) + 1e-6
        clear = ~unsure
        clear[unsure] = space.keeping(middles[begin[unsure]], middles[end[unsure]])
        codes[begin[clear], k] = codes[end[clear], k + HALF] = OPEN
    return Mesh(codes, x, y, size, columns, rows)
