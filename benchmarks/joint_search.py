"""Whether two or three robots can change places at all: an exhaustive search of a grid.

A state says in which cell each robot is; in a step one robot goes to one of the eight cells around
it.  Robots keep what plans keep, and SLACK more, so that what holds in cells holds between them:
what the search solves can be driven.  What it does not solve may still be possible, in less room
than SLACK.

Decides: what a grid says of a scenario.  Must not know: how plans are found.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum
from typing import Final

import numba
import numpy as np
import numpy.typing as npt
import shapely

from coordinator.scenario.model import Scenario

SLACK: Final = 0.03
"""How much more [m] robots keep than plans do."""

CELLS: Final = (0.04, 0.06, 0.08, 0.1)
"""Sides of cells [m]: the finest one is taken of which a scenario has few enough states."""

_MOST: Final = 400_000_000
"""Spaces of more states are not searched: that takes 2 GB."""

_NEAR: Final = 1.5
"""A robot's place is in the nearest free cell, which is no farther away than this many sides."""

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]


class Found(Enum):
    """What a search says of a scenario."""

    SOLVED = "solved"
    NOTHING = "nothing found"
    TOO_TIGHT = "ends too tight"
    TOO_LARGE = "too large"


def search(scenario: Scenario) -> Found:
    """Return whether the robots of a scenario can go from their starts to their goals."""
    robots, margin = scenario.robots, scenario.margin
    for side in CELLS:
        free = [_free_cells(scenario, robot.radius + margin + SLACK, side) for robot in robots]
        cells = [np.argwhere(one) for one in free]
        counts = [len(one) for one in cells]
        if math.prod(counts) <= _MOST:
            break
    else:
        return Found.TOO_LARGE
    if not all(counts):
        return Found.TOO_TIGHT
    radii = np.array([robot.radius for robot in robots])
    needs = ((radii[:, None] + radii + margin + SLACK) / side) ** 2
    starts = _state(cells, [robot.start[:2] for robot in robots], needs, side)
    goals = _state(cells, [robot.goal[:2] for robot in robots], needs, side)
    if starts is None or goals is None:
        return Found.TOO_TIGHT
    numbers = np.full((len(robots), *free[0].shape), -1)
    for number, one in zip(numbers, free, strict=True):
        number[one] = np.arange(one.sum())
    first = np.cumsum([0, *counts])
    solved = _is_reached(np.concatenate(cells), first, numbers, needs, starts, goals)
    return Found.SOLVED if solved else Found.NOTHING


def _free_cells(scenario: Scenario, reach: float, side: float) -> npt.NDArray[np.bool_]:
    """Return which cells (nx, ny) a disc of this radius [m] may have its centre in."""
    floor = shapely.Polygon(scenario.workspace.boundary)
    solid = [shapely.Polygon(corners) for corners in scenario.workspace.obstacles]
    _, _, width, height = floor.bounds
    x, y = np.meshgrid(np.arange(0.0, width, side), np.arange(0.0, height, side), indexing="ij")
    places = shapely.points(x, y)
    free = shapely.contains(floor, places) & (shapely.distance(floor.exterior, places) >= reach)
    for one in solid:
        free &= shapely.distance(one, places) >= reach
    return np.asarray(free)


def _state(
    cells: Sequence[Indices], places: Sequence[Sequence[float]], needs: Array, side: float
) -> Indices | None:
    """Return the cells in which robots are at these places; None if SLACK leaves them no room."""
    found = []
    for mine, place in zip(cells, places, strict=True):
        away = np.hypot(*(mine * side - np.array(place)).T)
        if away.min() > _NEAR * side:
            return None
        found.append(int(away.argmin()))
    at = np.array([mine[k] for mine, k in zip(cells, found, strict=True)])
    apart = ((at[:, None] - at) ** 2).sum(axis=2)
    others = ~np.eye(len(at), dtype=bool)
    return np.array(found) if (apart >= needs)[others].all() else None


@numba.njit(cache=True)
def _is_reached(
    cells: Indices, first: Indices, numbers: Indices, needs: Array, starts: Indices, goals: Indices
) -> bool:
    """Search all states breadth first; a state is a number with a digit for each robot."""
    n = len(starts)
    counts = first[1:] - first[:-1]
    weight = np.ones(n, np.int64)
    for i in range(n - 2, -1, -1):
        weight[i] = weight[i + 1] * counts[i + 1]
    seen = np.zeros(weight[0] * counts[0], np.bool_)
    queue = np.empty(len(seen), np.int32)
    queue[0] = (starts * weight).sum()
    goal = (goals * weight).sum()
    seen[queue[0]] = True
    head, tail = 0, 1
    at = np.empty((n, 2), np.int64)
    while head < tail:
        state = np.int64(queue[head])
        head += 1
        if state == goal:
            return True
        for i in range(n):
            at[i] = cells[first[i] + state // weight[i] % counts[i]]
        for i in range(n):
            digit = state // weight[i] % counts[i]
            for dx in range(-1, 2):
                for dy in range(-1, 2):
                    x, y = at[i, 0] + dx, at[i, 1] + dy
                    if not (0 <= x < numbers.shape[1] and 0 <= y < numbers.shape[2]):
                        continue
                    new = state + (numbers[i, x, y] - digit) * weight[i]
                    if numbers[i, x, y] < 0 or seen[new]:
                        continue
                    if _is_clear(i, x, y, at, needs[i]):
                        seen[new] = True
                        queue[tail] = new
                        tail += 1
    return False


@numba.njit(cache=True)
def _is_clear(i: int, x: int, y: int, at: Indices, needs: Array) -> bool:
    """Return whether robot i in a cell is clear of all others where they are."""
    for j in range(len(at)):
        if j != i and (x - at[j, 0]) ** 2 + (y - at[j, 1]) ** 2 < needs[j]:
            return False
    return True
