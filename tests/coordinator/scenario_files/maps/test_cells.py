import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from coordinator.scenario_files.maps.cells import Grid, TooManyCornersError, outline_cells

GROWTHS = (0.0, 0.5, 1.0, 2.5)


def cells(picture):
    """Return the cells of a picture, whose first line is the top row."""
    return np.array([[char == "#" for char in line] for line in picture.split()])[::-1]


def polygons_of(occupied, most):
    """Return checked polygons and the growth: simple, nothing uncovered, nothing grown further."""
    outlines, growth = outline_cells(occupied, most)
    polygons = [shapely.Polygon(outline) for outline in outlines]
    for polygon in polygons:
        assert polygon.is_valid
        assert polygon.exterior.is_ccw
    y, x = np.nonzero(occupied)
    true = shapely.union_all(shapely.box(x, y, x + 1, y + 1))
    union = shapely.union_all(polygons)
    assert growth <= most
    assert (true - union).area < 1e-9
    grown = shapely.buffer(true, 1.0005 * growth + 1e-6, quad_segs=48) if growth else true
    assert (union - grown).area < 1e-9
    return polygons, growth


def turned_box(size, angle, wide, high):
    """Return the cells of a box turned by an angle around the middle of a square."""
    y, x = np.mgrid[0:size, 0:size] + 0.5 - 0.5 * size
    across = x * math.cos(angle) + y * math.sin(angle)
    along = y * math.cos(angle) - x * math.sin(angle)
    return (abs(across) < 0.5 * wide) & (abs(along) < 0.5 * high)


GOLDEN = {
    "one cell": ("#", [4]),
    "two cells that touch at a corner": ("#.\n.#", [4, 4]),
    "an L": ("#.\n##", [6]),
    "a ring around a yard": ("###\n#.#\n###", [4, 8]),
    "a ring that closes at a corner": ("##.\n#.#\n###", [4, 4, 6]),
    "a yard within a yard": ("#####\n#...#\n#.#.#\n#...#\n#####", [4, 8, 8]),
    "two yards side by side": ("#####\n#.#.#\n#####", [4, 8, 8]),
    "nothing": ("..\n..", []),
}


@pytest.mark.parametrize("name", GOLDEN)
def test_a_small_picture_becomes_few_exact_polygons(name):
    picture, corners = GOLDEN[name]
    polygons, growth = polygons_of(cells(picture), 0.0)
    assert growth == 0.0
    assert sorted(len(polygon.exterior.coords) - 1 for polygon in polygons) == corners


@settings(derandomize=True, max_examples=60, deadline=None)
@given(arrays(np.bool_, st.tuples(st.integers(1, 12), st.integers(1, 12))))
def test_any_cells_are_covered_and_no_polygon_grows_too_far(occupied):
    for most in GROWTHS:
        polygons_of(occupied, most)


@settings(derandomize=True, max_examples=10, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.0, 7.0), st.floats(2.0, 30.0), st.floats(2.0, 30.0))
def test_slanted_walls_with_ragged_edges_are_covered(seed, angle, wide, high):
    dice = np.random.default_rng(seed)
    occupied = turned_box(44, angle, wide, high) & (dice.random((44, 44)) > 0.02)
    for most in GROWTHS:
        polygons_of(occupied, most)


def test_every_cell_centre_is_inside_exactly_when_the_cell_is_occupied():
    dice = np.random.default_rng(5)
    occupied = dice.random((40, 30)) < 0.55
    polygons, _ = polygons_of(occupied, 0.0)
    y, x = np.mgrid[0:40, 0:30]
    inside = shapely.covers(shapely.union_all(polygons), shapely.points(x + 0.5, y + 0.5))
    assert (inside == occupied).all()
    overlap = sum(polygon.area for polygon in polygons) - occupied.sum()
    assert abs(overlap) < 1e-9


@pytest.mark.parametrize("angle", [0.05, 0.2, 0.4, 0.6, math.pi / 4, 1.1])
def test_a_straight_slanted_wall_needs_few_corners_at_one_cell(angle):
    occupied = turned_box(160, angle, 110, 60)
    exact, _ = polygons_of(occupied, 0.0)
    bridged, growth = polygons_of(occupied, 1.0)
    assert growth <= 1.0
    assert len(bridged[0].exterior.coords) <= 28 < len(exact[0].exterior.coords)


def test_walls_along_the_grid_and_their_single_steps_stay_exact():
    occupied = np.zeros((12, 40), np.bool_)
    occupied[:5, :20] = occupied[:4, 20:] = occupied[6:, :21] = occupied[5:, 21:] = True
    (low, high), growth = polygons_of(occupied, 1.0)
    assert growth == 0.0
    assert shapely.distance(low, high) == 1.0


def test_two_bridges_never_meet_in_a_slanted_passage():
    y, x = np.mgrid[0:60, 0:60]
    for slope in (0.3, 0.5, 1.0, 1.7):
        passage = abs(y - slope * x - 3.0) < 1.6 * math.hypot(1.0, slope)
        polygons, _ = polygons_of(~passage, 1.0)
        assert len(polygons) == 2
        assert shapely.distance(*polygons) > 0.2


def test_noise_is_refused_with_both_numbers():
    y, x = np.mgrid[0:1000, 0:1000]
    with pytest.raises(TooManyCornersError, match=r"2000000 corners, more than 1000000"):
        outline_cells((x + y) % 2 == 0, 1.0)


def test_a_grid_is_turned_around_the_corner_of_its_first_cell():
    grid = Grid(cells("#.\n.."), 0.5, 3.0, 4.0, math.pi / 2)
    ((corners,), growth) = grid.obstacles(0.5)
    assert growth == 0.0
    assert np.allclose(sorted(corners), [(2.0, 4.0), (2.0, 4.5), (2.5, 4.0), (2.5, 4.5)])
    assert np.allclose(grid.boundary(), [(3.0, 4.0), (3.0, 5.0), (2.0, 5.0), (2.0, 4.0)])
