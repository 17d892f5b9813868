"""The space of one path: ways around others' places, and clearance that is never overestimated."""

import math
import random

import numpy as np
import pytest
import shapely

from coordinator.curves.nurbs import nurbs
from coordinator.ground.distance_kernels import keeping
from coordinator.ground.free_space import DISC_TOLERANCE, NO_DISCS, Space
from coordinator.ground.grown_floor import GrownFloor
from tests.floors import box, random_floor, random_places, solid_of
from tests.oracles_floor import VisibilityGraph, convex_corners, grown
from tests.sweeps import enough, seeds

BOX = box(0, 0, 10, 8)
SLACK = 1e-6
TIP = 1.0 / math.cos(math.pi / 8)
"""How far the corners of an octagon lie out, per radius of the circle in it."""


def way_length(way):
    return math.inf if way is None else float(np.hypot(*np.diff(way, axis=0).T).sum())


def space_on(obstacles=(), reach=0.2, discs=NO_DISCS, boundary=BOX):
    ground = GrownFloor(boundary, obstacles).ground(reach)
    return Space(ground, reach, discs=np.asarray(discs, float))


def disc_gaps(way, discs):
    """How far outside of each disc a way stays."""
    line = shapely.LineString(way)
    return shapely.distance(line, shapely.points(discs[:, :2])) - discs[:, 2]


def octagon(x, y, radius):
    angles = np.arange(8) * math.pi / 4
    return np.array([x, y]) + TIP * radius * np.column_stack((np.cos(angles), np.sin(angles)))


def random_discs(dice, floor, ends):
    """Discs whose octagons hold neither end, some of them overlapping."""
    low, high = np.min(floor.boundary, axis=0), np.max(floor.boundary, axis=0)
    discs, wanted = [], dice.randint(1, 4)
    while len(discs) < wanted:
        x, y = (dice.uniform(a, b) for a, b in zip(low, high, strict=True))
        radius = dice.uniform(0.2, 0.9)
        if np.hypot(*(ends - (x, y)).T).min() > TIP * radius + 0.01:
            discs.append((x, y, radius))
    return np.array(discs)


def crowded_floors(count):
    for seed in range(count):
        floor = random_floor(seed)
        ends = random_places(floor, 2, seed)
        if len(ends) == 2:
            yield floor, ends, random_discs(random.Random(seed), floor, ends)


def test_ways_around_all_discs_are_those_of_brute_force():
    blocked_ways = 0
    for floor, ends, discs in crowded_floors(150):
        ground = GrownFloor(floor.boundary, floor.obstacles).ground(floor.reach)
        corners = convex_corners(grown(floor, floor.reach))
        tips = [octagon(x, y, radius + 2 * SLACK) for x, y, radius in discs]
        corners = np.concatenate((corners, *tips))
        blocked = grown(floor, floor.reach - SLACK)
        graph = VisibilityGraph(blocked, corners, discs)
        way = ground.shortest_way(*ends, discs)
        wanted = graph.length(*ends)
        assert way_length(way) == pytest.approx(wanted, rel=1e-6), (ends, discs)
        blocked_ways += way is None
        if way is not None:
            assert disc_gaps(way, discs).min() >= -SLACK
    assert blocked_ways > 0


def test_ways_led_around_discs_are_hardly_longer_than_the_shortest():
    """Detours are local, around the discs that a way meets; most are the shortest all the same."""
    longer = []
    for floor, ends, discs in crowded_floors(300):
        ground = GrownFloor(floor.boundary, floor.obstacles).ground(floor.reach)
        led = Space(ground, floor.reach, discs=discs).shortest_way(*ends)
        shortest = ground.shortest_way(*ends, discs)
        assert (led is None) == (shortest is None), (ends, discs)
        if led is not None:
            assert disc_gaps(led, discs).min() >= -DISC_TOLERANCE
            line = shapely.LineString(led)
            assert not shapely.dwithin(solid_of(floor), line, floor.reach - 2 * SLACK)
            longer.append(way_length(led) / way_length(shortest))
    assert np.median(longer) < 1.0 + 1e-6
    assert np.quantile(longer, 0.95) < 1.02
    assert max(longer) < 1.12


def test_a_disc_that_no_way_crosses_changes_nothing():
    start, goal = np.array([1.0, 1.0]), np.array([9.0, 7.0])
    walls = [box(4, 0, 5, 5)]
    without = space_on(walls).shortest_way(start, goal)
    beside = space_on(walls, discs=[(8.0, 2.0, 0.5), (2.0, 6.0, 0.5)]).shortest_way(start, goal)
    np.testing.assert_array_equal(without, beside)


