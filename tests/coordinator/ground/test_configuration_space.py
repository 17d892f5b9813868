"""Ways over the ground: as short as the full visibility graph's, blocked where floors are."""

import itertools
import math
import random

import numpy as np
import pytest
import shapely

from coordinator.ground import configuration_space
from coordinator.ground.configuration_space import Ground
from coordinator.ground.configuration_space import search as usual_search
from coordinator.ground.free_space import NO_DISCS
from coordinator.ground.grown_floor import GrownFloor
from coordinator.ground.growth import Rings
from tests.floors import KINDS, FloorCase, box, is_free, random_floor, random_places, solid_of
from tests.oracles_floor import VisibilityGraph, convex_corners, grown
from tests.sweeps import seeds

BOX = box(0, 0, 10, 8)
SLACK = 1e-6
"""Blocked ground is smaller by this than what is grown."""


def way_length(way):
    return math.inf if way is None else float(np.hypot(*np.diff(way, axis=0).T).sum())


def ground_of(obstacles, reach=0.2, boundary=BOX):
    return Ground(Rings.of(obstacles, np.array(boundary)), reach)


def find(obstacles, start, goal, reach=0.2, boundary=BOX):
    ground = ground_of(obstacles, reach, boundary)
    return ground.shortest_way(np.array(start, float), np.array(goal, float), NO_DISCS)


def floors_of(kind, count):
    first = sorted(KINDS).index(kind)
    return ((seed, random_floor(seed)) for seed in range(first, count, len(KINDS)))


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_ways_on_500_floors_are_as_short_as_the_full_visibility_graphs(kind):
    for seed, floor in floors_of(kind, 510):
        ground = ground_of(floor.obstacles, floor.reach, floor.boundary)
        blocked = grown(floor, floor.reach - SLACK)
        graph = VisibilityGraph(blocked, convex_corners(grown(floor, floor.reach)))
        solid = solid_of(floor)
        places = random_places(floor, 4, seed)
        for start, goal in zip(places[::2], places[1::2], strict=False):
            way = ground.shortest_way(start, goal, NO_DISCS)
            wanted = graph.length(start, goal)
            assert way_length(way) == pytest.approx(wanted, rel=1e-6), (seed, start, goal)
            if way is not None:
                line = shapely.LineString(way)
                assert not shapely.intersects(blocked, line), (seed, start, goal)
                assert not shapely.dwithin(solid, line, floor.reach - 2 * SLACK)
                assert way[0].tolist() == start.tolist()
                assert way[-1].tolist() == goal.tolist()


@pytest.mark.parametrize("share", [0.99, 0.9999, 1.0001, 1.01])
@pytest.mark.parametrize("seed", seeds(12))
def test_a_door_lets_pass_what_is_narrower_and_nothing_else(seed, share):
    dice = random.Random(seed)
    reach, angle = dice.uniform(0.05, 0.6), dice.choice((0.0, dice.uniform(0.0, 6.0)))
    c, s = math.cos(angle), math.sin(angle)
    door, at = 2.0 * reach * share, dice.uniform(2.0, 7.0)
    rings = [BOX, box(-1, 3, at, 5), box(at + door, 3, 11, 4), [(2.0, 1.0), (8.0, 7.0)]]
    *rings, ends = [[(c * x - s * y, s * x + c * y) for x, y in ring] for ring in rings]
    way = find(rings[1:], *ends, reach=reach, boundary=rings[0])
    assert (way is not None) == (share > 1.0)


