"""How far a line is from anything solid, against shapely's distance to all of it in one piece."""

import numpy as np
import pytest
import shapely

from coordinator.scenario.floor import Floor

BOUNDARY = [(0.0, 0.0), (10.0, 0.0), (10.0, 8.0), (5.0, 6.0), (0.0, 8.0)]
OBSTACLES = [
    [(2.0, 2.0), (4.0, 2.0), (4.0, 4.0), (2.0, 4.0)],
    [(4.0, 3.0), (6.0, 3.0), (6.0, 5.0), (4.0, 5.0)],
    [(3.0, 3.0), (5.0, 3.0), (5.0, 3.5), (3.0, 3.5)],
    [(9.0, 1.0), (12.0, 1.0), (12.0, 2.0), (9.0, 2.0)],
]


def test_lines_are_as_far_from_the_solid_as_from_all_of_it_joined():
    floor, outline = Floor(BOUNDARY, OBSTACLES), shapely.Polygon(BOUNDARY)
    around = shapely.difference(shapely.box(-90.0, -90.0, 90.0, 90.0), outline)
    solid = shapely.union_all([around, *map(shapely.Polygon, OBSTACLES)])
    rng = np.random.default_rng(5)
    gaps = []
    for _ in range(2_000):
        steps = rng.normal(0.0, 10.0 ** rng.uniform(-2.0, 0.0), (rng.integers(2, 20), 2))
        line = rng.uniform((-3.0, -3.0), (13.0, 11.0)) + np.cumsum(steps, axis=0)
        gaps.append(floor.gap(line))
        assert gaps[-1] == pytest.approx(shapely.distance(solid, shapely.linestrings(line)))
        place = np.stack((line[0], line[0]))
        assert floor.gap(place) == pytest.approx(shapely.distance(solid, shapely.Point(line[0])))
    assert 300 < np.count_nonzero(gaps) < 1_500


@pytest.mark.parametrize("place", [(50.0, 4.0), (5.0, 7.0), (-0.5, 4.0), (11.0, 1.5), (4.5, 3.2)])
def test_a_line_that_lies_wholly_in_the_solid_keeps_no_distance(place):
    line = np.add(place, [(0.0, 0.0), (0.01, 0.0), (0.01, 0.01)])
    assert Floor(BOUNDARY, OBSTACLES).gap(line) == 0.0


@pytest.mark.parametrize(
    ("place", "what"),
    [
        ((11.0, 5.0), "is off the floor"),
        ((3.0, 2.5), "is inside workspace.obstacles[0]"),
        ((1.8, 3.0), "is nearer than 0.3 m to workspace.obstacles[0]"),
        ((0.2, 3.0), "is nearer than 0.3 m to the floor's edge"),
        ((9.5, 1.5), "is inside the closed place wet"),
        ((8.8, 1.5), "is nearer than 0.3 m to the closed place wet"),
        ((1.7, 3.0), ""),
    ],
)
def test_what_is_too_near_is_told_by_its_name(place, what):
    floor = Floor(BOUNDARY, OBSTACLES, ["the closed place wet"])
    assert floor.what_is_at(place, 0.3) == what
    assert (floor.distance(np.array([place]))[0] < 0.3) == bool(what)