def test_discs_that_close_every_way_leave_none():
    discs = [(5.0, y, 0.6) for y in (0.5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5)]
    ends = np.array([1.0, 4.0]), np.array([9.0, 4.0])
    assert space_on(discs=discs).shortest_way(*ends) is None
    assert space_on(discs=discs[1:]).shortest_way(*ends) is not None


def test_a_leg_crosses_a_disc_when_it_comes_nearer_than_its_radius():
    dice = np.random.default_rng(0)
    way, discs = dice.uniform(0, 9, (7, 2)), dice.uniform(0.1, 9, (40, 3))
    discs[:, 2] *= 0.3
    legs = shapely.linestrings(np.stack((way[:-1], way[1:]), axis=1))
    wanted = shapely.distance(legs[:, None], shapely.points(discs[:, :2])) < discs[:, 2]
    discs[:, 2] += DISC_TOLERANCE
    found = space_on(discs=discs).crossing(way)
    np.testing.assert_array_equal(found, wanted)
    assert 0 < wanted.sum() < wanted.size


@pytest.mark.parametrize("seed", seeds(45))
def test_lines_are_judged_by_their_true_distance(seed):
    floor, dice = random_floor(seed), np.random.default_rng(seed)
    discs = np.column_stack((dice.uniform(0, 8, (3, 2)), dice.uniform(0.1, 0.6, 3)))
    space = space_on(floor.obstacles, floor.reach, discs, floor.boundary)
    low, high = np.min(floor.boundary, axis=0), np.max(floor.boundary, axis=0)
    starts = dice.uniform(low, high, (300, 2))
    ends = starts + dice.normal(0.0, 1.5, (300, 2))
    ends[:10] = starts[:10]
    extra = dice.uniform(0.0, 0.05, 300)
    lines = shapely.linestrings(np.stack((starts, ends), axis=1))
    # Edges, not areas: whoever is inside has to have come in across an edge.
    rings = [shapely.LinearRing(ring) for ring in (floor.boundary, *floor.obstacles)]
    slack = shapely.distance(lines, shapely.union_all(rings)) - floor.reach - extra
    for x, y, radius in discs:
        outside = shapely.distance(lines, shapely.Point(x, y)) - radius + DISC_TOLERANCE - extra
        slack = np.minimum(slack, outside)
    sure = np.abs(slack) > 1e-9
    found = keeping(starts, ends, extra, space.solid)
    np.testing.assert_array_equal(found[sure], slack[sure] > 0.0)


def test_a_curve_is_never_passed_that_dense_sampling_finds_too_near():
    judged = {True: 0, False: 0}
    for seed in seeds(600):
        dice, floor = np.random.default_rng(seed), random_floor(seed % 60)
        solid = solid_of(floor)
        discs = np.column_stack((dice.uniform(0, 8, (2, 2)), dice.uniform(0.1, 0.5, 2)))
        space = space_on(floor.obstacles, floor.reach, discs, floor.boundary)
        start = random_places(floor, 1, seed)
        count = int(dice.integers(4, 9))
        points = np.cumsum(dice.normal(0.0, 0.5, (count, 2)), axis=0)
        points += (start[0] if len(start) else (5.0, 4.0)) - points[0]
        inner = np.sort(dice.uniform(0.0, 5.0, count - 4))
        curve = nurbs(3, [0.0] * 4 + inner.tolist() + [5.0] * 4, points)
        places = curve.evaluate(np.linspace(0.0, 5.0, 4001))
        near = shapely.dwithin(solid, shapely.points(places), space.need - 1e-12).any()
        for x, y, radius in discs:
            near |= np.hypot(*(places - (x, y)).T).min() < radius - DISC_TOLERANCE
        passed = len(space.obstructed(curve)) == 0
        judged[passed] += 1
        assert not (passed and near), seed
    assert min(judged.values()) > enough(30)


def test_what_obstructs_a_curve_is_told_by_its_parameter():
    curve = nurbs(3, [0.0] * 4 + [8.0] * 4, [(1, 4), (3.6, 4), (6.3, 4), (9, 4)])
    hit = space_on([box(4.9, 4.1, 5.1, 5.0)]).obstructed(curve)
    assert np.abs(curve.evaluate(hit) - (5.0, 4.0)).max() < 1.0
    assert len(space_on([box(4.9, 4.3, 5.1, 5.0)]).obstructed(curve)) == 0


def test_only_discs_near_a_way_matter_to_its_curve():
    way = np.array([[1.0, 1.0], [9.0, 1.0]])
    space = space_on(discs=[(5.0, 2.0, 0.5), (5.0, 6.0, 0.5)]).near(way)
    np.testing.assert_array_equal(space.discs, [(5.0, 2.0, 0.5)])
    assert space_on().near(way).discs.shape == (0, 3)
