"""The clearance of a curve is never stated larger than it is."""

from types import SimpleNamespace

import numpy as np
import pytest

from coordinator.curves.bounds import flatten
from coordinator.curves.nurbs import nurbs
from coordinator.plan.wire import FLAT
from coordinator.proof.tau_safety import clearances
from coordinator.scenario.floor import Floor

RADIUS = 0.2


@pytest.mark.parametrize("seed", range(10))
def test_a_curve_that_bends_towards_a_wall_is_not_nearer_to_it_than_stated(seed):
    dice = np.random.default_rng(seed)
    low = dice.uniform(-1.0, 0.0, 2)
    points = [(1.0, 2.0), (2.0, 1.0 + low[0]), (3.0, 1.0 + low[1]), (4.0, 2.0)]
    curve = nurbs(3, [0, 0, 0, 0, 1, 1, 1, 1], points)
    floor = Floor([(-5.0, 0.0), (9.0, 0.0), (9.0, 5.0), (-5.0, 5.0)], [])
    truth = curve.evaluate(np.linspace(0.0, 1.0, 20_001))[:, 1].min() - RADIUS
    driven = SimpleNamespace(chain=flatten(curve, FLAT), radius=RADIUS)
    (stated,) = clearances([driven], floor.gap)
    assert truth - 2.0 * FLAT <= stated <= truth
