"""Where a robot finds itself on a path too sharp for it, judged by SciPy's curve."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from protocol.curve import Curve
from robot_agent.core.steering import PathFollower
from tests.robot_agent.core.rides import dense_line, winding_path


@pytest.mark.parametrize("turns", ["fffllfff", "fffrrfff"])
@pytest.mark.parametrize("step", [0.02, 0.05])
def test_a_robot_that_lost_a_needle_turn_tells_where_it_rests(turns, step):
    path = winding_path(turns, step)
    line, arc = dense_line(path)
    middle = line[len(line) // 2]
    offsets = np.linspace(-0.1, 0.1, 9)
    for dx, dy, before in itertools.product(offsets, offsets, (0.3, 0.5, 0.7)):
        follower = PathFollower(Curve(*path))
        follower.s = before * float(arc[-1])
        x, y = float(middle[0]) + dx, float(middle[1]) + dy
        follower.locate(x, y, 1.0)
        follower.find()
        if 0.0 < follower.s < arc[-1]:
            i = min(max(int(np.searchsorted(arc, follower.s)), 1), len(arc) - 2)
            heading = math.atan2(*(line[i + 1] - line[i - 1])[::-1])
            left = np.array([-math.sin(heading), math.cos(heading)])
            told = line[i] + follower.lateral * left
            assert math.dist(told, (x, y)) < 0.003
            turned = math.remainder(heading + follower.heading_error - 1.0, math.tau)
            assert abs(turned) < 0.02
