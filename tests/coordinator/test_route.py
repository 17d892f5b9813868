"""Ways around obstacles: as short as the full visibility graph's, blocked where floors are."""

import math
import random

import numpy as np
import pytest
import shapely

from coordinator.floor import Disc, Floor, grow
from coordinator.route import shortest_way
from tests.oracles import every_corner, shortest_length

BOX = [(0.0, 0.0), (10.0, 0.0), (10.0, 8.0), (0.0, 8.0)]


def box(x0, y0, x1, y1):
    return [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]


def way_length(way):
    return float(np.hypot(*np.diff(way, axis=0).T).sum())


def find(obstacles, start, goal, reach=0.2, boundary=BOX, room=0.003, discs=()):
    ground = Floor(boundary, obstacles).ground(reach, room, discs)
    return shortest_way(ground, np.array(start), np.array(goal))


def random_floor(seed):
    dice = random.Random(seed)
    shapes = []
    for _ in range(dice.randint(2, 7)):
        x, y, w, h = dice.uniform(1, 8), dice.uniform(1, 6), dice.uniform(0.3, 2.5), 0.3
        kind = dice.choice(("box", "triangle", "u", "pair"))
        if kind == "box":
            shapes.append(box(x, y, x + w, y + dice.uniform(0.3, 2.0)))
        elif kind == "triangle":
            turns = sorted(dice.uniform(0, 2 * math.pi) for _ in range(3))
            shapes.append([(x + w * math.cos(a), y + w * math.sin(a)) for a in turns])
        elif kind == "u":
            outer = [(x, y), (x + w + 1, y), (x + w + 1, y + 1.5), (x + w + 1 - h, y + 1.5)]
            inner = [(x + w + 1 - h, y + h), (x + h, y + h), (x + h, y + 1.5), (x, y + 1.5)]
            shapes.append(outer + inner)
        else:
            shapes += [box(x, y, x + w, y + h), box(x + w, y + h, x + w + h, y + h + w)]
    return shapes, dice.uniform(0.05, 0.4)


@pytest.mark.parametrize("seed", range(40))
def test_a_way_is_as_short_as_that_of_the_full_visibility_graph(seed):
    obstacles, reach = random_floor(seed)
    floor = Floor(BOX, obstacles)
    room = 0.003
    ground = floor.ground(reach, room)
    dice = random.Random(seed + 1000)
    free = shapely.difference(shapely.Polygon(BOX), shapely.buffer(ground.blocked, 0.05))
    places = [(dice.uniform(0, 10), dice.uniform(0, 8)) for _ in range(200)]
    places = [place for place in places if shapely.contains_xy(free, *place)][:4]
    outer = shapely.union_all([floor.grown(reach + room)])
    for start, goal in zip(places[::2], places[1::2], strict=False):
        way = shortest_way(ground, np.array(start), np.array(goal))
        wanted = shortest_length(ground.blocked, every_corner(outer), start, goal)
        if way is None:
            assert wanted == math.inf
            continue
        # The oracle may also turn at concave corners, within the room that is left for rounding.
        assert wanted - 1e-9 <= way_length(way) <= wanted + room
        same = shortest_length(ground.blocked, ground.corners, start, goal)
        assert way_length(way) == pytest.approx(same, abs=1e-9)
        assert shapely.LineString(way).disjoint(ground.blocked)


def test_a_free_way_is_straight():
    assert len(find([box(4, 4, 5, 5)], (1, 1), (9, 2))) == 2


@pytest.mark.parametrize(
    ("name", "obstacles"),
    [
        ("a shared edge", [box(0, 3, 5, 5), box(5, 3, 10, 5)]),
        ("a shared part of an edge", [box(0, 3, 5, 5), box(5, 4.5, 10, 6)]),
        ("touching corners", [box(0, 2, 5, 4), box(5, 4, 10, 6)]),
        ("an overlap", [box(0, 3, 5.1, 5), box(5, 3, 10, 5)]),
        ("a gap narrower than the robot", [box(0, 3, 4.9, 5), box(5.25, 3, 10, 5)]),
        ("the floor's edge", [box(0, 3, 9.7, 5)]),
        ("a corner on an edge", [box(0, 3, 10, 3.5), [(5, 3.5), (6, 4), (4, 4)]]),
    ],
)
def test_nothing_passes_between(name, obstacles):
    assert find(obstacles, (5, 1), (5, 7)) is None, name


def test_a_robot_too_small_to_be_stopped_still_does_not_pass_a_seam():
    for obstacles in ([box(0, 3, 5, 5), box(5, 3, 10, 5)], [box(0, 2, 5, 4), box(5, 4, 10, 6)]):
        assert find(obstacles, (5, 1), (5, 7), reach=0.001, room=0.0005) is None


def test_a_gap_just_wide_enough_is_passed():
    way = find([box(0, 3, 4.9, 5), box(5.32, 3, 10, 5)], (5, 1), (5, 7))
    assert way is not None
    assert way_length(way) < 7.0


def test_a_way_leaves_a_u_by_its_opening():
    walls = [(3, 2), (7, 2), (7, 6), (3, 6), (3, 5.5), (6.5, 5.5), (6.5, 2.5), (3, 2.5)]
    way = find([walls], (5, 4), (9, 4))
    assert way[:, 0].min() < 3.0
    assert way_length(way) > 10.0


def test_a_closed_courtyard_has_no_way_out():
    walls = [box(2, 2, 7, 2.5), box(6.5, 2, 7, 6), box(2, 5.5, 7, 6), box(2, 2, 2.5, 6)]
    assert find(walls, (4, 4), (9, 4)) is None
    assert find(walls, (4, 4), (5, 5)) is not None
    assert find([*walls[:3], box(2, 2, 2.5, 5.0)], (4, 4), (9, 4)) is not None


def test_a_concave_floor_blocks_like_its_obstacles():
    floor = [(0, 0), (10, 0), (10, 8), (7, 8), (7, 2), (3, 2), (3, 8), (0, 8)]
    way = find([], (1.5, 7), (8.5, 7), boundary=floor)
    assert way_length(way) > 14.0
    assert shapely.distance(shapely.LineString(way), shapely.box(3, 2, 7, 8)) > 0.2 - 1e-5


def test_discs_are_kept_off():
    disc = Disc(5.0, 1.0, 0.8)
    way = find([], (1, 1), (9, 1), discs=[disc])
    assert shapely.distance(shapely.LineString(way), shapely.Point(5, 1)) > 0.8 - 1e-5


@pytest.mark.parametrize("seed", range(12))
def test_grown_ground_holds_the_true_offset_and_little_more(seed):
    obstacles, reach = random_floor(seed)
    solid = shapely.union_all([shapely.Polygon(corners) for corners in obstacles])
    grown = grow(shapely.get_parts(solid), reach)
    true = shapely.points(every_corner(shapely.buffer(solid, reach, quad_segs=64)))
    assert shapely.distance(grown, true).max() < 1e-9
    beyond = shapely.distance(solid, shapely.points(every_corner(grown))).max()
    assert beyond <= reach / math.cos(math.pi / 8) + 1e-9


def test_the_order_of_a_polygons_corners_does_not_matter():
    corners = [(4, 2), (6, 2), (6, 6), (5, 4), (4, 6)]
    ways = [find([ring], (1, 4), (9, 4)) for ring in (corners, corners[::-1])]
    assert way_length(ways[0]) == pytest.approx(way_length(ways[1]), abs=1e-12)
