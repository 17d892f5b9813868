"""Where a robot finds itself on a path too sharp for it, judged by SciPy's curve."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.interpolate import BSpline

from protocol.curve import Curve
from robot_agent.core.steering import PathFollower
from tests.robot_agent.core.rides import dense_line, uniform_knots, winding_path


@pytest.mark.parametrize("apart", [0.02, 0.03, 0.05])
def test_a_robot_that_turns_no_faster_than_20_rad_a_second_keeps_to_a_path_that_turns_back(apart):
    """Its bend has a radius from 4 mm on; in a tick of 10 ms it turns by 0.2 rad at most."""
    out = [(0.1 * k, 0.0) for k in range(4)] + [(0.3 + 2.0 * apart, 0.0)]
    points = np.array([*out, *((x, apart) for x, _ in reversed(out))])
    knots = uniform_knots(len(points))
    spline = BSpline(knots, points, 3)
    u = np.linspace(0.0, knots[-1], 20_001)
    first, second = spline(u, 1), spline(u, 2)
    crossed = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    bends = np.abs(crossed) / np.hypot(*first.T) ** 3
    arc = np.append(0.0, np.cumsum(np.hypot(*np.diff(spline(u), axis=0).T)))
    follower = PathFollower(Curve(3, knots, *points.T.tolist(), [1.0] * len(points)))
    x, y, heading, farthest = 0.0, 0.0, 0.0, 0.0
    for _ in range(1_000):
        bend = float(np.interp(follower.s, arc, bends))
        travel = 0.01 * min(0.4, 20.0 / max(bend, 1e-9))
        follower.locate(x, y, heading)
        farthest = max(farthest, follower.off)
        turn = follower.curvature(travel) * travel
        x += travel * math.cos(heading + 0.5 * turn)
        y += travel * math.sin(heading + 0.5 * turn)
        heading += turn
        if follower.s > arc[-1] - 0.01:
            break
    assert follower.s > arc[-1] - 0.01
    assert farthest < 0.007


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


@pytest.mark.parametrize("turn", [-2.1, -1.0, 0.5, 2.1])
def test_a_robot_outside_of_a_corner_tells_where_it_rests(turn):
    """Nearest is the tip, which is not at right angles to the robot."""
    corner = np.array([2.0, 2.0])
    end = corner + np.array([math.cos(turn), math.sin(turn)])
    points = np.array([[1.0, 2.0], corner, end])
    outwards = corner - points.mean(axis=0)
    place = corner + 0.06 * outwards / np.hypot(*outwards)
    for began in (0.8, 0.99, 1.01, 1.2):
        curve = Curve(1, [0.0, 0.0, 1.0, 2.0, 2.0], *points.T.tolist(), [1.0] * 3)
        follower = PathFollower(curve)
        follower.s = began
        follower.locate(*place.tolist(), 0.5 * turn)
        follower.find()
        curve.place(follower.s)
        ahead = np.array([curve.dx, curve.dy]) / math.hypot(curve.dx, curve.dy)
        left = np.array([-ahead[1], ahead[0]])
        told = np.array([curve.x, curve.y]) + follower.lateral * left + follower.beyond * ahead
        assert math.dist(told, place) < 0.001


def test_a_robot_that_turns_on_the_spot_stays_where_it_is_on_its_path():
    """The path bends by 10 rad/m from its beginning; elsewhere on it the heading would fit."""
    points = np.array([[0.0, 0.0], [0.05, 0.0], [0.05, 0.05]])
    for turned in np.linspace(-3.0, 3.0, 13):
        curve = Curve(2, [0.0, 0.0, 0.0, 1.0, 1.0, 1.0], *points.T.tolist(), [1.0] * 3)
        follower = PathFollower(curve)
        x, y, heading = follower.start_pose()
        for step in (0.0, 1e-4, 2e-4):
            follower.locate(x, y, heading + turned + step)
            follower.curvature(0.0)
        assert follower.s < 1e-6