@pytest.mark.parametrize("part", range(5))
def test_none_of_10000_queries_hangs_or_crashes(part):
    for seed in range(50 * part, 50 * part + 50):
        floor, dice = random_floor(seed), random.Random(seed)
        ground = ground_of(floor.obstacles, floor.reach, floor.boundary)
        solid = solid_of(floor)
        for _ in range(40):
            start, goal = awkward_place(dice, floor), awkward_place(dice, floor)
            goal = start if dice.random() < 0.05 else goal
            way = ground.shortest_way(start, goal, NO_DISCS)
            if way is None:
                continue
            assert np.isfinite(way).all()
            assert (way[0].tolist(), way[-1].tolist()) == (start.tolist(), goal.tolist())
            if is_plainly_free(floor, solid, start) or is_plainly_free(floor, solid, goal):
                line = shapely.LineString(way)
                assert not shapely.dwithin(solid, line, floor.reach - 2 * SLACK), (seed, way)


def awkward_place(dice, floor):
    """Anywhere: off the floor, inside of what is solid, on corners, on edges, at grown corners."""
    ring = dice.choice([floor.boundary, *floor.obstacles])
    k = dice.randrange(len(ring))
    a, b = np.array(ring[k - 1]), np.array(ring[k])
    what = dice.choice(("anywhere", "corner", "edge", "middle", "around"))
    if what == "corner":
        return a
    if what == "edge":
        return a + dice.random() * (b - a)
    if what == "middle":
        return np.mean(ring, axis=0)
    if what == "around":
        angle = dice.uniform(0.0, 2.0 * math.pi)
        return a + floor.reach * np.array([math.cos(angle), math.sin(angle)])
    low, high = np.min(floor.boundary, axis=0) - 1.0, np.max(floor.boundary, axis=0) + 1.0
    return np.array([dice.uniform(*ends) for ends in zip(low, high, strict=True)])


def is_plainly_free(floor, solid, place):
    """Whether a place keeps the reach, and lies outside of the tangent polygons at corners."""
    corners = np.array([*floor.boundary, *itertools.chain(*floor.obstacles)])
    apart = np.hypot(*(corners - place).T).min()
    return apart > 1.02 * floor.reach and is_free(solid, place, floor.reach)


def test_a_free_way_is_straight():
    assert len(find([box(4, 4, 5, 5)], (1, 1), (9, 2))) == 2


@pytest.mark.parametrize(
    ("name", "obstacles"),
    [
        ("a shared edge", [box(0, 3, 5, 5), box(5, 3, 10, 5)]),
        ("a shared part of an edge", [box(0, 3, 5, 5), box(5, 4.5, 10, 6)]),
        ("touching corners", [box(0, 2, 5, 4), box(5, 4, 10, 6)]),
        ("an overlap", [box(0, 3, 5.1, 5), box(5, 3, 10, 5)]),
        ("a crossing", [box(-1, 3, 11, 4), box(4, -1, 5, 9)]),
        ("one inside another", [box(0, 3, 10, 5), box(4, 3.5, 5, 4)]),
        ("the same obstacle twice", [box(0, 3, 10, 5), box(0, 3, 10, 5)]),
        ("a gap narrower than the robot", [box(0, 3, 4.9, 5), box(5.25, 3, 10, 5)]),
        ("a gap of a nanometre", [box(0, 3, 5, 5), box(5 + 1e-9, 3, 10, 5)]),
        ("a wall as thin as a hair", [box(0, 4, 10, 4 + 1e-6)]),
        ("the floor's edge", [box(0, 3, 9.7, 5)]),
        ("what sticks out of the floor", [box(-3, 3, 13, 5)]),
        ("a corner on an edge", [box(0, 3, 10, 3.5), [(5, 3.5), (6, 4), (4, 4)]]),
        ("cells that touch at corners", [box(k, k % 2 + 3, k + 1, k % 2 + 4) for k in range(10)]),
    ],
)
@pytest.mark.parametrize("reach", [0.2, 0.001])
def test_nothing_passes_between(name, obstacles, reach):
    if name.startswith(("a gap narrower", "the floor's edge")) and reach < 0.01:
        assert find(obstacles, (5, 1), (5, 7), reach) is not None
    else:
        assert find(obstacles, (5, 1), (5, 7), reach) is None, name


