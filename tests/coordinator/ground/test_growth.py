"""Grown outlines: against a naive union of strips and tangent polygons."""

import math

import numpy as np
import pytest
import shapely

from coordinator.ground.growth import Rings, grow
from tests.floors import box, random_floor, solid_of
from tests.oracles_floor import convex_corners, grown
from tests.sweeps import seeds

FLOOR = box(0, 0, 10, 8)
SEEDS = seeds(60)


def outline_of(floor):
    return grow(Rings.of(floor.obstacles, np.array(floor.boundary)), floor.reach)


def lines_of(outline):
    return shapely.linestrings(outline.edges.reshape(-1, 2, 2))


def alone(ring, distance=0.3):
    """The outline of one polygon, without that of the floor around it."""
    outline = grow(Rings.of([ring], np.array(box(-50, -50, 50, 50))), distance)
    return outline, np.abs(outline.turns).max(axis=1) < 40


def apart(places, others):
    return np.hypot(*(places[:, None] - others).transpose(2, 0, 1)).min(axis=1)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_grown_area_ends_at_edges_of_the_outline(seed):
    floor = random_floor(seed)
    outline = outline_of(floor)
    border = shapely.intersection(
        shapely.boundary(grown(floor, floor.reach)), shapely.Polygon(floor.boundary)
    )
    places = shapely.points(shapely.get_coordinates(shapely.segmentize(border, 0.1)))
    tree = shapely.STRtree(lines_of(outline))
    _, apart_from_edges = tree.query_nearest(places, all_matches=False, return_distance=True)
    assert apart_from_edges.max() < 1e-8


@pytest.mark.parametrize("seed", SEEDS)
def test_every_corner_that_a_taut_way_can_turn_at_is_a_turn(seed):
    floor = random_floor(seed)
    outline = outline_of(floor)
    area = shapely.simplify(grown(floor, floor.reach), 1e-7)
    corners = convex_corners(area, least_turn=0.05)
    corners = corners[shapely.contains_xy(shapely.Polygon(floor.boundary), corners)]
    if len(corners):
        assert apart(corners, outline.turns).max() < 1e-8


@pytest.mark.parametrize("seed", SEEDS)
def test_no_edge_lies_farther_out_than_the_tangent_polygons_reach(seed):
    floor = random_floor(seed)
    outline = outline_of(floor)
    most = floor.reach / math.cos(math.pi / 16)
    ends = shapely.points(outline.edges.reshape(-1, 2))
    assert shapely.distance(ends, solid_of(floor)).max() <= most + 1e-9


@pytest.mark.parametrize("seed", SEEDS)
def test_the_true_offset_is_never_left_out(seed):
    floor = random_floor(seed)
    solid = shapely.union_all([shapely.Polygon(ring) for ring in floor.obstacles], grid_size=1e-9)
    area = grown(floor, floor.reach)
    arcs = shapely.get_coordinates(shapely.buffer(solid, floor.reach, quad_segs=32))
    assert shapely.distance(area, shapely.points(arcs)).max() < 1e-6


@pytest.mark.parametrize("degrees", [1, 22, 23, 45, 46, 90, 120, 179])
def test_a_corner_turns_in_equal_steps_of_at_most_22_degrees_and_a_half(degrees):
    theta = math.radians(degrees)
    tip = (math.cos(theta), math.sin(theta))
    outline, near = alone([(-1, 0), (0, 0), tip, (tip[0] - 2, tip[1] + 3)])
    turns = outline.turns[near & (np.hypot(*outline.turns.T) < 0.32)]
    count = math.ceil(degrees / 22.5 - 1e-9)
    assert len(turns) == count
    half = theta / (2 * count)
    np.testing.assert_allclose(np.hypot(*turns.T), 0.3 / math.cos(half), rtol=1e-9)


def test_the_directions_at_a_turn_lead_to_its_neighbours():
    outline, near = alone([(0, 0), (4, 1), (3, 4), (1, 3)])
    turns, before, after = outline.turns[near], outline.before[near], outline.after[near]
    hull = shapely.get_coordinates(shapely.convex_hull(shapely.multipoints(turns)))[:-1]
    hull = hull[::-1] if not shapely.LinearRing(hull).is_ccw else hull
    assert len(hull) == len(turns)
    for place, back, onward in zip(turns, before, after, strict=True):
        k = int(np.argmin(np.hypot(*(hull - place).T)))
        for ahead, wanted in ((onward, hull[(k + 1) % len(hull)]), (back, hull[k - 1])):
            leg = wanted - place
            np.testing.assert_allclose(ahead, leg / math.hypot(*leg), atol=1e-9)


def test_edges_know_the_corners_that_they_run_beyond():
    outline, _ = alone(box(1, 1, 3, 2))
    corners = Rings.of([box(1, 1, 3, 2)], np.array(box(-50, -50, 50, 50))).corners
    whole = np.isinf(outline.beyond).all(axis=1)
    ends = outline.edges.reshape(-1, 2, 2)
    along = ends[:, 1] - ends[:, 0]
    along /= np.hypot(*along.T)[:, None]
    for end, sign in ((0, 1.0), (1, -1.0)):
        owned = ~whole & (outline.owners[:, end] >= 0)
        feet = ends[owned, end] + sign * outline.beyond[owned, end][:, None] * along[owned]
        apart_from_owner = np.hypot(*(feet - corners[outline.owners[owned, end]]).T)
        np.testing.assert_allclose(apart_from_owner, 0.3, rtol=1e-9)
    for k in np.flatnonzero(whole):
        assert outline.owners[k, 0] == outline.owners[k, 1]
        gap = shapely.distance(
            shapely.LineString(ends[k]), shapely.Point(corners[outline.owners[k, 0]])
        )
        assert gap == pytest.approx(0.3, rel=1e-9)


def test_the_sense_of_rotation_does_not_matter():
    ring = [(4.0, 2.0), (6.0, 2.0), (6.0, 6.0), (5.0, 4.0), (4.0, 6.0)]
    places = [
        grow(Rings.of([one], np.array(floor)), 0.2).turns
        for one in (ring, ring[::-1])
        for floor in (FLOOR, FLOOR[::-1])
    ]
    for other in places[1:]:
        assert apart(other, places[0]).max() < 1e-12


def test_doubled_corners_and_corners_on_a_straight_edge_turn_nothing():
    plain = alone(box(1, 1, 3, 2))[0].turns
    doubled = [(1, 1), (1, 1), (2, 1), (3, 1), (3, 1), (3, 2), (1.5, 2), (1, 2)]
    assert apart(alone(doubled)[0].turns, plain).max() < 1e-12
    assert len(alone(doubled)[0].turns) == len(plain) == 16


def test_a_floor_without_obstacles_has_no_turns():
    outline = grow(Rings.of([], np.array(FLOOR)), 0.2)
    assert outline.turns.shape == (0, 2)
    assert len(outline.edges) == 4
