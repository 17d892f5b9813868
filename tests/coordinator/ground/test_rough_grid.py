"""The coarse grid, judged by the exact search for ways."""

import random

import numpy as np
import pytest
from scipy.ndimage import label

from coordinator.ground.grown_floor import GrownFloor
from coordinator.ground.rough_grid import RoughGrid
from coordinator.ground.rough_grid_kernels import connected
from sim.floors.generator import generate


@pytest.mark.parametrize("kind", ["aisles", "doorway", "polygons", "maze"])
def test_there_is_no_way_between_places_that_the_grid_parts(kind):
    scenario, dice = generate(kind, 8, 3), random.Random(kind)
    floor = GrownFloor(scenario.workspace.boundary, scenario.workspace.obstacles)
    reach = scenario.robots[0].radius + scenario.margin
    ground = floor.ground(reach)
    grid = RoughGrid(ground, reach)
    places = np.array([place[:2] for r in scenario.robots for place in (r.start, r.goal)])
    parted = 0
    for _ in range(60):
        start, goal, *closed = places[dice.sample(range(len(places)), 8)]
        discs = np.array([(*place, dice.uniform(0.5, 2.5) * reach) for place in closed])
        inside = np.hypot(*(discs[:, None, :2] - (start, goal)).transpose(2, 0, 1)).min(axis=1)
        discs = discs[inside > discs[:, 2] + 0.01]
        if grid.parts(start, goal, discs):
            parted += 1
            assert ground.shortest_way(start, goal, discs) is None
    assert parted > 0 or kind in ("polygons", "maze")


@pytest.mark.parametrize("share", [0.4, 0.6, 0.8])
def test_cells_are_connected_as_scipy_labels_them(share):
    dice = np.random.default_rng(7)
    found = []
    for _ in range(200):
        cells = dice.random((9, 13)) < share
        ends = np.stack((dice.integers(13, size=2), dice.integers(9, size=2)), axis=1)
        cells[ends[:, 1], ends[:, 0]] = True
        parts, _ = label(cells, structure=np.ones((3, 3)))
        one, other = parts[ends[:, 1], ends[:, 0]].tolist()
        found.append(connected(cells, ends, np.empty((0, 3))))
        assert found[-1] == (one == other)
    assert set(found) == {True, False}