def test_no_way_runs_along_the_seam_of_two_boxes():
    way = find([box(3, 3, 5, 5), box(5, 3, 7, 5)], (5, 1), (5, 7))
    assert shapely.distance(shapely.LineString(way), shapely.box(3, 3, 7, 5)) > 0.2 - 2 * SLACK


def test_no_way_slips_through_the_point_where_two_cells_touch():
    cells = [box(4, 3, 5, 4), box(5, 4, 6, 5)]
    way = find(cells, (4.5, 4.5), (5.5, 3.5), reach=0.05)
    assert way_length(way) > 2.0
    assert way_length(find(cells, (4.3, 4.7), (5.7, 3.3), reach=0.2)) > 2.5


def test_a_start_inside_an_obstacle_has_no_way_out():
    assert find([box(4, 3, 6, 5)], (5, 4), (9, 4)) is None
    assert find([box(4, 3, 6, 5)], (9, 4), (5, 4)) is None
    assert find([], (11, 4), (5, 4)) is None


def test_a_place_nearer_to_a_wall_than_the_reach_has_no_way_out():
    assert find([box(4, 3, 6, 5)], (6.19, 4), (9, 4)) is None
    assert find([box(4, 3, 6, 5)], (6.2, 4), (9, 4)) is not None


def test_overlapping_polygons_are_passed_around_their_union():
    shapes = [box(3, 2, 6, 4), [(4, 3), (7, 3), (5, 6)], box(4, 1, 5, 5)]
    way = find(shapes, (1, 3.5), (9, 3.5))
    union = shapely.union_all([shapely.Polygon(ring) for ring in shapes])
    assert shapely.distance(shapely.LineString(way), union) == pytest.approx(0.2, abs=1e-5)


def test_a_way_leaves_a_u_by_its_opening():
    walls = [(3, 2), (7, 2), (7, 6), (3, 6), (3, 5.5), (6.5, 5.5), (6.5, 2.5), (3, 2.5)]
    way = find([walls], (5, 4), (9, 4))
    assert way[:, 0].min() < 3.0
    assert way_length(way) > 10.0


def test_a_closed_courtyard_has_no_way_out():
    walls = [box(2, 2, 7, 2.5), box(6.5, 2, 7, 6), box(2, 5.5, 7, 6), box(2, 2, 2.5, 6)]
    assert find(walls, (4, 4), (9, 4)) is None
    assert find(walls, (9, 4), (4, 4)) is None
    assert find(walls, (4, 4), (5, 5)) is not None
    assert find([*walls[:3], box(2, 2, 2.5, 5.0)], (4, 4), (9, 4)) is not None


def test_a_concave_floor_blocks_like_its_obstacles():
    floor = [(0, 0), (10, 0), (10, 8), (7, 8), (7, 2), (3, 2), (3, 8), (0, 8)]
    for boundary in (floor, floor[::-1]):
        way = find([], (1.5, 7), (8.5, 7), boundary=boundary)
        assert way_length(way) > 14.0
        assert shapely.distance(shapely.LineString(way), shapely.box(3, 2, 7, 8)) > 0.2 - 1e-5


def test_the_order_of_a_polygons_corners_does_not_matter():
    corners = [(4, 2), (6, 2), (6, 6), (5, 4), (4, 6)]
    ways = [find([ring], (1, 4), (9, 4)) for ring in (corners, corners[::-1])]
    assert way_length(ways[0]) == pytest.approx(way_length(ways[1]), abs=1e-12)


def test_a_way_there_is_as_long_as_the_way_back():
    for seed in seeds(30):
        floor = random_floor(seed)
        places = random_places(floor, 2, seed)
        if len(places) == 2:
            ground = ground_of(floor.obstacles, floor.reach, floor.boundary)
            there, back = (ground.shortest_way(*ends, NO_DISCS) for ends in (places, places[::-1]))
            assert way_length(there) == pytest.approx(way_length(back), rel=1e-12)


