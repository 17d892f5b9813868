"""Rounded corners: the closed forms against quadrature, and widths that are as wide as is clear."""

import math
import random

import numpy as np
import pytest
import shapely

from coordinator.ground.corner_kernels import Corner, radius_of, widest_rounding, width_for
from coordinator.ground.free_space import DISC_TOLERANCE, Space
from coordinator.ground.grown_floor import GrownFloor
from coordinator.ground.polygon_kernels import merge, push, widths
from coordinator.motion.cornering import Handling
from tests.floors import SIZE, box, random_floor
from tests.sweeps import enough, seeds

WIDE = box(-50, -50, 50, 50)
ANGLES = [5, 30, 60, 90, 100, -45]


def unit(angle):
    return np.array([math.cos(angle), math.sin(angle)])


def rounded_corner(corner, into, onward, width, exact=False, count=4001):
    """Places on a rounded corner: its second derivative is a hat, integrated twice by hand."""
    x = np.linspace(-1.0, 1.0, count)[:, None]
    bulge = np.where(x <= 0.0, (1 + x) ** 3 / 6, x + (1 - x) ** 3 / 6)
    out = width / 6.0 if exact else 0.0
    return corner - out * (onward - into) + width * (x * into + bulge * (onward - into))


def solid_of_space(obstacles=(), reach=0.2, discs=(), boundary=WIDE):
    ground = GrownFloor(boundary, obstacles).ground(reach)
    return Space(ground, reach, discs=np.reshape(discs, (-1, 3))).solid


@pytest.mark.parametrize("degrees", ANGLES)
def test_the_least_radius_is_that_of_the_rounded_corner(degrees):
    turn = math.radians(degrees)
    line = rounded_corner(np.zeros(2), unit(0.0), unit(turn), 1.5)
    first = np.gradient(line, axis=0)
    second = np.gradient(first, axis=0)
    cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    bend = np.abs(cross / np.hypot(*first.T) ** 3)[5:-5].max()
    assert radius_of(1.5, turn) == pytest.approx(1.0 / bend, rel=2e-3)
    assert width_for(radius_of(1.5, turn), turn) == pytest.approx(1.5, rel=1e-12)


@pytest.mark.parametrize("exact", [False, True])
def test_the_widest_rounding_is_clear_and_one_a_little_wider_is_not(exact):
    seen = {"limited": 0, "free": 0, "none": 0}
    for seed in seeds(400):
        dice, floor = random.Random(seed), random_floor(seed % 60)
        corner = np.array([dice.uniform(1, SIZE[0] - 1), dice.uniform(1, SIZE[1] - 1)])
        angle = dice.uniform(0.0, 2.0 * math.pi)
        turn = dice.choice((-1, 1)) * math.radians(dice.uniform(5, 110))
        into, onward, most = unit(angle), unit(angle + turn), dice.uniform(0.1, 2.0)
        disc = (dice.uniform(0, 9), dice.uniform(0, 7), dice.uniform(0.1, 0.6))
        solid = solid_of_space(floor.obstacles, floor.reach, disc, floor.boundary)
        rings = [shapely.LinearRing(ring) for ring in (floor.boundary, *floor.obstacles)]
        edges = shapely.union_all(rings)

        def slack(width, way=(corner, into, onward), edges=edges, solid=solid, disc=disc):
            line = shapely.LineString(rounded_corner(*way, width, exact))
            outside = shapely.distance(line, shapely.Point(disc[:2])) - disc[2] + DISC_TOLERANCE
            return min(shapely.distance(line, edges) - solid.need, outside)

        width = widest_rounding(Corner(*corner, *into, *onward, exact), most, solid)
        kind = "none" if width < 0.0 else "limited" if width < most else "free"
        seen[kind] += 1
        if kind == "none":
            assert slack(0.002) < 1e-6
            continue
        assert slack(width) > -1e-9
        if kind == "limited":
            # Halving ends within 3 %; chords are judged with a sagitta of up to d / 1400.
            wider = np.geomspace(min(1.06 * width, most), most, 20)
            assert min(slack(each) for each in wider) < 1e-3 * width
    assert min(seen.values()) > enough(10)


def wide_corners(polygon, exact=(), handling=None, solid=None):
    polygon = np.array(polygon, float)
    flags = np.zeros(len(polygon), dtype=np.bool_)
    flags[[0, -1, *exact]] = True
    numbers = (handling or Handling(lateral=0.1)).numbers()
    return widths(polygon, flags, numbers, solid or solid_of_space())


def test_widths_share_the_legs_between_them_and_keep_off_the_ends():
    dice = np.random.default_rng(0)
    for _ in range(100):
        polygon = np.cumsum(dice.uniform(0.2, 1.0, (7, 2)) * dice.choice((-1, 1), (7, 2)), axis=0)
        found, legs = wide_corners(polygon), np.hypot(*np.diff(polygon, axis=0).T)
        assert (found[[0, -1]] == 0.0).all()
        assert (found[:-1] + found[1:] <= legs + 1e-12).all()
        assert found[1] <= 0.9 * legs[0] + 1e-12
        assert found[-2] <= 0.9 * legs[-1] + 1e-12


def test_no_corner_is_wider_than_is_of_use():
    handling = Handling(speed=1.0, lateral=1.0)
    found = wide_corners([(0, 0), (20, 0), (20, 20)], handling=handling)
    assert radius_of(found[1], math.pi / 2) == pytest.approx(1.0, rel=1e-9)


def test_two_corners_become_one_where_nothing_stands():
    polygon = np.array([(0, 0), (3, 0), (3.2, 0.2), (3.2, 4.0)], float)
    exact, numbers = np.zeros(4, dtype=np.bool_), Handling(accel=0.5, lateral=0.5).numbers()
    merged, _ = merge(polygon, exact, 1, 3, numbers, solid_of_space())
    np.testing.assert_allclose(merged, [(0, 0), (3.2, 0), (3.2, 4)], atol=1e-12)
    wall = solid_of_space([box(3.15, -0.5, 3.3, -0.1)], reach=0.15)
    np.testing.assert_array_equal(merge(polygon, exact, 1, 3, numbers, wall)[0], polygon)
    exact[2] = True
    kept, flags = merge(polygon, exact, 1, 3, numbers, solid_of_space())
    np.testing.assert_array_equal(kept, polygon)
    np.testing.assert_array_equal(flags, exact)


def test_a_corner_close_to_what_it_goes_around_moves_out_and_not_beyond_its_budget():
    pillar = solid_of_space([box(4.2, 0.2, 5, 3)], reach=0.2)
    polygon, exact = np.array([(0, 0), (5.2, 0), (5.2, 4)], float), np.zeros(3, dtype=np.bool_)
    polygon[1] += (0.001, -0.001)
    numbers = Handling(accel=0.2, lateral=0.2, min_turn_radius=0.05).numbers()
    moved = push(polygon, exact, 1, 2, 0.1, numbers, pillar)
    assert moved[1, 0] > 5.2
    assert moved[1, 1] < 0.0
    longer = np.hypot(*np.diff(moved, axis=0).T).sum() - np.hypot(*np.diff(polygon, axis=0).T).sum()
    assert 0.0 < longer <= 0.1
    np.testing.assert_array_equal(push(polygon, exact, 1, 2, 0.0, numbers, pillar), polygon)
    np.testing.assert_array_equal(push(polygon, ~exact, 1, 2, 0.1, numbers, pillar), polygon)
