"""The robot's table of arc lengths, compiled, is the robot's."""

import numpy as np
import pytest

from coordinator.curves.nurbs import nurbs
from coordinator.plan.wire import measured
from protocol.curve import Curve
from tests.coordinator.curves.random_curves import random_curve


def check_table(curve):
    xs, ys = curve.points.T.tolist()
    robot = Curve(curve.degree, curve.knots.tolist(), xs, ys, curve.weights.tolist())
    for ours, theirs in zip(
        measured(curve), (robot._cell_u, robot._cell_s, robot._cell_slope), strict=True
    ):
        np.testing.assert_allclose(ours, theirs, rtol=1e-10)


@pytest.mark.parametrize("seed", range(8))
def test_the_compiled_table_is_that_of_the_robot(seed):
    check_table(random_curve(np.random.default_rng(seed)))


def test_kinks_and_cells_without_length_are_as_on_the_robot():
    points = [(0, 0), (1, 0), (1, 0), (1, 0), (1, 0), (1, 1), (2, 1), (3, 3)]
    check_table(nurbs(3, [0, 0, 0, 0, 1, 1, 1, 2, 3, 3, 3, 3], points))