def test_a_way_that_is_found_from_its_goal_lies_in_memory_like_any_other(monkeypatch):
    """Kernels would be compiled anew for it, for ten seconds, in the middle of a working day."""
    looked = []

    def found(ends, _, *rest):
        looked.append(ends)
        return usual_search(ends, 1000 if len(looked) == 2 else 1, *rest)

    monkeypatch.setattr(configuration_space, "search", found)
    way = find([box(2, 1, 4, 6), box(6, 2, 8, 8)], (1, 4), (9, 7))
    assert len(looked) == 2
    assert way[0].tolist() == [1.0, 4.0]
    assert all(array.flags.c_contiguous for array in (*looked, way))


def test_earlier_searches_change_nothing():
    floor = random_floor(1)
    places = random_places(floor, 8, 1)
    ground = ground_of(floor.obstacles, floor.reach, floor.boundary)
    for start, goal in itertools.permutations(places, 2):
        fresh = ground_of(floor.obstacles, floor.reach, floor.boundary)
        used, new = (one.shortest_way(start, goal, NO_DISCS) for one in (ground, fresh))
        np.testing.assert_array_equal(used, new)


def test_ways_with_room_turn_farther_out():
    ground = Ground(Rings.of([box(4, 3, 6, 5)], np.array(BOX)), 0.2, room=0.3)
    way = ground.shortest_way(np.array([1.0, 4.0]), np.array([9.0, 4.1]), NO_DISCS)
    gaps = shapely.distance(shapely.box(4, 3, 6, 5), shapely.points(way[1:-1]))
    assert gaps.min() > 0.5 - 1e-9


def test_the_arc_decides_for_a_place_between_it_and_its_tangent_polygon():
    """Such a place is free, and straight ways from it may touch the arc but not cut it."""
    obstacle, reach = box(4, 3, 6, 5), 0.3
    ground = ground_of([obstacle], reach)
    blocked = grown(FloorCase("", BOX, [obstacle], reach), reach - SLACK)
    solid, dice, inside = shapely.Polygon(obstacle), random.Random(0), 0
    for _ in range(400):
        angle, apart = dice.uniform(0.0, math.pi / 2), dice.uniform(1.0, 1.019) * reach
        place = np.array([6 + apart * math.cos(angle), 5 + apart * math.sin(angle)])
        if not shapely.contains_xy(blocked, *place):
            continue
        inside += 1
        goal = np.array([dice.uniform(0.5, 9.5), dice.uniform(0.5, 7.5)])
        gap = shapely.distance(solid, shapely.LineString([place, goal]))
        if abs(gap - reach) > 1e-5 and shapely.distance(solid, shapely.Point(goal)) > 1.03 * reach:
            assert ground.clear(place, goal) == (gap > reach)
            assert ground.clear(goal, place) == (gap > reach)
            way = ground.shortest_way(place, goal, NO_DISCS)
            if way is not None:
                assert shapely.distance(solid, shapely.LineString(way)) > reach - 2 * SLACK
    assert inside > 50


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_ways_scale_with_the_floor(scale):
    rings = [[(scale * x, scale * y) for x, y in ring] for ring in (BOX, box(4, 2, 6, 7))]
    ends = scale * np.array([[1.0, 4.0], [9.0, 4.1]])
    way = find([rings[1]], *ends, reach=0.2 * scale, boundary=rings[0])
    wanted = way_length(find([box(4, 2, 6, 7)], (1, 4), (9, 4.1)))
    assert way_length(way) == pytest.approx(scale * wanted, rel=1e-3)


def test_one_ground_is_kept_per_reach_and_room():
    floor = GrownFloor(BOX, [box(4, 3, 6, 5)])
    assert floor.ground(0.2) is floor.ground(0.2)
    assert floor.ground(0.2) is not floor.ground(0.2, 0.1)
    assert floor.ground(0.2) is not floor.ground(0.3)
